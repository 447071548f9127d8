"""`TrackMapper` on cards before a wall."""

from __future__ import annotations

import json

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame
from thingmap.detectors.detections import Detections
from thingmap.mapper.estimation.records import Loop
from thingmap.mapper.estimation.view_log import Verdict
from thingmap.mapper.map.object_map import MapFrame
from thingmap.mapper.multiview.track_mapper import TrackMapper

LEFT, RIGHT = ((-0.2, 0.0, 1.0), 0.06), ((0.2, 0.1, 1.2), 0.08)
CUP, BOWL, NOTHING = (0.7, 0.1), (0.2, 0.5), (0.05, 0.05)


@pytest.fixture
def cards(tools):
    return tools.Cards(LEFT, RIGHT)


def test_two_cameras_and_two_cards_by_hand(cards):
    mapper = cards.map([(0.0, {0: CUP, 1: BOWL}), (0.1, {1: BOWL, 0: (0.3, 0.3)})], least_probability=1e-9)
    cup, bowl = mapper.object_map().things
    assert [cup.id, cup.label, bowl.id, bowl.label] == ["thing-0000", "cup", "thing-0001", "bowl"]
    joint = np.array([0.7 * 0.3, 0.1 * 0.3, 0.2 * 0.4])  # equation (2), from a uniform start; the background last
    posterior = joint / joint.sum()
    assert cup.existence == pytest.approx(1.0 - posterior[2])
    assert cup.probability == pytest.approx(joint[0] / joint[:2].sum())
    assert bowl.existence == pytest.approx(1.0 - 0.09 / (0.04 + 0.25 + 0.09))
    for thing, (centre, half) in zip((cup, bowl), cards.cards, strict=True):
        np.testing.assert_allclose(thing.position, centre, atol=0.01)
        size = np.abs(mapper.object_map().R_world_upright @ thing.size)  # x, y, z of the world
        np.testing.assert_allclose(size[:2], 2 * half, rtol=0.2)
        assert size[2] < 0.02
        assert thing.evidence.supporting == 2 and thing.evidence.contradicting == 0
        assert (thing.first_seen, thing.last_seen) == (0.0, 1.0)
    assert mapper.track_labels()[0] == (0, pytest.approx(posterior[0]))
    assert mapper.object_map().frame is MapFrame.DATASET


def test_detections_are_known_by_their_tracks(cards):
    mapper = cards.map([(0.0, {0: CUP, 1: BOWL}), (0.1, {1: BOWL, 0: CUP})])
    boxes, tracks = mapper.image_tracks(1)
    np.testing.assert_array_equal(tracks, [1, 0])
    np.testing.assert_array_equal(boxes, cards.detect(0.1, {1: BOWL, 0: CUP}).xyxy)
    with pytest.raises(IndexError, match="2 there are"):
        mapper.image_tracks(2)


def test_a_detection_without_depth_is_of_no_track(cards):
    mapper = cards.map([], far=1.1)
    mapper.process_frame(cards.frame(0, 0.0), cards.detect(0.0, {0: CUP, 1: BOWL}))
    np.testing.assert_array_equal(mapper.image_tracks(0)[1], [0, -1])
    assert mapper.statistics()["outcomes"]["out_of_range"] == 1


def test_a_track_seen_in_too_few_of_the_views_that_could_show_it_is_dropped(cards):
    views = [(0.01 * i, {0: CUP, 1: BOWL} if i >= 5 else {0: CUP}) for i in range(10)]
    mapper = cards.map(views)
    assert [thing.label for thing in mapper.object_map().things] == ["cup"]
    assert mapper.statistics()["tracks"] == {
        "views": 10,
        "observations": 15,
        "tracks": 2,
        "kept": 1,
        "background": 0,
        "dropped": 1,
        "repeated": 0,
    }
    dropped = mapper.object_map(include_doubtful=True).things[1]
    assert dropped.label == "bowl" and 0.0 < dropped.existence < 0.5
    assert (dropped.evidence.supporting, dropped.evidence.contradicting) == (5, 5)  # those before it began count
    labels = mapper.track_labels()
    assert labels[0][0] == 0 and labels[1][0] == -1
    assert len(cards.map(views, min_share=0.5).object_map()) == 2


def test_a_track_that_is_hidden_is_not_missed(tools):
    """Ten views, a card before the bowl in five of them: seen in five of the five that could show it."""
    cards = tools.Cards(((0.0, 0.0, 1.5), 0.05), ((-0.16, 0.0, 0.8), 0.1))
    views = [(0.01 * i, {0: BOWL}) for i in range(5)] + [(-0.3 - 0.01 * i, {0: BOWL}) for i in range(5)]
    assert [len(cards.detect(x, scores)) for x, scores in views] == [1] * 5 + [0] * 5
    mapper = cards.map(views)
    (bowl,) = mapper.object_map().things
    assert (bowl.evidence.supporting, bowl.evidence.occluded, bowl.evidence.contradicting) == (5, 5, 0)
    kinds = [view.verdict for view in bowl.explain(in_time_order=True)]
    assert kinds == [Verdict.SUPPORTED] * 5 + [Verdict.OCCLUDED] * 5


def test_too_few_views_in_all(cards):
    mapper = cards.map([(0.0, {0: CUP})], min_views=2)
    assert len(mapper.object_map()) == 0 and len(mapper.object_map(include_doubtful=True)) == 1


def test_likely_background_is_not_in_the_map(cards):
    mapper = cards.map([(0.02 * i, {0: NOTHING, 1: CUP}) for i in range(3)])
    assert [thing.id for thing in mapper.object_map().things] == ["thing-0001"]
    assert mapper.statistics()["tracks"]["background"] == 1
    assert mapper.track_labels()[0] == (-1, pytest.approx(0.9**3 / (0.9**3 + 2 * 0.05**3)))
    assert mapper.object_map(include_doubtful=True).things[0].existence < 0.01


def test_background_by_a_hair_stays_below_one_half(cards):
    mapper = cards.map([(0.0, {0: (0.33, 0.33)})])  # background .34: likeliest, though likelier something
    assert mapper.object_map().things == ()
    assert mapper.object_map(include_doubtful=True).things[0].existence == pytest.approx(0.49)


def test_a_far_detection_starts_a_track_of_its_own(cards):
    moved = type(cards)(((-0.2, 0.05, 1.0), 0.06))
    for distance, tracks in ((0.06, 1), (0.04, 2)):
        mapper = cards.map([(0.0, {0: CUP})], max_distance=distance)
        mapper.process_frame(moved.frame(1, 0.0), moved.detect(0.0, {0: CUP}))
        assert mapper.statistics()["tracks"]["tracks"] == tracks


def test_tracks_move_when_poses_are_corrected(cards):
    mapper = cards.map([(0.0, {}), (0.1, {0: CUP})], min_share=0.5)
    before = mapper.object_map().things[0].position
    T_a_b = cards.pose(0.15)  # 5 cm farther than was thought
    mapper._camera.smoother.add(Loop(0, 1, T_a_b, 1e-8 * np.eye(6)))
    mapper._camera.smoother.update()
    mapper._assessment = None
    after = mapper.object_map().things[0].position
    np.testing.assert_allclose(after - before, [0.05, 0.0, 0.0], atol=0.003)
    np.testing.assert_allclose(mapper.assess().centroids[0], after, atol=0.02)


def test_every_view_explains_itself(cards):
    mapper = cards.map([(0.0, {0: CUP}), (0.02, {0: (0.1, 0.6)}), (0.04, {})], min_share=0.5)
    (thing,) = mapper.object_map().things
    views = thing.explain("cup", in_time_order=True).views
    assert [view.verdict for view in views] == [Verdict.SUPPORTED, Verdict.SUPPORTED, Verdict.MISSED]
    assert views[0].log_ratio == pytest.approx(np.log(0.7 / 0.2), abs=0.01)
    assert views[1].log_ratio == pytest.approx(np.log(0.1 / 0.3), abs=0.01)
    assert (views[1].found_as, views[1].score) == ("bowl", pytest.approx(0.6))


def test_a_map_survives_its_file(cards, tmp_path):
    object_map = cards.map([(0.0, {0: CUP, 1: BOWL}), (0.1, {0: CUP, 1: BOWL})]).object_map()
    loaded = type(object_map).load(object_map.save(tmp_path))
    assert [t.label for t in loaded.things] == ["cup", "bowl"] and len(loaded.things[0].explain()) == 2


def test_asking_early_changes_nothing(cards):
    views = [(0.02 * i, {0: CUP, 1: BOWL}) for i in range(6)]
    quiet, asked = cards.map(views), cards.map(views[:3])
    assert len(asked.object_map(True)) == 2
    for index, (x, scores) in enumerate(views[3:], start=3):
        asked.process_frame(cards.frame(index, x), cards.detect(x, scores))
    assert as_text(quiet) == as_text(asked) == as_text(cards.map(views))


def as_text(mapper) -> str:
    things = mapper.object_map(True).things
    return json.dumps(
        [[t.id, t.existence, dict(t.class_posterior), t.position.tolist(), t.size.tolist()] for t in things]
    )


def test_nothing_seen_is_an_empty_map(tools, cards):
    mapper = TrackMapper()
    assert len(mapper.object_map(True)) == 0 and mapper.point_labels() is None and mapper.track_labels() == {}
    assert mapper.statistics()["tracks"]["tracks"] == 0 and mapper.assess() is None
    with pytest.raises(IndexError, match="0 there are"):
        mapper.image_tracks(0)
    empty = cards.map([(0.0, {}), (0.1, {})])
    assert len(empty.object_map(True)) == 0 and empty.image_tracks(0)[1].shape == (0,)
    assert set(empty.point_labels().tolist()) == {-1}
    assert empty.statistics()["tracks"]["views"] == 2


def test_errors_are_those_of_every_mapper(tools, cards):
    mapper = TrackMapper(None, tools.config)
    with pytest.raises(UserError, match="no detections"):
        mapper.process_frame(cards.frame(0, 0.0))
    mapper.process_frame(cards.frame(0, 0.0), cards.detect(0.0, {0: CUP}))
    with pytest.raises(UserError, match="same 2 classes"):
        mapper.process_frame(cards.frame(1, 0.1), Detections.empty(("plate",)))
    frame = cards.frame(2, 0.1)
    with pytest.raises(BrokenFrame):
        mapper.process_frame(type(frame)(2, "other", 2.0, frame.color, frame.depth, frame.intrinsics))
    assert len(mapper.trajectory()[0]) == 1 and len(mapper.object_map()) == 1


def test_what_a_lost_camera_sees_is_of_no_track(cards, monkeypatch):
    mapper = cards.map([(0.0, {0: CUP})])
    step = type(mapper._camera._place).is_known
    monkeypatch.setattr(type(mapper._camera._place), "is_known", property(lambda _: False))
    mapper.process_frame(cards.frame(1, 0.1), cards.detect(0.1, {0: CUP}))
    monkeypatch.setattr(type(mapper._camera._place), "is_known", step)
    assert mapper.statistics()["outcomes"]["adrift"] == 1 and mapper.statistics()["tracks"]["views"] == 1
    assert mapper.image_tracks(1)[1].shape == (0,) and len(mapper.keyframes()[0]) == 2

"""Tracks judged by what was learned: evidence, fates, and where they are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.multiview.assessment import Assessment, Fate
from thingmap.mapper.multiview.drawn_boxes import draw_tracks, image_box
from thingmap.mapper.multiview.judging import judged, repeats
from thingmap.mapper.multiview.sight import Sight
from thingmap.mapper.multiview.track_evidence import TrackEvidence, feature_count, track_features
from thingmap.mapper.multiview.track_judge import TrackJudge
from thingmap.mapper.multiview.track_mapper import TrackMapper

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
ALL = (0.0, 100.0)
LEFT, RIGHT = ((-0.2, 0.0, 1.0), 0.06), ((0.2, 0.1, 1.2), 0.08)
CUP, BOWL, NOTHING = (0.7, 0.1), (0.2, 0.5), (0.05, 0.05)


def judge_of(*, class_rows: tuple[float, float, float] = (0.0, 0.0, 0.0), ratio: float = 1.0) -> TrackJudge:
    """Believes the mean log ratios of the views, and has offsets."""
    wide = feature_count(2)
    weights = np.zeros((3, wide))
    weights[0, 0] = weights[1, 1] = ratio
    return TrackJudge(("cup", "bowl"), np.zeros(wide), np.ones(wide), weights, np.array(class_rows), "by hand")


def cylinder(radius: float, height: float, middle: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    angle, z = np.meshgrid(np.linspace(0, 2 * np.pi, 40, endpoint=False), np.linspace(0, height, 25))
    return np.stack([radius * np.cos(angle) + middle[0], radius * np.sin(angle) + middle[1], z], axis=-1).reshape(-1, 3)


def evidence(*clouds: np.ndarray, share: float = 1.0) -> TrackEvidence:
    return TrackEvidence(np.log(np.tile([0.5, 0.3, 0.2], (len(clouds), 1))), clouds, share)


def test_features_of_a_cylinder_by_hand():
    (row,) = track_features([evidence(cylinder(0.04, 0.12), cylinder(0.04, 0.12), share=0.5)], 2, ALL)
    assert len(row) == feature_count(2)
    np.testing.assert_allclose(row[:2], np.log([0.5 / 0.2, 0.3 / 0.2]))
    np.testing.assert_allclose(row[2:5], np.log([0.5, 0.3, 0.2]))
    np.testing.assert_allclose(row[5:7], np.log([0.5, 0.3]))
    np.testing.assert_allclose(row[7:11], [0.5, 0.3, 0.5, 0.3])
    np.testing.assert_allclose(row[11:17], np.log(np.array([0.12, 0.08, 0.08] * 2) + 0.005), atol=1e-2)
    np.testing.assert_allclose(row[17:32], np.log(0.045), atol=1e-2)  # the same radius in all slices
    np.testing.assert_allclose(row[32:37], 0.2)
    np.testing.assert_allclose(row[37:], [0.5, np.log(0.5), np.log(2.0), np.log(0.005)], atol=1e-9)


def test_where_a_track_is_does_not_matter():
    here, there = evidence(cylinder(0.04, 0.1)), evidence(cylinder(0.04, 0.1, (3.0, -2.0)))
    np.testing.assert_allclose(*track_features([here, there], 2, ALL), atol=1e-6)


def test_a_cone_is_no_cylinder():
    cone = cylinder(0.05, 0.1)
    cone[:, :2] *= cone[:, 2:] / 0.1
    radii = track_features([evidence(cone)], 2, ALL)[0, 17:32].reshape(5, 3)
    assert np.all(np.diff(radii[:, 1]) > 0.1)


def test_of_tracks_in_one_place_the_surest_stays():
    whole, piece, beside = cylinder(0.05, 0.1), cylinder(0.02, 0.04), cylinder(0.05, 0.1, (0.2, 0.0))
    tracks = [evidence(cloud) for cloud in (piece, whole, beside)]
    assert repeats(tracks, np.array([0.3, 0.9, 0.1]), ALL).tolist() == [True, False, False]
    assert repeats(tracks, np.array([0.9, 0.3, 0.1]), ALL).tolist() == [False, True, False]
    assert repeats(tracks[:1] * 3, np.full(3, 0.5), ALL).tolist() == [False, True, True]
    assert repeats([], np.empty(0), ALL).shape == (0,)


def test_what_repeats_a_track_that_is_gone_stays():
    chain = [evidence(cylinder(0.05, 0.1, (0.04 * k, 0.0))) for k in range(3)]  # first and last share too little
    assert repeats(chain, np.array([0.9, 0.8, 0.7]), ALL).tolist() == [False, True, False]


def test_box_of_a_cloud_in_an_image():
    grid = np.stack(np.meshgrid(np.linspace(-0.1, 0.1, 60), np.linspace(-0.05, 0.05, 60)), -1).reshape(-1, 2)
    points = np.column_stack([grid, np.full(len(grid), 1.0)])
    expected = [80.0 - 13.0, 60.0 - 6.5, 80.0 + 13.0, 60.0 + 6.5]
    np.testing.assert_allclose(image_box(points, np.eye(4), CAMERA), expected, atol=1.0)
    assert np.isnan(image_box(points - [0.0, 0.0, 2.0], np.eye(4), CAMERA)).all()


@pytest.fixture
def cards(tools):
    return tools.Cards(LEFT, RIGHT)


def mapped(tools, cards, views, judge):
    mapper = TrackMapper(None, tools.config, source="cards", judge=judge)
    for index, (x, scores) in enumerate(views):
        mapper.process_frame(cards.frame(index, x), cards.detect(x, scores))
    return mapper


def test_the_judge_decides_and_nothing_is_dropped(tools, cards):
    views = [(0.0, {0: CUP, 1: BOWL}), (0.05, {0: NOTHING}), (0.1, {0: NOTHING})]  # the bowl once of three times
    by_rule = mapped(tools, cards, views, None)
    assert by_rule.statistics()["tracks"]["dropped"] == 1
    mapper = mapped(tools, cards, views, judge_of())
    found = mapper.assess()
    assert found is not None and found.count(Fate.DROPPED) == 0 and mapper.track_labels()[1][0] == 1
    mean = np.mean([np.log(0.7 / 0.2), np.log(0.05 / 0.9), np.log(0.05 / 0.9)])
    odds = np.exp([mean, np.mean([np.log(0.1 / 0.2), np.log(0.05 / 0.9), np.log(0.05 / 0.9)]), 0.0])
    np.testing.assert_allclose(found.posterior[0], odds / odds.sum(), rtol=1e-3)
    assert found.fates[0] is Fate.BACKGROUND
    things = {thing.label: thing for thing in mapper.object_map().things}
    assert set(things) == {"bowl"} and things["bowl"].existence == pytest.approx(1.0 - found.posterior[1, 2])


def test_tracks_are_drawn_where_a_view_missed_them(tools, cards):
    views = [(0.0, {0: CUP, 1: BOWL}), (0.05, {0: CUP})]
    mapper = mapped(tools, cards, views, judge_of())
    drawn = mapper.drawn_tracks(1)
    assert drawn.track.tolist() == [0, 1] and drawn.class_id.tolist() == [0, 1]
    seen = cards.detect(0.05, {0: CUP, 1: BOWL}).xyxy
    np.testing.assert_allclose(drawn.xyxy, seen, atol=2.0)
    with pytest.raises(IndexError, match="2 there are"):
        mapper.drawn_tracks(2)


def test_background_is_drawn_with_a_low_score(tools, cards):
    mapper = mapped(tools, cards, [(0.0, {0: CUP, 1: BOWL})], judge_of(class_rows=(0.0, 0.0, 9.0)))
    assert len(mapper.object_map()) == 0
    assert mapper.drawn_tracks(0).track.tolist() == [0, 1] and mapper.drawn_tracks(0).score.max() < 0.01


def test_what_repeats_a_surer_track_is_neither_kept_nor_drawn():
    cloud = cylinder(0.05, 0.1) + np.array([0.0, 0.0, 1.0])
    sure, less = (TrackEvidence(np.log([[p, 0.1, 0.9 - p]]), (cloud,), 1.0) for p in (0.8, 0.6))
    shape = (2, 1)
    before = Assessment(
        np.full((2, 3), 1 / 3), np.full((2, 3), 1 / 3), np.zeros((2, 3)), np.ones(shape, bool),
        np.full(shape, Sight.VISIBLE), (Fate.DROPPED, Fate.DROPPED),
    )  # fmt: skip
    found = judged(before, (less, sure), judge_of(), ALL)
    assert found.fates == (Fate.REPEATED, Fate.KEPT) and found.labels.tolist() == [-1, 0]
    drawn = draw_tracks(found, (less, sure), 0, np.eye(4), CAMERA)
    assert drawn.track.tolist() == [1] and drawn.score == pytest.approx(0.8)


def test_where_nothing_is_seen_nothing_is_judged(tools, cards):
    mapper = mapped(tools, cards, [(0.0, {}), (0.1, {})], judge_of())
    assert len(mapper.object_map(True)) == 0 and mapper.track_features().shape == (0, feature_count(2))
    assert mapper.drawn_tracks(1).xyxy.shape == (0, 4)


def test_features_are_those_of_the_tracks(tools, cards):
    mapper = mapped(tools, cards, [(0.0, {0: CUP, 1: BOWL})], None)
    assert mapper.track_features().shape == (2, feature_count(2))
    np.testing.assert_allclose(mapper.track_features()[:, 2:5], np.log([[0.7, 0.1, 0.2], [0.2, 0.5, 0.3]]), rtol=1e-3)


def test_a_judge_of_other_classes_is_refused_at_the_first_frame(tools, cards):
    other = TrackJudge(("a", "b"), np.zeros(feature_count(2)), np.ones(feature_count(2)),
                       np.zeros((3, feature_count(2))), np.zeros(3), "")  # fmt: skip
    mapper = TrackMapper(None, tools.config, source="cards", judge=other)
    with pytest.raises(UserError, match="the detector has cup, bowl"):
        mapper.process_frame(cards.frame(0, 0.0), cards.detect(0.0, {0: CUP}))

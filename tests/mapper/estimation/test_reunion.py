"""Candidates and retired landmarks that turn out to be a thing that is known already."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.config import LifecycleConfig
from thingmap.mapper.estimation.association import Assignment
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.evidence import score_evidence
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.lifting import lift
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.records import Box, DepthCentre, Scores
from thingmap.mapper.estimation.reunion import contradict, distance, take_over
from thingmap.mapper.estimation.smoother import Smoother

CUP = (0.9, 0.02, 0.02)
CONFIG = LifecycleConfig()


def cup(tools, x: float = 0.0, **kwargs):
    return tools.Thing((x, 0.0, 0.0), **{"scores": CUP, **kwargs})


def show_as_new(stage, x: float, thing) -> None:
    """A keyframe whose detections all start candidates, as if the camera were somewhere else."""
    view = stage.view(x, thing)
    lifted, _ = lift(stage.detect(view, [thing]), view.frame, stage.config.lifting)
    none = np.full(len(lifted), -1)
    stage.lifecycle.start_tracks(view, lifted, score_evidence(lifted, stage.model), Assignment(none, none))
    stage.smoother.update()


def reunite(stage) -> bool:
    stage.lifecycle.bring_up_to_date()
    united = stage.lifecycle.reunite()
    stage.lifecycle.bring_up_to_date()
    return united


@pytest.fixture
def stage(tools):
    """A cup that is a landmark, seen from four places."""
    stage = tools.Stage()
    for x in (-0.6, -0.4, -0.2, 0.0):
        stage.show(x, cup(tools))
    assert list(stage.scene.landmarks) == [1]
    return stage


def test_a_candidate_at_a_landmark_s_place_joins_it(stage, tools):
    show_as_new(stage, 0.2, cup(tools))
    (landmark,), (track,) = stage.scene.landmarks.values(), stage.scene.tracks
    hits, measurements = landmark.belief.hits, landmark.measurements
    records = len(stage.smoother.ledger)
    assert reunite(stage) and not reunite(stage)
    assert stage.scene.tracks == [] and list(stage.scene.landmarks.values()) == [landmark]
    assert landmark.supporting == {0, 1, 2, 3, 4} and landmark.measurements == measurements + 1
    assert landmark.belief.hits > hits and landmark.last_seen == track.last_seen
    added = list(stage.smoother.ledger)[records:]
    for kind in (DepthCentre, Box, Scores):
        assert [(r.keyframe, r.landmark) for r in added if isinstance(r, kind)] == [(4, 1)]
    assert stage.outcomes[Outcome.MERGED] == 1
    np.testing.assert_allclose(landmark.position, 0.0, atol=0.06)


def test_the_saved_ledger_knows_of_it(stage, tools):
    show_as_new(stage, 0.2, cup(tools))
    reunite(stage)
    again = Smoother.from_ledger(stage.smoother.ledger, stage.config.smoother, stage.smoother.intrinsics)
    np.testing.assert_allclose(again.position(1), stage.smoother.position(1), atol=1e-3)


@pytest.mark.parametrize("other", [{"x": 0.5}, {"half_axes": (0.4, 0.4, 0.4)}], ids=["elsewhere", "larger"])
def test_what_differs_stays_by_itself(stage, tools, other):
    show_as_new(stage, 0.2, cup(tools, **other))
    assert not reunite(stage)
    assert len(stage.scene.tracks) == 1 and stage.scene.landmarks[1].supporting == {0, 1, 2, 3}


@pytest.mark.parametrize(("posterior", "joins"), [((0.0, 0.01, 0.98, 0.01), False), ((0.1, 0.1, 0.5, 0.3), True)])
def test_what_is_surely_of_another_class_stays_by_itself(stage, tools, posterior, joins):
    assert stage.scene.landmarks[1].belief.class_posterior()[0] > 0.95
    show_as_new(stage, 0.2, cup(tools))
    stage.scene.tracks[0].belief.posterior = np.array(posterior)
    assert reunite(stage) is joins


def test_two_that_were_seen_in_one_image_stay_two(stage, tools):
    show_as_new(stage, 0.2, cup(tools))
    stage.scene.landmarks[1].supporting.add(4)
    assert not reunite(stage) and len(stage.scene.tracks) == 1


def test_candidates_of_one_thing_become_the_oldest(tools):
    stage = tools.Stage()
    for x in (-0.2, 0.0, 0.2):
        show_as_new(stage, x, cup(tools))
    first = stage.scene.tracks[0]
    assert reunite(stage)
    assert stage.scene.tracks == [first] and first.hits == {0, 1, 2}
    assert stage.outcomes[Outcome.MERGED] == 2


# -- what was retired


def retire_the_first_and_map_it_again(stage, tools, missed_in: set[int]) -> Landmark:
    stage.lifecycle.bring_up_to_date()
    stage.smoother.retire(1)
    first = stage.scene.retired[1] = stage.scene.landmarks.pop(1)
    for x in (0.2, 0.4, 0.3):
        stage.show(x, cup(tools))
    first.contradicting |= missed_in
    assert list(stage.scene.landmarks) == [2]
    return stage.scene.landmarks[2]


def test_what_was_retired_by_the_keyframes_that_showed_it_counts_again(stage, tools):
    measurements = retire_the_first_and_map_it_again(stage, tools, {4, 5}).measurements
    older = stage.scene.retired[1]
    assert reunite(stage)
    assert list(stage.scene.landmarks.values()) == [older] and not stage.scene.retired
    assert older.supporting == {0, 1, 2, 3, 4, 5, 6} and older.first_seen == 0.0
    assert older.measurements == measurements + 4
    records = [stage.smoother.ledger[number] for number in stage.smoother.measurements(1)]
    assert {record.keyframe for record in records} == {0, 1, 2, 3, 4, 5, 6}
    again = Smoother.from_ledger(stage.smoother.ledger, stage.config.smoother, stage.smoother.intrinsics)
    np.testing.assert_allclose(again.position(1), stage.smoother.position(1), atol=1e-3)


def test_what_was_put_there_afterwards_is_something_else(stage, tools):
    """The first was gone in views that showed nothing."""
    landmark = retire_the_first_and_map_it_again(stage, tools, set())
    assert not reunite(stage)
    assert list(stage.scene.retired) == [1] and landmark.supporting == {4, 5, 6}


def test_what_was_retired_beside_a_thing_is_not_part_of_it(stage, tools):
    landmark = retire_the_first_and_map_it_again(stage, tools, {4, 5})
    landmark.supporting.add(2)
    assert not reunite(stage) and list(stage.scene.retired) == [1]


# -- how far things disagree


def landmark_at(position, half_axes, sigma: float = 0.02) -> Landmark:
    belief = Belief(2, generic_evidence_model())
    sizes = np.log(half_axes), 0.01 * np.eye(3)
    return Landmark(1, belief, np.array(position), sizes[0], 0.0, 0.0, sigma**2 * np.eye(3), sizes[1])


def test_distance_by_hand():
    """0.1 m apart, sigmas 0.03 m and half of 0.04 m; twice as large on one axis."""
    a, b = landmark_at((0.0, 0.0, 0.0), (0.04,) * 3), landmark_at((0.1, 0.0, 0.0), (0.08, 0.04, 0.04))
    place = 0.1**2 / (0.03**2 + (CONFIG.merge_extent * 0.04) ** 2)
    size = np.log(2.0) ** 2 / (0.02 + CONFIG.merge_log_size**2)
    assert distance(a, b, 0.03**2 * np.eye(3), CONFIG) == pytest.approx(place + size)


def test_classes_contradict_only_where_both_are_sure():
    def belief(*posterior: float) -> Belief:
        made = Belief(len(posterior), generic_evidence_model())
        made.posterior = np.array([0.5, *np.array(posterior) / 2.0])
        return made

    unknown, cup, bowl, hardly = belief(0.5, 0.5), belief(0.99, 0.01), belief(0.01, 0.99), belief(0.3, 0.7)
    assert contradict(cup, bowl) and contradict(bowl, cup)
    assert not any(contradict(cup, other) for other in (unknown, cup, hardly))


def test_what_one_missed_where_the_other_was_seen_is_taken_back():
    kept, other = landmark_at((0.0,) * 3, (0.1,) * 3), landmark_at((0.0,) * 3, (0.1,) * 3)
    directions = np.eye(3)
    kept.belief.look(directions[0], hits=1.0, keyframe=0)
    kept.belief.look(directions[1], misses=1.0, free=-5.0, seen=1.0, keyframe=1)  # the pose was wrong
    kept.belief.look(directions[2], misses=1.0, keyframe=2)
    other.belief.look(directions[1], hits=1.0, keyframe=1)
    kept.supporting, kept.contradicting, other.supporting = {0}, {1, 2}, {1}
    take_over(kept, other)
    assert kept.belief.hits == 2.0 and kept.belief.misses == 1.0 and kept.belief.free == 0.0
    assert kept.supporting == {0, 1} and kept.contradicting == {2}

"""What a keyframe says about landmarks and candidates."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.mapper.estimation.association import Assignment
from thingmap.mapper.estimation.evidence import FIRST_MEASUREMENTS, score_evidence
from thingmap.mapper.estimation.lifting import lift
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.records import Box, DepthCentre, Look, Scores

CUP, BOWL = (0.6, 0.1, 0.02), (0.1, 0.6, 0.02)


@pytest.fixture
def cup(tools):
    return tools.Thing((0.0, 0.0, 0.0), scores=CUP)


@pytest.fixture
def unseen(tools):
    """The cup where the detector misses it."""
    return tools.Thing((0.0, 0.0, 0.0))


@pytest.fixture
def stage(tools, cup):
    """A cup that became landmark 1 in three keyframes."""
    stage = tools.Stage()
    for x in (-0.8, -0.6, -0.4):
        stage.show(x, cup)
    assert list(stage.scene.landmarks) == [1]
    return stage


@pytest.fixture
def landmark(stage):
    return stage.scene.landmarks[1]


def records(stage, kind) -> list:
    return [record for record in stage.smoother.ledger if isinstance(record, kind)]


def test_scores_alone_are_read_as_if_nothing_hid_the_object(stage, cup):
    view = stage.view(0.0, cup)
    lifted, _ = lift(stage.detect(view, [cup]), view.frame, stage.config.lifting)
    (evidence,) = score_evidence(lifted, stage.model)
    np.testing.assert_array_equal(evidence.own, stage.model.scores.evidence(np.array(CUP), 0.0).own)
    assert score_evidence([], stage.model) == []


def test_a_hit_supports_and_measures(stage, landmark, cup):
    hits, measurements, counted = landmark.belief.hits, landmark.measurements, len(landmark.supporting)
    view = stage.show(0.0, cup)
    assert landmark.belief.hits == pytest.approx(hits + 1.0)  # a new direction counts fully
    assert landmark.belief.misses == 0.0
    assert landmark.measurements == measurements + 1
    assert len(landmark.supporting) == counted + 1 and view.keyframe in landmark.supporting
    assert landmark.last_seen == view.frame.stamp
    assert stage.outcomes[Outcome.SUPPORTED] == stage.outcomes[Outcome.ASSOCIATED] == 1


def test_what_was_said_is_in_the_ledger(stage, landmark, cup):
    before = landmark.belief.evidence
    view = stage.show(0.0, cup)
    look, scores = records(stage, Look)[-1], records(stage, Scores)[-1]
    centre, box = records(stage, DepthCentre)[-1], records(stage, Box)[-1]
    assert {r.keyframe for r in (look, scores, centre, box)} == {view.keyframe}
    assert {r.landmark for r in (look, scores, centre, box)} == {1}
    assert (look.hits, look.misses) == (pytest.approx(1.0), 0.0) and scores.weight == pytest.approx(1.0)
    np.testing.assert_allclose(scores.scores, CUP, rtol=1e-6)
    np.testing.assert_allclose(stage.smoother.position(1) @ [1, 0, 0], 0.0, atol=0.02)
    lifted, _ = lift(stage.detect(view, [cup]), view.frame, stage.config.lifting)
    np.testing.assert_allclose(box.xyxy, lifted[0].xyxy)
    np.testing.assert_allclose(centre.centre, lifted[0].centre)
    after = landmark.belief.evidence  # the direction is new, so all of the look is
    said = [getattr(after, name)[0] - getattr(before, name)[0] for name in ("hits", "misses", "free", "depth")]
    np.testing.assert_allclose([look.hits, look.misses, look.free, look.depth], said, atol=1e-6)
    np.testing.assert_allclose(look.visible, 1.0, atol=0.05)


def test_the_same_view_again_says_little_and_is_not_measured(stage, landmark, cup):
    for x in (0.0, 0.2):
        stage.show(x, cup)
    assert landmark.measurements >= FIRST_MEASUREMENTS
    hits, measurements, boxes = landmark.belief.hits, landmark.measurements, len(records(stage, Box))
    for _ in range(4):
        stage.show(0.2, cup)
    assert landmark.belief.hits < hits + 0.5
    assert (landmark.measurements, len(records(stage, Box))) == (measurements, boxes)
    assert len(landmark.supporting) == 3 + 2 + 4


def test_a_miss_contradicts(stage, landmark, unseen):
    before = landmark.belief.existence
    view = stage.show(0.0, unseen)
    assert landmark.belief.misses > 0.8 and landmark.contradicting == {view.keyframe}
    assert landmark.belief.existence < before
    assert stage.outcomes[Outcome.MISSED] == 1


def test_what_is_gone_is_seen_through_and_retires(stage, landmark):
    for x in (-0.2, 0.0, 0.2, 0.4, 0.6, 0.8):
        stage.show(x)
    assert stage.outcomes[Outcome.SEEN_THROUGH] >= 4 and stage.outcomes[Outcome.MISSED] == 0
    assert landmark.belief.existence < 0.02
    assert list(stage.scene.landmarks) == [] and list(stage.scene.retired) == [1]


def test_a_fully_hidden_object_hears_nothing(stage, landmark, unseen, tools):
    before, looks = landmark.belief.posterior.copy(), len(records(stage, Look))
    free, misses = landmark.belief.free, landmark.belief.misses
    wall = tools.Thing((0.0, -0.8, 0.0), (0.5, 0.05, 0.5))
    view = stage.show(0.0, unseen, wall)
    assert (landmark.belief.free, landmark.belief.misses) == (free, misses)
    np.testing.assert_allclose(landmark.belief.posterior, before, atol=0.02)  # the size may still settle
    assert landmark.occluded == {view.keyframe} and not landmark.contradicting
    assert len(records(stage, Look)) == looks
    assert stage.outcomes[Outcome.FULLY_OCCLUDED] == 1


def test_an_object_out_of_view_hears_nothing(stage, landmark):
    free, misses = landmark.belief.free, landmark.belief.misses
    stage.show(3.0)
    assert (landmark.belief.free, landmark.belief.misses) == (free, misses)
    assert not landmark.occluded and not landmark.contradicting
    assert stage.outcomes[Outcome.OUT_OF_VIEW] == 1


def test_the_more_is_hidden_the_less_a_miss_and_a_surface_say(tools, cup, unseen):
    misses, surface = {}, {}
    for hidden in (0.0, 0.3, 0.45, 0.8):
        stage = tools.Stage()
        for x in (-0.8, -0.6, -0.4):
            stage.show(x, cup)
        before = stage.scene.landmarks[1].belief.free
        edge = -0.05 + 0.1 * hidden  # of a wall half way to the cup, which is 0.1 m wide there
        view = stage.show(0.0, unseen, tools.Thing((edge - 2.0, -1.0, 0.0), (2.0, 0.01, 2.0)))
        visible = stage.scene.predict(view, stage.config.association)[0].visible[0]
        assert visible == pytest.approx(1.0 - hidden, abs=0.15)
        misses[hidden] = stage.scene.landmarks[1].belief.misses
        surface[hidden] = stage.scene.landmarks[1].belief.free - before
    assert misses[0.0] == pytest.approx(1.0, abs=0.02)
    assert misses[0.0] > misses[0.3] > misses[0.45] > misses[0.8] == 0.0
    assert surface[0.0] > surface[0.3] + 0.1 > surface[0.45] + 0.2 > 0.2  # so does a surface where it should be


def test_pixels_without_depth_say_nothing(stage, landmark, unseen):
    belief = landmark.belief
    before = (belief.hits, belief.misses, belief.free)
    view = stage.view(0.0, unseen)
    view.frame.depth[:] = 0.0
    targets, visibility = stage.scene.predict(view, stage.config.association)
    nothing = Assignment(np.empty(0, dtype=int), np.empty(0, dtype=int))
    stage.observer.observe(view, [], nothing, targets, visibility)
    assert (belief.hits, belief.misses, belief.free) == before


def test_a_second_box_is_a_hit_too_but_no_measurement(stage, landmark, cup, tools):
    measurements = landmark.measurements
    stage.show(0.0, cup, tools.Thing((0.0, 0.0, 0.0), (0.085, 0.1, 0.09), CUP))
    assert landmark.measurements == measurements + 1
    assert stage.outcomes[Outcome.DUPLICATE] == 1 and stage.outcomes[Outcome.SUPPORTED] == 1
    assert not stage.scene.tracks


def test_candidates_hear_the_same(stage, tools):
    bowl = tools.Thing((0.5, 0.0, 0.0), scores=BOWL)
    stage.show(0.0, bowl)
    (track,) = stage.scene.tracks
    first = track.position
    stage.show(0.2, bowl)
    assert track.hits == {3, 4} and not track.misses and len(track.observations) == 2
    assert np.linalg.norm(track.position - first) < 0.1
    stage.show(0.4, tools.Thing((0.5, 0.0, 0.0)))
    assert track.misses == {5} and track.misses_in_a_row == 1
    stage.show(0.4, tools.Thing((0.5, 0.0, 0.0)), tools.Thing((0.5, -0.8, 0.0), (0.5, 0.05, 0.5)))
    assert track.misses == {5}  # hidden: no miss
    assert stage.outcomes[Outcome.TRACKED] == 1 + 2  # and the cup's second box, before it was promoted


def test_a_view_in_which_it_was_hidden_does_not_use_up_the_direction(tools, cup, unseen):
    """Behind a box that leaves a few percent of it in view at most, then without the box from the same three places."""
    stages = {}
    for hidden in (False, True):
        stage = tools.Stage()
        for x in (-0.8, -0.6, -0.4):
            stage.show(x, cup)
        for x in (0.2, 0.4, 0.6):
            if hidden:
                view = stage.show(x, unseen, tools.Thing((0.5 * x, -1.0, 0.0), (0.055, 0.03, 0.055)))
                visible = stage.scene.predict(view, stage.config.association)[0].visible[0]
                assert visible < 0.1
        for x in (0.2, 0.4, 0.6):
            stage.show(x, cup)
        stages[hidden] = stage
    plain, after = (stages[h].scene.landmarks[1] for h in (False, True))
    assert after.belief.hits > 0.9 * plain.belief.hits
    assert after.measurements == plain.measurements

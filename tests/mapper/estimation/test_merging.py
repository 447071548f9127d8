"""Marriage of landmarks: which of them are one thing."""

from __future__ import annotations

import numpy as np
from lives import CUP, follow, twins
from stages import Stage, Thing

from thingmap.mapper.estimation.landmarks import volume_overlaps
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.records import Merge


def test_two_landmarks_at_one_place_become_one():
    stage = twins(0.02)
    a, b = stage.scene.landmarks[1], stage.scene.landmarks[2]
    places = a.position[0], b.position[0]
    hits, measurements, seen = (
        (a.belief.hits, b.belief.hits),
        a.measurements + b.measurements,
        a.supporting | b.supporting,
    )
    stage.lifecycle.merge()
    assert list(stage.scene.landmarks) == [1] and stage.smoother.owner(2) == 1
    assert (a.measurements, a.supporting) == (measurements, seen)
    assert max(hits) < a.belief.hits < sum(hits)  # both were seen from about the same places
    stage.smoother.update()
    stage.lifecycle.refresh(set())
    assert places[0] + 0.005 < stage.smoother.position(1)[0] < places[1] - 0.005
    assert stage.outcomes[Outcome.MERGED] == 1
    assert any(isinstance(r, Merge) and (r.kept, r.absorbed) == (1, 2) for r in stage.smoother.ledger)


def test_neighbours_stay_two():
    stage = twins(0.25)
    stage.lifecycle.merge()
    assert sorted(stage.scene.landmarks) == [1, 2]


def test_a_thing_in_the_middle_of_a_larger_one_stays_itself():
    stage = Stage()
    stage.lifecycle.merge = lambda: None  # type: ignore[method-assign]
    for half_axes in ((0.4, 0.3, 0.3), (0.05, 0.05, 0.05)):
        before = dict(stage.scene.landmarks)
        stage.scene.landmarks.clear()
        follow(stage, Thing((0.0, 0.0, 0.0), half_axes, CUP), places=(-0.4, -0.2, 0.0))
        stage.scene.landmarks.update(before)
    del stage.lifecycle.merge
    stage.lifecycle.merge()
    assert sorted(stage.scene.landmarks) == [1, 2]


def test_merging_asks_the_joint_covariance():
    """Two tall things, one a hand above the other, seen from a pose unknown to half a metre. Each position is as
    unsure as the pose, so a test without the cross term takes them for one; seen together, they are surely two."""
    stage = Stage()
    stage.lifecycle.merge = lambda: None  # type: ignore[method-assign]
    stage.show(0.0)  # holds the world
    loose, add_keyframe = np.diag(np.repeat([1e-4, 0.5**2], 3)), stage.smoother.add_keyframe
    stage.smoother.add_keyframe = lambda T, _: add_keyframe(T, loose)  # type: ignore[method-assign]
    pair = [Thing((0.0, 0.0, z), (0.05, 0.05, 0.3), CUP) for z in (-0.2, 0.2)]
    stage.show(-0.4, *pair)
    stage.smoother.add_keyframe = add_keyframe  # type: ignore[method-assign]
    follow(stage, *pair, places=np.linspace(-0.3, 0.4, 8))
    a, b = stage.scene.landmarks.values()
    smoother, config, apart = stage.smoother, stage.config.lifecycle, a.position - b.position
    assert volume_overlaps([a, b], np.eye(3))[0, 1] > config.merge_overlap
    joint = smoother.difference_covariance(1, 2)
    alone = smoother.position_covariance(1) + smoother.position_covariance(2)
    assert apart @ np.linalg.solve(alone, apart) < 1.0 and apart @ np.linalg.solve(joint, apart) > 100.0
    del stage.lifecycle.merge
    stage.lifecycle.merge()
    assert sorted(stage.scene.landmarks) == [1, 2]


def test_what_was_measured_twice_is_not_merged_before_more_views_had_their_chance():
    stage = twins(0.02)
    stage.scene.landmarks[2].measurements = 2
    stage.lifecycle.merge()
    assert sorted(stage.scene.landmarks) == [1, 2]
    for x in np.linspace(3.0, 4.0, 20):  # looks away; nothing is to be waited for any more
        stage.view(x)
    stage.smoother.update()
    stage.lifecycle.merge()
    assert sorted(stage.scene.landmarks) == [1]


def test_where_all_views_were_seen_few_measurements_are_merged_too():
    stage = twins(0.02)
    stage.scene.landmarks[2].measurements = 2
    stage.lifecycle.merge(all_seen=True)
    assert sorted(stage.scene.landmarks) == [1]

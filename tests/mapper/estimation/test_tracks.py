"""Candidates: position by a Kalman filter, size by medians, ripe or lost by counting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.config import TrackConfig
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.lifting import LiftedDetection
from thingmap.mapper.estimation.tracks import MIN_SHARE, Observation, Track

CONFIG = TrackConfig()


def make(position=(0.0, 0.0, 1.0), sigma: float = 0.1) -> Track:
    belief = Belief(2, generic_evidence_model())
    return Track(1, np.array(position), sigma**2 * np.eye(3), belief)


def observation(keyframe: int, half_extents) -> Observation:
    detection = LiftedDetection(
        np.zeros(2), np.zeros(4), np.ones(4, bool), 1.0, np.array([0.0, 0.0, 1.0]), 0.1, 0.1, np.array(half_extents)
    )
    return Observation(keyframe, np.eye(4), (detection,), np.ones(5), 1.0)


def test_measurements_average_by_their_information():
    """1.0 m with 0.1 m, then 1.3 m with 0.2 m: the second weighs a quarter as much."""
    track = make()
    track.correct(np.array([0.0, 0.0, 1.3]), 0.2**2 * np.eye(3))
    np.testing.assert_allclose(track.position, [0.0, 0.0, (4 * 1.0 + 1.3) / 5], atol=1e-12)
    np.testing.assert_allclose(track.covariance, np.eye(3) / (1 / 0.1**2 + 1 / 0.2**2), atol=1e-12)


def test_a_wide_axis_of_the_measurement_moves_nothing():
    track = make()
    track.correct(np.array([0.4, 0.0, 1.4]), np.diag([1e6, 1e-2, 1e-2]))
    np.testing.assert_allclose(track.position, [0.0, 0.0, 1.2], atol=1e-4)


def test_time_widens_the_position_and_does_not_move_it():
    track = make()
    for _ in range(9):
        track.predict(CONFIG)
    np.testing.assert_allclose(track.position, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(track.covariance, (0.1**2 + 9 * CONFIG.process_sigma**2) * np.eye(3), atol=1e-12)


def test_what_is_read_cannot_change_the_filter():
    track = make()
    track.position[:] = 9.0
    track.covariance[:] = 9.0
    np.testing.assert_allclose(track.position, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(track.covariance, 0.01 * np.eye(3))


def test_the_start_is_copied():
    start, covariance = np.zeros(3), np.eye(3)
    track = Track(1, start, covariance, make().belief)
    track.correct(np.ones(3), np.eye(3))
    np.testing.assert_array_equal(start, 0.0)
    np.testing.assert_array_equal(covariance, np.eye(3))


def test_the_size_is_the_median_of_the_boxes():
    track = make()
    for t, (width, height) in enumerate([(0.10, 0.20), (0.12, 0.18), (0.60, 0.90)]):
        track.observations.append(observation(t, (width, 0.05, height)))
    np.testing.assert_allclose(np.exp(track.log_size), [0.12, 0.12, 0.20])


@pytest.mark.parametrize(
    ("hits", "misses", "ripe"), [(2, 0, False), (3, 0, True), (3, 7, True), (3, 8, False), (6, 14, True)]
)
def test_ripe_by_hits_and_their_rate(hits, misses, ripe):
    track = make()
    track.belief.posterior = np.array([0.9, 0.05, 0.05])
    track.hits, track.misses = set(range(hits)), set(range(100, 100 + misses))
    assert track.is_ripe(CONFIG) is ripe


def test_lost_after_misses_in_a_row():
    track = make()
    track.misses_in_a_row = CONFIG.max_misses - 1
    assert not track.is_lost(CONFIG)
    track.misses_in_a_row += 1
    assert track.is_lost(CONFIG)


def test_ripe_as_soon_as_it_is_likely_enough():
    track = make()
    for likely, ripe in ((CONFIG.min_existence - 0.01, False), (CONFIG.min_existence + 0.01, True)):
        track.belief.posterior = np.array([1.0 - likely, likely, 0.0])
        assert track.is_ripe(CONFIG) is ripe


def test_templates_that_fire_together_share_one_measurement():
    """Whole, top and left of something of which 0.6, 0.9 and 0.3 show: 0.6, 0.9 and 0.3 of 1.8, of what shows."""
    detections = tuple(replace(observation(0, (0.1,) * 3).detections[0], part=part) for part in (0, 1, 3))
    seen = Observation(0, np.eye(4), detections, np.array([0.6, 0.9, 0.2, 0.3, 0.0]), 1.0)
    np.testing.assert_allclose(seen.shares, np.array([0.36, 0.81, 0.09]) / 1.8)
    alone = Observation(0, np.eye(4), detections[:1], np.array([0.5, 0.0, 0.0, 0.0, 0.0]), 1.0)
    np.testing.assert_allclose(alone.shares, [0.5])
    hardly = Observation(0, np.eye(4), detections[:1], np.zeros(5), 1.0)
    np.testing.assert_allclose(hardly.shares, [MIN_SHARE])


def pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    return T


POSES = np.array([pose(seed) for seed in range(9)])


def seen_from(keyframe: int, poses: np.ndarray = POSES) -> Observation:
    """Something near the origin, measured with noise that is larger along the ray."""
    noise, T = 0.05 * np.random.default_rng(keyframe).normal(size=3), poses[keyframe]
    centre = T[:3, :3].T @ (noise - T[:3, 3])
    detection = replace(observation(0, (0.1,) * 3).detections[0], centre=centre, sigma_range=0.3)
    return Observation(keyframe, T, (detection,), np.ones(5), 1.0)


def live(keyframes: tuple[int, ...], now: int = 8, poses: np.ndarray = POSES) -> Track:
    """A candidate that was seen by these keyframes, as the mapper does it: each ends with a prediction."""
    observations = {keyframe: seen_from(keyframe, poses) for keyframe in keyframes}
    track = Track(1, *observations[keyframes[0]].place, Belief(2, generic_evidence_model()))
    track.observations.append(observations[keyframes[0]])
    track.hits = set(keyframes)
    track.predict(CONFIG)
    for keyframe in range(keyframes[0] + 1, now + 1):
        if keyframe in observations:
            track.see(observations[keyframe], *observations[keyframe].place)
        track.predict(CONFIG)
    return track


def assert_same(a: Track, b: Track) -> None:
    np.testing.assert_allclose(a.position, b.position, atol=1e-9)
    np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-9)
    assert [x.keyframe for x in a.observations] == [x.keyframe for x in b.observations]


def test_following_poses_that_did_not_move_changes_nothing():
    track = live((1, 3, 4, 7))
    track.follow(POSES, CONFIG)
    assert_same(track, live((1, 3, 4, 7)))


def test_a_candidate_moves_and_turns_with_the_poses_it_was_seen_from():
    """The poses that saw it move together, those that did not see it elsewhere."""
    track, before, T = live((2, 3, 5)), live((2, 3, 5)), pose(100)
    moved = POSES.copy()
    moved[2:6] = T @ moved[2:6]
    moved[7] = pose(101)
    track.follow(moved, CONFIG)
    np.testing.assert_allclose(track.position, T[:3, :3] @ before.position + T[:3, 3])
    np.testing.assert_allclose(track.covariance, T[:3, :3] @ before.covariance @ T[:3, :3].T, atol=1e-12)
    np.testing.assert_allclose([x.T_world_camera for x in track.observations], moved[[2, 3, 5]])


def test_each_observation_moves_with_its_own_keyframe():
    """Half of it was seen from a pose that was 30 cm off."""
    wrong = POSES.copy()
    wrong[5:, 0, 3] += 0.3
    track = live((1, 2))
    track.see(replace(seen_from(6), T_world_camera=wrong[6]), *replace(seen_from(6), T_world_camera=wrong[6]).place)
    assert np.linalg.norm(track.position) > 0.07
    track.follow(POSES, CONFIG)
    assert_same(track, live((1, 2, 6)))


def test_a_candidate_that_absorbs_another_is_as_if_it_had_been_one():
    track, other = live((3, 6)), live((1, 4, 6, 7))
    track.misses, other.misses, track.misses_in_a_row, other.misses_in_a_row = {1, 5}, {2, 3}, 2, 0
    track.first_seen, other.first_seen, track.last_seen, other.last_seen = 0.3, 0.1, 0.6, 0.7
    track.absorb(other, POSES, CONFIG)
    assert_same(track, live((1, 3, 4, 6, 7)))
    assert track.hits == {1, 3, 4, 6, 7} and track.misses == {2, 5} and track.misses_in_a_row == 0
    assert (track.first_seen, track.last_seen) == (0.1, 0.7)

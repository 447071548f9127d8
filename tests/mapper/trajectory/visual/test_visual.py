"""Motion from image features with depth: the rigid fit, RANSAC, its covariance, and rendered frames."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import VisualConfig
from thingmap.mapper.trajectory.rigid import rigid_motion
from thingmap.mapper.trajectory.visual.feature_motion import RelativePose, relative_pose
from thingmap.mapper.trajectory.visual.features import FeatureExtractor, Features
from thingmap.mapper.trajectory.visual.visual_odometry import VisualEdge, VisualOdometry

NO_FLOOR = VisualConfig(covariance_floor=(0.0, 0.0))


def motion(rng: np.random.Generator, turn: float = 0.2, move: float = 0.2) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(turn * rng.normal(size=3)).as_matrix()
    T[:3, 3] = move * rng.normal(size=3)
    return T


def moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ T[:3, :3].T + T[:3, 3]


def scene(rng: np.random.Generator, count: int) -> np.ndarray:
    """(N, 3) points before a camera, metres."""
    z = rng.uniform(0.7, 3.0, count)
    return np.c_[rng.uniform(-0.5, 0.5, (count, 2)) * z[:, None], z]


def motion_between(
    old: np.ndarray, new: np.ndarray, config: VisualConfig = NO_FLOOR, seed: int = 0
) -> RelativePose | None:
    """The motion that points in a keyframe and the same points in the next give; row i matches row i."""
    descriptors = np.random.default_rng(99).integers(0, 256, (len(old), 32), dtype=np.uint8)
    return relative_pose(Features(descriptors, old), Features(descriptors, new), config, seed)


def tangent(T: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return gtsam.Pose3.Logmap(gtsam.Pose3(T).between(gtsam.Pose3(truth)))


@settings(deadline=None, derandomize=True, max_examples=100)
@given(st.integers(0, 2**32 - 1), st.integers(3, 40), st.sampled_from(["space", "plane"]), st.floats(0.0, 2.0))
def test_a_rigid_fit_recovers_any_motion(seed, count, shape, turn):
    rng = np.random.default_rng(seed)
    T, source = motion(rng, turn, 1.0), rng.normal(size=(count, 3))
    if shape == "plane":
        source[:, 2] = 1.5  # a reflection would fit a plane as well
    found = rigid_motion(source, moved(T, source), rng.uniform(0.1, 1.0, count))
    np.testing.assert_allclose(moved(found, source), moved(T, source), atol=1e-6)
    np.testing.assert_allclose(found[:3, :3] @ found[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(found[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_array_equal(found[3], [0.0, 0.0, 0.0, 1.0])


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_no_motion_near_the_fit_costs_less(seed):
    rng = np.random.default_rng(seed)
    source, weights = rng.normal(size=(20, 3)), rng.uniform(0.1, 5.0, 20)
    target = moved(motion(rng), source) + 0.1 * rng.normal(size=(20, 3))
    T = rigid_motion(source, target, weights)

    def cost(tangent_step: np.ndarray) -> float:
        shifted = gtsam.Pose3(T).retract(tangent_step).matrix()
        return float(weights @ ((moved(shifted, source) - target) ** 2).sum(axis=1))

    for _ in range(12):
        assert cost(1e-3 * rng.normal(size=6)) > cost(np.zeros(6))


def test_a_batch_of_fits_is_the_fits_one_by_one():
    rng = np.random.default_rng(0)
    source, target, weights = rng.normal(size=(5, 4, 3)), rng.normal(size=(5, 4, 3)), rng.uniform(0.1, 1.0, (5, 4))
    batch = rigid_motion(source, target, weights)
    for i in range(5):
        np.testing.assert_allclose(batch[i], rigid_motion(source[i], target[i], weights[i]), atol=1e-12)


def test_points_without_weight_do_not_count():
    rng = np.random.default_rng(1)
    source, T = rng.normal(size=(10, 3)), motion(rng)
    target = moved(T, source)
    target[7:] += 5.0
    found = rigid_motion(source, target, np.r_[np.ones(7), np.zeros(3)])
    np.testing.assert_allclose(found, T, atol=1e-9)


@settings(deadline=None, derandomize=True, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_the_motion_is_found_among_forty_percent_of_wrong_matches(seed):
    rng = np.random.default_rng(seed)
    T, new = motion(rng, 0.1, 0.1), scene(rng, 150)
    old = moved(T, new) + 0.003 * new[:, 2:] * rng.normal(size=(150, 3))
    wrong = rng.permutation(150)[:60]
    old[wrong] = scene(rng, 60)
    edge = motion_between(old, new)
    assert edge is not None
    assert 85 <= edge.inliers <= 95
    error = tangent(edge.T_a_b, T)
    assert np.linalg.norm(error[:3]) < 0.004 and np.linalg.norm(error[3:]) < 0.006


def test_near_points_count_for_more():
    """Far ones, all misread by 40 mm in depth, move the answer by much less than half of that."""
    rng = np.random.default_rng(5)
    new = scene(rng, 100)
    new[:, 2] = np.where(np.arange(100) < 50, 0.8, 3.0)
    old = new.copy()
    old[50:, 2] += 0.04
    edge = motion_between(old, new)
    assert edge is not None and edge.inliers == 100
    assert 0.0 < edge.T_a_b[2, 3] < 0.01


def test_matches_that_agree_on_nothing_give_no_edge():
    rng = np.random.default_rng(2)
    assert motion_between(scene(rng, 200), scene(rng, 200)) is None
    few = scene(rng, NO_FLOOR.min_inliers - 1)
    assert motion_between(few, few) is None
    enough = scene(rng, NO_FLOOR.min_inliers)
    assert motion_between(enough, enough) is not None


def test_the_covariance_is_that_of_many_noisy_fits():
    """Noise grows with distance, as the fit's weights assume; the points lie to one side so that terms couple."""
    rng = np.random.default_rng(3)
    T, new = motion(rng), scene(rng, 120) + np.array([0.6, 0.0, 0.0])
    errors, squares, predicted = [], [], []
    for _ in range(150):
        old = moved(T, new) + 0.002 * moved(T, new)[:, 2:] * rng.normal(size=new.shape)
        edge = motion_between(old, new)
        assert edge is not None
        errors.append(tangent(edge.T_a_b, T))
        squares.append(errors[-1] @ np.linalg.solve(edge.covariance, errors[-1]) / 6.0)
        predicted.append(edge.covariance)
    assert 0.8 < np.mean(squares) < 1.25
    sampled, mean = np.cov(np.array(errors).T), np.mean(predicted, axis=0)
    np.testing.assert_allclose(np.sqrt(np.diag(sampled)), np.sqrt(np.diag(mean)), rtol=0.2)
    # the sign of the coupling between turning and moving shows that both are in the same tangent
    coupled = np.abs(mean) > 0.5 * np.sqrt(np.outer(np.diag(mean), np.diag(mean)))
    np.fill_diagonal(coupled, False)
    assert coupled.any() and (np.sign(sampled[coupled]) == np.sign(mean[coupled])).all()


def test_an_edge_is_never_surer_than_the_floor():
    rng = np.random.default_rng(4)
    points, config = scene(rng, 300), VisualConfig()
    edge = motion_between(points, points, config)
    assert edge is not None
    np.testing.assert_allclose(edge.covariance, edge.covariance.T, atol=1e-15)
    np.testing.assert_allclose(np.sqrt(np.diag(edge.covariance)), np.repeat(config.covariance_floor, 3), rtol=0.02)


# -- images


def extract(frame: Frame) -> Features:
    return FeatureExtractor(VisualConfig())(frame)


def true_motion(a: Frame, b: Frame) -> np.ndarray:
    assert a.T_world_camera is not None and b.T_world_camera is not None
    return np.linalg.inv(a.T_world_camera) @ b.T_world_camera


def next_keyframe(visual: VisualOdometry, number: int, features: Features) -> list[VisualEdge]:
    """Measures a keyframe against those before, then remembers it for the next ones."""
    edges = visual.edges(features)
    visual.remember(number, features)
    return edges


def test_edges_between_rendered_frames_are_close_to_the_truth(tabletop):
    chosen = list(tabletop[::7])
    visual = VisualOdometry(VisualConfig(), 0)
    for number, frame in enumerate(chosen):
        edges = next_keyframe(visual, number, extract(frame))
        assert [e.a for e in edges] == ([number - 1] if number else [])
        for edge in edges:
            truth = true_motion(chosen[edge.a], frame)
            error = tangent(edge.motion.T_a_b, truth)
            assert edge.motion.inliers > 150
            assert np.linalg.norm(truth[:3, 3]) > 0.05
            assert np.linalg.norm(error[:3]) < np.radians(0.3) and np.linalg.norm(error[3:]) < 0.008
            assert error @ np.linalg.solve(edge.motion.covariance, error) / 6.0 < 3.0
            np.linalg.cholesky(edge.motion.covariance)


def test_a_new_keyframe_is_measured_against_as_many_as_asked_for(tabletop):
    visual = VisualOdometry(VisualConfig(neighbours=2), 0)
    found = [[e.a for e in next_keyframe(visual, i, extract(f))] for i, f in enumerate(tabletop[:12:3])]
    assert found == [[], [0], [0, 1], [1, 2]]


def test_measuring_a_frame_does_not_make_it_a_keyframe(tabletop):
    visual = VisualOdometry(VisualConfig(), 0)
    next_keyframe(visual, 0, extract(tabletop[0]))
    first, second = (visual.edges(extract(tabletop[6])) for _ in range(2))
    assert [e.a for e in first] == [e.a for e in second] == [0]
    np.testing.assert_array_equal(first[0].motion.T_a_b, second[0].motion.T_a_b)


def test_the_same_images_give_the_same_edge(tabletop):
    runs = []
    for _ in range(2):
        visual = VisualOdometry(VisualConfig(), 7)
        next_keyframe(visual, 0, extract(tabletop[0]))
        runs.append(next_keyframe(visual, 1, extract(tabletop[6]))[0].motion)
    np.testing.assert_array_equal(runs[0].T_a_b, runs[1].T_a_b)
    np.testing.assert_array_equal(runs[0].covariance, runs[1].covariance)
    assert runs[0].inliers == runs[1].inliers


def blank(frame: Frame) -> Frame:
    return replace(frame, color=np.full_like(frame.color, 120))


def out_of_range(frame: Frame) -> Frame:
    return replace(frame, depth=np.full_like(frame.depth, 4.5))


def without_depth(frame: Frame) -> Frame:
    return replace(frame, depth=np.zeros_like(frame.depth))


@pytest.mark.parametrize("spoil", [blank, out_of_range, without_depth])
def test_without_features_or_their_depth_there_is_no_edge(tabletop, spoil):
    visual = VisualOdometry(VisualConfig(), 0)
    assert next_keyframe(visual, 0, extract(tabletop[0])) == []
    assert next_keyframe(visual, 1, extract(spoil(tabletop[3]))) == []
    assert next_keyframe(visual, 2, extract(tabletop[6])) == []  # its only neighbour has nothing to match
    assert len(next_keyframe(visual, 3, extract(tabletop[9]))) == 1

"""Motion between neighbouring frames by optical flow and depth: rendered frames, and images that tell nothing."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import FlowConfig
from thingmap.mapper.trajectory.odometry.image_motion import ImageMotion


def since(last: Frame, now: Frame, config: FlowConfig | None = None) -> np.ndarray | None:
    motion = ImageMotion(config or FlowConfig())
    motion.remember(last)
    return motion.since_last(now)


def off(T: np.ndarray, a: Frame, b: Frame) -> np.ndarray:
    """(6,) from a motion to the true one."""
    assert a.T_world_camera is not None and b.T_world_camera is not None
    truth = np.linalg.inv(a.T_world_camera) @ b.T_world_camera
    return gtsam.Pose3.Logmap(gtsam.Pose3(T).between(gtsam.Pose3(truth)))


def blank(frame: Frame) -> Frame:
    return replace(frame, color=np.full_like(frame.color, 120))


def without_depth(frame: Frame) -> Frame:
    return replace(frame, depth=np.zeros_like(frame.depth))


def without_image(frame: Frame) -> Frame:
    return replace(frame, color=np.empty((0, 0, 3), dtype=np.uint8))


@pytest.mark.parametrize("later", [1, 3])
def test_it_follows_the_true_camera(tabletop, later):
    gaps = []
    for a, b in zip(tabletop[:20:4], tabletop[later::4], strict=False):
        T = since(a, b)
        assert T is not None
        gaps.append(off(T, a, b))
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
    turned, moved = (np.linalg.norm(np.array(gaps)[:, part], axis=1) for part in (slice(3), slice(3, 6)))
    assert np.median(turned) < 0.004 and np.median(moved) < 0.006
    assert turned.max() < 0.01 and moved.max() < 0.015
    still = [
        np.linalg.norm(off(np.eye(4), a, b)[3:]) for a, b in zip(tabletop[:20:4], tabletop[later::4], strict=False)
    ]
    assert np.median(moved) < 0.5 * np.median(still)  # much better than no motion at all


def test_a_still_camera_does_not_move(tabletop):
    T = since(tabletop[0], tabletop[0])
    assert T is not None
    np.testing.assert_allclose(T, np.eye(4), atol=1e-6)


def test_it_is_the_last_frame_that_counts(tabletop):
    motion = ImageMotion(FlowConfig())
    assert motion.since_last(tabletop[0]) is None
    motion.remember(tabletop[0])
    motion.remember(tabletop[6])
    T = motion.since_last(tabletop[7])
    expected = since(tabletop[6], tabletop[7])
    assert T is not None and expected is not None
    np.testing.assert_array_equal(T, expected)
    np.testing.assert_array_equal(motion.since_last(tabletop[7]), expected)  # asking is not remembering


@pytest.mark.parametrize("spoil", [blank, without_depth, without_image])
def test_images_that_tell_nothing_give_no_motion(tabletop, spoil):
    assert since(spoil(tabletop[0]), tabletop[1]) is None
    assert since(tabletop[0], spoil(tabletop[1])) is None


def test_where_corners_are_too_few_features_lead(tabletop):
    a, b = tabletop[0], tabletop[3]
    T = since(a, b, FlowConfig(min_inliers=251))  # more corners than are looked for
    assert T is not None
    gap = off(T, a, b)
    assert np.linalg.norm(gap[:3]) < 0.01 and np.linalg.norm(gap[3:]) < 0.015
    followed = since(a, b)
    assert followed is not None and not np.array_equal(followed, T)


def test_what_agrees_on_nothing_gives_no_motion(tabletop):
    noise = np.random.default_rng(0).integers(0, 256, tabletop[1].color.shape, dtype=np.uint8)
    assert since(tabletop[0], replace(tabletop[1], color=noise)) is None

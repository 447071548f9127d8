"""Views of a painted wall: flat, so that its depth leaves three directions open, and known at every point."""

from __future__ import annotations

import zlib

import numpy as np

from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.trajectory.rgbd_view import RgbdView

CAMERA = Intrinsics(320, 240, 260.0, 260.0, 159.5, 119.5)
DISTANCE = 1.2  # m, of the wall z = DISTANCE


def paint(points: np.ndarray, seed: int = 0) -> np.ndarray:
    """(N,) grey levels at (N, 3) points of the wall: waves of 10 to 60 cm in all directions."""
    rng = np.random.default_rng(seed)
    angles, lengths = rng.uniform(0.0, np.pi, 6), rng.uniform(0.1, 0.6, 6)
    waves = 2.0 * np.pi * np.stack([np.cos(angles), np.sin(angles)]) / lengths
    return 128.0 + 18.0 * np.sin(points[:, :2] @ waves + rng.uniform(0.0, 6.0, 6)).sum(axis=1)


def wall_points(T_world_camera: np.ndarray) -> np.ndarray:
    """(H W, 3) where the camera's rays meet the wall, world."""
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.back_project(np.stack([u.ravel(), v.ravel()], axis=1), np.ones(u.size)) @ T_world_camera[:3, :3].T
    return T_world_camera[:3, 3] + rays * ((DISTANCE - T_world_camera[2, 3]) / rays[:, 2])[:, None]


def wall_view(T_world_camera: np.ndarray, painted: bool = True, seed: int = 0, noise: float = 0.002) -> RgbdView:
    """What a camera sees; `noise`: deviation of a depth reading, metres. `seed` is the painting's."""
    points = wall_points(T_world_camera)
    shape = CAMERA.height, CAMERA.width
    rng = np.random.default_rng(zlib.crc32(T_world_camera.tobytes()))
    z = (points - T_world_camera[:3, 3]) @ T_world_camera[:3, 2] + noise * rng.normal(size=len(points))
    grey = (paint(points, seed) if painted else np.full(len(points), 128.0)) + rng.normal(size=len(points))
    color = np.repeat(np.clip(np.rint(grey), 0, 255).astype(np.uint8)[:, None], 3, axis=1)
    return RgbdView(color.reshape(*shape, 3), z.reshape(shape).astype(np.float32), CAMERA)

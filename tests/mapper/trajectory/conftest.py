"""Frames with exact truth: a piece of the rendered sample, and depth images of planes."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.synthetic.sample import open_sample

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
Plane = tuple[Iterable[float], float]  # normal n and d of n . x = d, world, metres


@pytest.fixture(scope="session")
def tabletop() -> tuple[Frame, ...]:
    """One second of the rendered sample, every frame with its true pose; treat as read-only."""
    return tuple(open_sample("tabletop?frames=30&seed=1"))


@pytest.fixture(scope="session")
def plane_frame() -> Callable[..., Frame]:
    """`plane_frame(planes, T_world_camera, index, noise)`: the nearest of some planes, seen by a small depth camera.

    `noise` times z^2 is the deviation of a reading, metres.
    """

    def make(
        planes: Iterable[Plane], T_world_camera: np.ndarray | None = None, index: int = 0, noise: float = 0.0015
    ) -> Frame:
        T = np.eye(4) if T_world_camera is None else T_world_camera
        v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
        rays = CAMERA.back_project(np.stack([u.ravel(), v.ravel()], axis=1), np.ones(u.size))
        depth = np.full(u.size, np.inf)
        for normal, d in planes:
            n = np.asarray(normal, dtype=float)
            with np.errstate(divide="ignore"):
                z = (d - n @ T[:3, 3]) / (rays @ T[:3, :3].T @ n)
            depth = np.where((z > 0.0) & (z < depth), z, depth)
        depth[np.isinf(depth)] = 0.0
        depth += noise * depth**2 * np.random.default_rng(index).normal(size=u.size)
        image = depth.astype(np.float32).reshape(u.shape)
        color = np.full((*u.shape, 3), 128, dtype=np.uint8)
        return Frame(index, f"frame-{index:06d}", index / 30.0, color, image, CAMERA, T_world_camera)

    return make

"""Frames of random points for tests of voxels, and voxels as a dictionary of lists makes them."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from thingmap.mapper.labelling.voxels import VoxelEvidence, Voxels

NAMES = tuple(f"class {k}" for k in range(100))


@dataclass(frozen=True)
class PointFrame:
    """One frame's arguments of `VoxelEvidence.add`, in their order."""

    keyframe: int
    T_keyframe_camera: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    colours: np.ndarray
    log_p: np.ndarray

    def arguments(self) -> tuple:
        return self.keyframe, self.T_keyframe_camera, self.points, self.normals, self.colours, self.log_p


def pose(rng: np.random.Generator, reach: float = 0.2) -> np.ndarray:
    """(4, 4) rigid."""
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Q * np.sign(np.linalg.det(Q)), rng.uniform(-reach, reach, 3)
    return T


def random_frame(
    rng: np.random.Generator, classes: int, points: int, keyframe: int = 0, speaking: int | None = None
) -> PointFrame:
    """Points within a few centimetres, so that they share voxels; `speaking`: how many classes a point speaks of."""
    log_p = np.log(rng.uniform(0.01, 0.9, (points, classes + 1))).astype(np.float32)
    if speaking is not None:
        silent = np.argsort(rng.random((points, classes)), axis=1) >= speaking
        log_p[:, :classes][silent] = np.log(np.float32(0.01))
    normals = rng.normal(size=(points, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[rng.random(points) < 0.2] = np.nan
    near = rng.uniform(-0.02, 0.02, (points, 3)).astype(np.float32)
    colours = rng.integers(0, 256, (points, 3), dtype=np.uint8)
    return PointFrame(keyframe, pose(rng, 0.01), near, normals, colours, log_p)


def gathered(frames: list[PointFrame], config, classes: int, T_world_keyframe=None) -> VoxelEvidence:
    evidence = VoxelEvidence(NAMES[:classes], config)
    for frame in frames:
        evidence.add(*frame.arguments(), T_world_keyframe)
    return evidence


def reference(frames: list[PointFrame], size: float) -> dict[tuple[int, ...], dict[str, np.ndarray]]:
    """Cell -> its values, of frames that all hang on a keyframe at the origin."""
    lists: dict[tuple[int, ...], list] = defaultdict(list)
    for number, frame in enumerate(frames):
        T = frame.T_keyframe_camera
        world = frame.points.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
        normals = frame.normals.astype(np.float64) @ T[:3, :3].T
        for p, cell in enumerate(np.floor(world / size).astype(int).tolist()):
            lists[tuple(cell)].append((number, world[p], frame.colours[p], normals[p], frame.log_p[p]))
    voxels = {}
    for cell, held in lists.items():
        numbers, points, colours, normals, log_p = (np.array(column) for column in zip(*held, strict=True))
        voxels[cell] = {
            "points": points.mean(axis=0),
            "colours": colours.mean(axis=0),
            "normal_sum": np.nansum(normals, axis=0),
            "log_p": log_p.astype(np.float64).mean(axis=0),
            "excess": (log_p[:, :-1] - log_p[:, :-1].min(axis=1, keepdims=True)).astype(np.float64),
            "count": len(held),
            "views": len(set(numbers.tolist())),
        }
    return voxels


def assert_same(voxels: Voxels, other: Voxels, tolerance: float = 0.0) -> None:
    np.testing.assert_array_equal(voxels.cells, other.cells)
    np.testing.assert_array_equal(voxels.count, other.count)
    np.testing.assert_array_equal(voxels.views, other.views)
    for name in ("points", "colours", "normals", "log_p"):
        np.testing.assert_allclose(getattr(voxels, name), getattr(other, name), atol=tolerance, rtol=tolerance)

"""Places to look from: where the camera has been, and places around things that seem free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ...datasets.frame import Intrinsics
from ..map.boxes import box_axes
from ..map.thing import Thing

SPACING = (0.1, 0.17)  # metres and radians between poses of the trajectory: views closer than that are the same
MOST_POSES = 150  # of the trajectory: a walk of 15 m; of a longer one, evenly chosen
AZIMUTHS = 12  # of a ring: every 30 degrees
SIDES_PX = (60.0, 120.0)  # how large a thing appears from its two rings, in pixels of a 640 wide image
DISTANCES = (0.5, 3.0)  # metres of a ring: the range of a depth camera
CLEARANCE = 0.2  # metres that a camera stays away from surfaces
ABOVE = 0.4  # metres above a thing, where no camera has been that could tell how high it is carried


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """A place to look from.

    Attributes:
        T_world_camera: (4, 4).
        gain_bits: expected information of the look, given that the viewpoints before it were looked from.
        things: ids of those it tells of (1 % of the gain or more), the one that it tells most of first.
        visible: of each of them, the share that should be in the image and not hidden, in [0, 1].
        visited: whether the camera was there, so that it can be reached; else a place that is free as far as is known.
    """

    T_world_camera: np.ndarray
    gain_bits: float
    things: tuple[str, ...]
    visible: tuple[float, ...]
    visited: bool


def visited_poses(poses: np.ndarray) -> np.ndarray:
    """(M, 4, 4) of (N, 4, 4) poses, none close to the one before, at most `MOST_POSES`."""
    kept: list[int] = []
    for i, T in enumerate(poses):
        if not kept or _far_apart(poses[kept[-1]], T):
            kept.append(i)
    chosen = np.array(kept, dtype=np.int64)
    if len(chosen) > MOST_POSES:
        chosen = chosen[np.linspace(0, len(chosen) - 1, MOST_POSES).round().astype(np.int64)]
    return poses[chosen]


def ring_poses(things: list[Thing], visited: np.ndarray, R_world_upright: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """(M, 4, 4) level rings around things, at the height at which the camera was carried, looking at them."""
    up = R_world_upright[:, 2]
    carried = float(np.median(visited[:, :3, 3] @ up)) if len(visited) else None
    poses = []
    for thing in things:
        height = ABOVE if carried is None else carried - float(thing.position @ up)
        for side in SIDES_PX:
            scale = side * camera.width / 640.0
            wanted = camera.fx * float(np.cbrt(np.prod(np.maximum(thing.size, 1e-3)))) / scale
            distance = float(np.clip(wanted, *DISTANCES))
            radius = np.sqrt(max(distance**2 - height**2, DISTANCES[0] ** 2))
            for angle in 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS:
                level = np.array([radius * np.cos(angle), radius * np.sin(angle), height])
                poses.append(looking_at(thing.position + R_world_upright @ level, thing.position, up))
    return np.array(poses).reshape(-1, 4, 4)


def free_places(
    centres: np.ndarray, things: list[Thing], points: np.ndarray, R_world_upright: np.ndarray
) -> np.ndarray:
    """(M,) bool: which of (M, 3) places, metres, are `CLEARANCE` away from all things and points of the cloud."""
    free = np.ones(len(centres), dtype=bool)
    for thing in things:
        local = (centres - thing.position) @ box_axes(thing.yaw, R_world_upright)
        outside = np.maximum(np.abs(local) - thing.size / 2.0, 0.0)
        free &= np.linalg.norm(outside, axis=1) > CLEARANCE
    if len(points):
        free &= KDTree(points).query(centres, distance_upper_bound=CLEARANCE)[0] > CLEARANCE
    return free


def looking_at(eye: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(4, 4) `T_world_camera` at `eye` (3,), looking at `target` (3,), metres, with the image's rows level."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-6:  # straight down: any side is level
        right = np.cross(forward, np.roll(up, 1) + np.array([1e-3, 0.0, 0.0]))
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T[:3, 3] = eye
    return T


def _far_apart(T_a: np.ndarray, T_b: np.ndarray) -> bool:
    metres, radians = SPACING
    if np.linalg.norm(T_a[:3, 3] - T_b[:3, 3]) > metres:
        return True
    cosine = (np.trace(T_a[:3, :3].T @ T_b[:3, :3]) - 1.0) / 2.0
    return bool(np.arccos(np.clip(cosine, -1.0, 1.0)) > radians)

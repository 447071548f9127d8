"""How much of a map's things a camera would see, by the model that the mapper itself sees with (`factors/visibility`).

What hides a thing is one depth image of the whole map. A thing does not hide itself: its surface lies inside its box,
and a ray counts as hidden only where something lies before the box (see `factors/visibility.py`). A thing whose box
holds the middle of another one (a shelf, a chair over a shoe) is no solid and is not drawn: the cloud, where there is
one, shows what of it is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ...datasets.frame import Intrinsics
from ...factors.solid import project_solid, project_solids
from ...factors.visibility import TOLERANCE_M, VolumePart, measure_visibility
from ..map.boxes import box_axes, inside_box
from ..map.thing import Thing
from .answer import PROBABLE
from .depth_image import draw_ellipsoids, draw_points, empty_depth

SAMPLES = 32  # of a position: a probability is known to 0.03
LEAST_EXTENT = 0.005  # metres; a flat box of an edited map still has a volume
STEP = 2  # every second row and column of a volume is looked at
WHOLE = VolumePart.WHOLE


@dataclass(frozen=True, slots=True, eq=False)
class Volumes:
    """N things as arrays: (N, 3) centres in metres, (N, 3) log half-axes, (N, 3, 3) axes in columns, (N,) yaws."""

    centers: np.ndarray
    log_half_axes: np.ndarray
    axes: np.ndarray
    yaws: np.ndarray

    @classmethod
    def of(cls, things: Sequence[Thing], R_world_upright: np.ndarray) -> Volumes:
        sizes = np.array([thing.size for thing in things]).reshape(-1, 3)
        return cls(
            centers=np.array([thing.position for thing in things]).reshape(-1, 3),
            log_half_axes=np.log(np.maximum(sizes, LEAST_EXTENT) / 2.0),
            axes=np.array([box_axes(thing.yaw, R_world_upright) for thing in things]).reshape(-1, 3, 3),
            yaws=np.array([thing.yaw for thing in things]),
        )

    def boxes(self, T_world_camera: np.ndarray, camera: Intrinsics) -> np.ndarray:
        """(N, 4) xyxy in pixels, clipped to the image (of no area beside it); NaN where not wholly in front."""
        xyxy = np.empty((len(self.centers), 4))
        for chosen, R in self._by_yaw():
            volumes = self.centers[chosen], self.log_half_axes[chosen]
            xyxy[chosen] = project_solids(T_world_camera, R, *volumes, camera)[0]
        return clip_boxes(xyxy, camera)

    def visible(
        self, depth: np.ndarray, T_world_camera: np.ndarray, camera: Intrinsics, tolerance: float
    ) -> np.ndarray:
        """(N,) share that the camera sees: inside the image and not hidden by the (H, W) depth image."""
        share = np.zeros(len(self.centers))
        for chosen, R in self._by_yaw():
            volumes = self.centers[chosen], self.log_half_axes[chosen]
            share[chosen] = _visible(depth, camera, T_world_camera, R, *volumes, tolerance)
        return share

    def _by_yaw(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Things of one yaw are measured together; the mapper's own all have the yaw 0."""
        return [((same := self.yaws == yaw), self.axes[int(np.argmax(same))]) for yaw in np.unique(self.yaws)]


class Occluders:
    """What of a map hides things: its cloud, and the things that are more likely there than not.

    Args:
        things: of the map.
        volumes: of the things.
        R_world_upright: axes of the upright frame.
        points: (M, 3) float32 of the cloud, metres, map frame; maybe none.
        spacing: metres between them.
    """

    def __init__(
        self,
        things: Sequence[Thing],
        volumes: Volumes,
        R_world_upright: np.ndarray,
        points: np.ndarray,
        spacing: float,
    ) -> None:
        self.points, self.spacing = points, spacing
        likely = np.array([thing.existence >= PROBABLE for thing in things], dtype=bool)
        hollow = [_holds_another(i, things, volumes, likely, R_world_upright) for i in range(len(things))]
        solid = likely & ~np.array(hollow, dtype=bool)
        self._drawn = volumes.centers[solid], volumes.log_half_axes[solid], volumes.axes[solid]

    @property
    def tolerance(self) -> float:
        """Metres that something must lie before a box to hide it: a splat may stand out by as much as it is wide."""
        return TOLERANCE_M + (self.spacing if len(self.points) else 0.0)

    def depth(self, T_world_camera: np.ndarray, camera: Intrinsics) -> np.ndarray:
        """(H, W) float32 metres."""
        depth = empty_depth(camera)
        draw_points(depth, self.points, self.spacing, T_world_camera, camera)
        draw_ellipsoids(depth, *self._drawn, T_world_camera, camera)
        return depth


def sampled_visibility(
    thing: Thing,
    R_world_upright: np.ndarray,
    depth: np.ndarray,
    T_world_camera: np.ndarray,
    camera: Intrinsics,
    tolerance: float,
) -> np.ndarray:
    """(S,) share of a thing that the camera sees, for `SAMPLES` equally likely positions of it.

    Its own surface stays in the depth image while the position varies, so what lies nearer by less than the farthest
    sample's distance behind the mean hides nothing.
    """
    values, vectors = np.linalg.eigh(thing.position_covariance)
    offsets = _NORMALS @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    away = thing.position - T_world_camera[:3, 3]
    behind = float(np.max(offsets @ away)) / max(float(np.linalg.norm(away)), 1e-9)
    sizes = np.tile(np.log(np.maximum(thing.size, LEAST_EXTENT) / 2.0), (SAMPLES, 1))
    R = box_axes(thing.yaw, R_world_upright)
    volumes = thing.position + offsets, sizes
    return _visible(depth, camera, T_world_camera, R, *volumes, tolerance + max(behind, 0.0))


def box_std(thing: Thing, R_world_upright: np.ndarray, T_world_camera: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """(4,) standard deviations of the sides of a thing's box in the image, pixels, to first order in position and size.

    The sides are those of the whole box, wherever the image ends; NaN where it is not wholly in front of the camera.
    """
    log_half_axes = np.log(np.maximum(thing.size, LEAST_EXTENT) / 2.0)
    p = project_solid(T_world_camera, box_axes(thing.yaw, R_world_upright), thing.position, log_half_axes)
    if not p.in_front:
        return np.full(4, np.nan)
    relative = thing.size_std / np.maximum(thing.size, LEAST_EXTENT)  # of a logarithm
    variance = np.einsum("ij,jk,ik->i", p.J_center, thing.position_covariance, p.J_center)
    variance += (p.J_size * relative) ** 2 @ np.ones(3)
    return np.sqrt(np.maximum(variance, 0.0)) * np.array([camera.fx, camera.fy] * 2)


def clip_boxes(xyxy: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """(N, 4) boxes cut off at the image's borders."""
    return np.clip(xyxy, -0.5, np.array([camera.width, camera.height] * 2) - 0.5)


def box_sides(xyxy: np.ndarray) -> np.ndarray:
    """(N,) geometric mean of the sides of boxes, pixels; 0 where there is none."""
    return np.sqrt(np.nan_to_num(np.maximum(xyxy[:, 2] - xyxy[:, 0], 0) * np.maximum(xyxy[:, 3] - xyxy[:, 1], 0)))


def _visible(depth, camera, T_world_camera, R, centers, log_half_axes, tolerance) -> np.ndarray:
    seen = measure_visibility(
        depth, camera, T_world_camera, R, centers, log_half_axes, STEP, tolerance, likelihood=None
    )
    return seen.visible[:, WHOLE]


def _holds_another(
    i: int, things: Sequence[Thing], volumes: Volumes, likely: np.ndarray, R_world_upright: np.ndarray
) -> bool:
    box = things[i].position, things[i].size, things[i].yaw, R_world_upright
    return int(np.sum(inside_box(volumes.centers[likely], *box))) > int(likely[i])


def _normal_samples(count: int) -> np.ndarray:
    """(count, 3) points spread as a standard normal distribution is, mean zero: Roberts' additive recurrence."""
    root = 1.2207440846057596  # of x^4 = x + 1: steps by its inverse powers fill a cube evenly
    steps = root ** -np.arange(1.0, 4.0)
    uniform = (0.5 + np.outer(np.arange(1, count // 2 + 1), steps)) % 1.0
    half = ndtri(uniform)
    return np.vstack([half, -half])


_NORMALS = _normal_samples(SAMPLES)

"""Where the things of a map are in an image, and how much of each can be seen there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Intrinsics
from ...detectors.boxes import EDGE
from ...factors.visibility import TOLERANCE_M, VolumePart, measure_visibility
from ..evaluation.boxes.projection import MIN_HALF_AXIS_M, project_cylinders
from ..map.boxes import box_axes
from ..map.thing import Thing


@dataclass(frozen=True, slots=True, eq=False)
class ThingBoxes:
    """Boxes of M things in an image.

    Attributes:
        thing: (M,) which of the things.
        xyxy: (M, 4) pixels, box of the whole thing, hidden parts too, clipped to the image; pixel centres at integers.
        visibility: (M,) share of the thing that is in the image and not hidden.
    """

    thing: np.ndarray
    xyxy: np.ndarray
    visibility: np.ndarray


def thing_boxes(
    things: Sequence[Thing],
    R_world_upright: np.ndarray,
    T_world_camera: np.ndarray,
    depth: np.ndarray,
    intrinsics: Intrinsics,
    min_visibility: float,
    tolerance_m: float = TOLERANCE_M,
) -> ThingBoxes:
    """Those of the things that are wholly before the camera, in the image, and visible by `min_visibility`.

    Boxes are those of upright elliptic cylinders (`project_cylinders`), visibility that of the ellipsoids within
    (`measure_visibility`); where depth has no reading, nothing hides.

    Args:
        things: N of one map.
        R_world_upright: (3, 3) of the map.
        T_world_camera: (4, 4), map frame.
        depth: (H, W) float32 metres, 0 without reading.
        intrinsics: of the depth image.
        min_visibility: in [0, 1].
        tolerance_m: what stands before a thing by less does not hide it.
    """
    if not things:
        return ThingBoxes(np.empty(0, dtype=np.int64), np.empty((0, 4)), np.empty(0))
    xyxy = project_cylinders(things, T_world_camera, R_world_upright, intrinsics)
    low, high = -EDGE, np.array([intrinsics.width, intrinsics.height] * 2) - EDGE
    clipped = np.clip(xyxy, low, high)
    visibility = _visibility(things, R_world_upright, T_world_camera, depth, intrinsics, tolerance_m)
    extent = clipped[:, 2:] - clipped[:, :2]
    shown = np.all(extent > 0.0, axis=1) & (visibility > 0.0) & (visibility >= min_visibility)  # NaN is not > 0
    rows = np.nonzero(shown)[0]
    return ThingBoxes(rows, clipped[rows], visibility[rows])


def _visibility(
    things: Sequence[Thing],
    R_world_upright: np.ndarray,
    T_world_camera: np.ndarray,
    depth: np.ndarray,
    intrinsics: Intrinsics,
    tolerance_m: float,
) -> np.ndarray:
    """(N,) shares; things of one yaw have their axes in common and are measured together."""
    centers = np.array([thing.position for thing in things])
    half = np.log(np.maximum(np.array([thing.size for thing in things]) / 2.0, MIN_HALF_AXIS_M))
    yaws, visible = np.array([thing.yaw for thing in things]), np.zeros(len(things))
    for yaw in np.unique(yaws):
        rows, axes = yaws == yaw, box_axes(float(yaw), R_world_upright)
        view = depth, intrinsics, T_world_camera, axes
        measured = measure_visibility(*view, centers[rows], half[rows], tolerance_m=tolerance_m, likelihood=None)
        visible[rows] = measured.visible[:, VolumePart.WHOLE]
    return visible

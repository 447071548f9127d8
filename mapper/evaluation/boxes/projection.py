"""Where the things of a map would be seen in an image.

A thing is given by its extents. What fills them lies between the inscribed ellipsoid and the box itself, and which it
is no map says. The thing is drawn as the upright elliptic cylinder between the two: Meger et al. (Clutter, section
III-B) too take their objects for cylinders. From wherever it is seen, the image box of any solid that fills those
extents shares at least half of its area with that of the cylinder, up to perspective, be the solid a ball or a brick:
a thing of the right size in the right place is found at an IoU of 0.5 whatever its shape. With the ellipsoid a cube
seen across its corner is not (IoU 0.41), with the box a bowl is not (0.48).

A cylinder is the hull of its two end discs, a disc is an ellipsoid of no height, and so the cylinder's image box is
the one about the boxes of two ellipsoids of `factors.volume`: exact, without sampling its outline.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....datasets.frame import Intrinsics
from ....factors.volume import project_volumes
from ...map.boxes import box_axes
from ...map.object_map import ObjectMap
from ...map.thing import Thing
from ..inputs.case import PlacedThing
from .image_boxes import FoundBoxes, found_boxes

MIN_HALF_AXIS_M = 1e-6  # a thing without extent has no logarithm


def project_cylinders(
    things: Sequence[Thing], T_world_camera: np.ndarray, R_world_upright: np.ndarray, intrinsics: Intrinsics
) -> np.ndarray:
    """(N, 4) image boxes of N things as upright elliptic cylinders.

    Args:
        things: in the map's frame.
        T_world_camera: (4, 4) in the map's frame.
        R_world_upright: (3, 3), of the map.
        intrinsics: of the image.

    Returns:
        Pixels, centres at integers, not clipped to the image; NaN for a thing not wholly in front of the camera.
    """
    count = len(things)
    half = np.maximum(np.array([thing.size for thing in things]).reshape(-1, 3) / 2.0, MIN_HALF_AXIS_M)
    middles = np.array([thing.position for thing in things]).reshape(-1, 3)
    rise = half[:, 2:] * R_world_upright[:, 2]
    centres = np.concatenate([middles + rise, middles - rise])
    disc = np.concatenate([np.log(half[:, :2]), np.full((count, 1), -np.inf)], axis=1)
    discs = np.concatenate([disc, disc])
    yaws = np.tile([thing.yaw for thing in things], 2)
    ends = np.full((2 * count, 4), np.nan)
    for yaw in np.unique(yaws):  # things of one yaw have their axes in common
        rows, axes = yaws == yaw, box_axes(float(yaw), R_world_upright)
        ends[rows], _ = project_volumes(T_world_camera, axes, centres[rows], discs[rows], intrinsics)
    top, bottom = ends[:count], ends[count:]
    return np.concatenate([np.minimum(top, bottom)[:, :2], np.maximum(top, bottom)[:, 2:]], axis=1)


def projected_boxes(
    things: Sequence[PlacedThing],
    object_map: ObjectMap,
    T_world_camera: np.ndarray,
    classes: Sequence[str],
    intrinsics: Intrinsics,
) -> FoundBoxes:
    """What things of a map claim in an image, ranked by belief in their label; hidden or not: a map says that they are.

    Args:
        things: of `object_map`.
        object_map: whose axes they and the pose are in.
        T_world_camera: (4, 4).
        classes: of the truth; each thing's label is one of them.
        intrinsics: of the image.
    """
    xyxy = project_cylinders([one.thing for one in things], T_world_camera, object_map.R_world_upright, intrinsics)
    class_id = np.array([classes.index(one.label) for one in things], dtype=np.int64)
    return found_boxes(xyxy, class_id, np.array([one.belief for one in things]), intrinsics)

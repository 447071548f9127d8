"""Clouds of single objects from one view, such as those of the Washington RGB-D Object Dataset, as images again.

    bowl/bowl_2/bowl_2_1_45.pcd     fields x y z rgb; class, instance, video, frame

The dataset's axes are x right, y forward, z up; clouds in camera axes (x right, y down, z forward) are told apart by
which way they lie before the camera. Its clouds leave out points that lie on no surface of the object, so that the
image has holes inside the object: those are closed, in depth as well as in colour, and the object's mask with them.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from ..errors import InputError
from ..frame import Intrinsics
from ..pcd import BadPcd, read_pcd
from ..recorded import natural_key
from .class_names import class_name
from .object_view import BrokenView, ObjectView, ObjectViews, ViewEntry, margin_window, mask_box
from .washington import FOCAL, VIEW_NAME

LAYOUT = "CLASS_INSTANCE_VIDEO_FRAME.pcd"
CAMERA = Intrinsics(640, 480, FOCAL, FOCAL, 320.0, 240.0)
AXES = (((0, 1), (2, -1), (1, 1)), ((0, 1), (1, 1), (2, 1)))  # right, down, forward: column of the cloud and its sign
HOLE = 5  # pixels, the widest gap between points that is taken for a hole in the object
MIN_POINTS = 50  # fewer show no object


def holds_clouds(folder: Path) -> bool:
    """Whether there is a cloud below a folder whose name tells its class."""
    return any(VIEW_NAME.fullmatch(path.stem) for path in folder.rglob("*.pcd"))


def pcd_views(folder: Path) -> ObjectViews:
    """All clouds below a folder, in natural order; those whose name tells no class are skipped.

    Raises:
        InputError: no cloud's name tells a class.
    """
    entries, skipped = [], {}
    for path in sorted(folder.rglob("*.pcd"), key=lambda path: natural_key(str(path))):
        match = VIEW_NAME.fullmatch(path.stem)
        if match is None:
            skipped[path.stem] = f"its name is not {LAYOUT} ({path})"
            continue
        label = class_name(match["label"])
        instance = f"{label} {match['instance']}"
        entries.append(ViewEntry(label, instance, path.stem, partial(_view, path, label, instance)))
    if not entries:
        found = f"{len(skipped)} .pcd files of other names" if skipped else "no .pcd file"
        raise InputError(folder, LAYOUT, found, "name the clouds in this way, for example bowl_1_1_1.pcd")
    return ObjectViews(entries, skipped)


def _view(path: Path, label: str, instance: str) -> ObjectView:
    try:
        fields = read_pcd(path)
    except (BadPcd, OSError) as error:
        raise BrokenView(f"{path}: {error}") from None
    if missing := [name for name in ("x", "y", "z", "rgb") if name not in fields]:
        raise BrokenView(f"{path}: no field {', '.join(missing)}")
    points = np.stack([fields[axis] for axis in "xyz"], axis=1).astype(np.float64)
    measured = np.isfinite(points).all(axis=1) & (points != 0.0).any(axis=1)
    if measured.sum() < MIN_POINTS:
        raise BrokenView(f"{path}: {measured.sum()} points, {MIN_POINTS} needed to show an object")
    points, pixels = _pixels(path, points[measured])
    color, depth = _drawn(points, pixels, _colors(fields["rgb"][measured]))
    rows, columns = margin_window(mask_box(depth > 0.0), CAMERA.width, CAMERA.height)
    color, depth, mask = _closed(color[rows, columns].copy(), depth[rows, columns].copy())
    return ObjectView(label, instance, path.stem, color, depth, mask, mask_box(mask), FOCAL)


def _pixels(path: Path, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points in camera axes and their (N, 2) pixels, column and row."""
    for axes in AXES:
        turned = np.stack([sign * points[:, column] for column, sign in axes], axis=1)
        if (turned[:, 2] <= 0.0).any():
            continue
        pixels = np.rint(CAMERA.project(turned)).astype(np.int64)
        if ((pixels >= 0) & (pixels < [CAMERA.width, CAMERA.height])).all():
            return turned, pixels
    raise BrokenView(f"{path}: not seen whole by a camera of 640 x 480 and f = {FOCAL} at the cloud's origin")


def _colors(packed: np.ndarray) -> np.ndarray:
    """(N, 3) uint8 RGB of a field that holds 0x00RRGGBB, as a float's bits or as a whole number."""
    bits = packed.view(np.uint32) if packed.dtype == np.float32 else packed.astype(np.uint32)
    return np.stack([bits >> shift & 255 for shift in (16, 8, 0)], axis=1).astype(np.uint8)


def _drawn(points: np.ndarray, pixels: np.ndarray, colors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The camera's images with one pixel a point; the nearest of several wins."""
    color = np.zeros((CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
    depth = np.zeros((CAMERA.height, CAMERA.width), dtype=np.float32)
    order = np.argsort(-points[:, 2], kind="stable")
    column, row = pixels[order].T
    color[row, column], depth[row, column] = colors[order], points[order, 2]
    return color, depth


def _closed(color: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Images and mask without holes inside the object: each pixel of a hole is as the drawn pixel nearest to it."""
    drawn = depth > 0.0
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (HOLE, HOLE))
    mask = cv2.morphologyEx(drawn.astype(np.uint8), cv2.MORPH_CLOSE, kernel).astype(bool)
    hole = mask & ~drawn
    nearest = np.asarray(distance_transform_edt(~drawn, return_distances=False, return_indices=True))
    rows, columns = nearest[:, hole]
    color[hole], depth[hole] = color[rows, columns], depth[rows, columns]
    return color, depth, mask

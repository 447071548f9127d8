"""Crops of the Washington RGB-D Object Dataset (Lai et al. 2011), and your own in that layout.

    bowl/bowl_2/bowl_2_1_45_crop.png        8-bit colour: class, instance, video, frame
                bowl_2_1_45_depthcrop.png   uint16, millimetres, 0 = no reading
                bowl_2_1_45_maskcrop.png    not 0 where the object is
                bowl_2_1_45_loc.txt         upper left corner in the whole image; a view does not need it

The three images are of one size. Depth or masks may be missing for all views, not for some.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..frame import BrokenFrame, Intrinsics
from ..images import DepthUnit, FrameFiles, first_image_size, read_color, read_frame_images
from ..recorded import natural_key
from .class_names import class_name
from .object_view import BrokenView, ObjectView, ObjectViews, ViewEntry, mask_box

LAYOUT = "CLASS_INSTANCE_VIDEO_FRAME_crop.png, with _depthcrop.png and _maskcrop.png"
FOCAL = 570.3  # px of the whole 640 x 480 image, as the dataset's clouds were made with
DEPTH_UNIT = DepthUnit(per_metre=1000.0)
VIEW_NAME = re.compile(r"(?P<label>.+)_(?P<instance>\d+)_(?P<video>\d+)_(?P<frame>\d+)")


def holds_crops(folder: Path) -> bool:
    """Whether there is a crop below a folder."""
    return next(folder.rglob("*_crop.png"), None) is not None


def washington_views(folder: Path) -> ObjectViews:
    """All crops below a folder, in natural order (frame 2 before 10); those whose name tells no class are skipped.

    Raises:
        InputError: there is no crop, or no crop's name tells a class.
    """
    crops = sorted(folder.rglob("*_crop.png"), key=lambda path: natural_key(str(path)))
    has_depth = any(_beside(path, "depthcrop").is_file() for path in crops)
    has_mask = any(_beside(path, "maskcrop").is_file() for path in crops)
    entries, skipped = [], {}
    for path in crops:
        name = path.name.removesuffix("_crop.png")
        match = VIEW_NAME.fullmatch(name)
        if match is None:
            skipped[name] = f"its name is not CLASS_INSTANCE_VIDEO_FRAME_crop.png ({path})"
            continue
        label = class_name(match["label"])
        instance = f"{label} {match['instance']}"
        read = partial(_view, path, label, instance, name, has_depth, has_mask)
        entries.append(ViewEntry(label, instance, name, read))
    if not entries:
        found = f"{len(crops)} files *_crop.png of other names" if crops else "no such file"
        raise InputError(folder, LAYOUT, found, "give the folder that holds the classes")
    return ObjectViews(entries, skipped)


def _view(path: Path, label: str, instance: str, name: str, has_depth: bool, has_mask: bool) -> ObjectView:
    size = first_image_size([path])
    if size is None:
        raise BrokenView(f"{path} cannot be decoded")
    camera = Intrinsics(*size, FOCAL, FOCAL, 0.0, 0.0)  # where the crop lies in the image does not matter here
    try:
        if has_depth:
            files = FrameFiles(name, path, _beside(path, "depthcrop"))
            color, depth = read_frame_images(files, DEPTH_UNIT, camera)
        else:
            color, depth = read_color(name, path, camera), None
        mask = read_color(name, _beside(path, "maskcrop"), camera).max(axis=2) > 0 if has_mask else None
    except BrokenFrame as broken:
        raise BrokenView(f"{broken.problem.value} ({broken.detail})") from None
    box = np.array([0.0, 0.0, *size]) if mask is None else mask_box(mask)
    return ObjectView(label, instance, name, color, depth, mask, box, FOCAL)


def _beside(crop: Path, kind: str) -> Path:
    return crop.with_name(crop.name.removesuffix("crop.png") + f"{kind}.png")

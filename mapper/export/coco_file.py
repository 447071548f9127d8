"""COCO annotations of a sequence: the things of its map as boxes in the images, for training and checking detectors.

    images       every k-th mapped frame: file name, size, stamp, T_world_camera
    annotations  a thing in an image: bbox [x, y, width, height] of the whole thing, clipped to the image, with
                 thing, probability, existence and visibility
    categories   the map's classes, numbered from 1

Boxes count from the outer edge of the image's first pixel, as COCO's do: pixel (0, 0) spans 0 to 1. There are no masks:
a map knows extents, not outlines.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ...datasets.errors import UserError
from ...detectors.boxes import EDGE
from ..map.atomic import write_atomic
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from .chosen import read_things
from .coco_images import MappedImage, drawn_images, open_images, read_images
from .thing_boxes import ThingBoxes, thing_boxes

MIN_VISIBILITY = 0.25  # share; the evaluator too blames nobody for what is hidden more than that


def export_coco(
    folder: OutputFolder,
    file: Path,
    *,
    every: int = 1,
    sequence: str | None = None,
    dataset: str | None = None,
    min_visibility: float = MIN_VISIBILITY,
    min_existence: float = 0.0,
    say: Callable[[str], None] = lambda line: None,
) -> int:
    """Write annotations of the mapped frames; returns the number of boxes.

    What hides a thing is told by the depth images of the sequence. Where the sequence is not at hand and none is named,
    the map's cloud tells it, images are named by their stamps, and `say` is told so.

    Args:
        folder: of the run.
        file: to write.
        every: k: every k-th mapped frame, from the first.
        sequence: what was mapped, where it is elsewhere now.
        dataset: its loader.
        min_visibility: things of which a smaller share can be seen are left out.
        min_existence: things below it are left out.
        say: takes a line that the user should see.

    Raises:
        UserError: the sequence that is named cannot be read or is not the one that was mapped; there is neither a
            sequence nor a cloud with the map's camera.
    """
    object_map = read_things(folder, min_existence)
    stamps, poses = (values[::every] for values in folder.read_trajectory())
    frames = open_images(folder, sequence, dataset, say)
    if frames is None:
        told_by, images = "the map's cloud", drawn_images(folder, object_map, stamps, poses)
    else:
        told_by, images = "the depth images of the sequence", read_images(folder, frames, stamps, poses, say)
    document = _document(object_map, images, min_visibility, told_by)
    write_atomic(file, json.dumps(document, ensure_ascii=False, allow_nan=False).encode())
    return len(document["annotations"])


def _document(
    object_map: ObjectMap, images: Iterator[MappedImage], min_visibility: float, told_by: str
) -> dict[str, Any]:
    labels = list(dict.fromkeys([*object_map.classes, *(thing.label for thing in object_map.things)]))
    about = {
        "description": f"things of the map of {object_map.source}, projected into its images",
        "visibility": f"by {told_by}; at least {min_visibility:g}",
        "T_world_camera": f"metres, map frame ({object_map.frame}); x right, y down, z forward",
    }
    pictures: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for image in images:
        picture = _picture(len(pictures) + 1, image)
        view = object_map.R_world_upright, image.T_world_camera, image.depth, image.intrinsics
        boxes = thing_boxes(object_map.things, *view, min_visibility, image.tolerance_m)
        pictures.append(picture)
        annotations += _annotations(object_map, labels, boxes, picture["id"], len(annotations))
    if twice := [name for name, count in Counter(one["file_name"] for one in pictures).items() if count > 1]:
        raise UserError(f"{object_map.source}: {len(twice)} images share a name, such as {twice[0]}")
    categories = [{"id": number, "name": label} for number, label in enumerate(labels, start=1)]
    return {"info": about, "images": pictures, "annotations": annotations, "categories": categories}


def _picture(number: int, image: MappedImage) -> dict[str, Any]:
    return {
        "id": number,
        "file_name": image.file_name,
        "width": image.intrinsics.width,
        "height": image.intrinsics.height,
        "stamp": float(image.stamp),
        "T_world_camera": image.T_world_camera.tolist(),
    }


def _annotations(
    object_map: ObjectMap, labels: list[str], boxes: ThingBoxes, image: int, before: int
) -> Iterator[dict[str, Any]]:
    """Numbers go on from `before`; none is 0, which COCO's evaluation takes for "no match"."""
    for row, (index, xyxy, visibility) in enumerate(zip(boxes.thing, boxes.xyxy, boxes.visibility, strict=True)):
        thing = object_map.things[index]
        x, y, width, height = *(xyxy[:2] + EDGE), *(xyxy[2:] - xyxy[:2])
        yield {
            "id": before + row + 1,
            "image_id": image,
            "category_id": labels.index(thing.label) + 1,
            "bbox": [round(float(value), 3) for value in (x, y, width, height)],
            "area": round(float(width * height), 3),
            "iscrowd": 0,
            "segmentation": [],
            "thing": thing.id,
            "probability": thing.probability,
            "existence": thing.existence,
            "visibility": round(float(visibility), 4),
        }

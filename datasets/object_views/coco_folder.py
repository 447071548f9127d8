"""Ordinary images with boxes: a folder in the format of COCO (Lin et al. 2014).

    annotations.json, or any one *.json beside the images or in annotations/
    the images, by the `file_name` of the annotations: beside that file, in images/, or in the folder above it

The JSON holds `images` (id, file_name, width, height), `annotations` (image_id, category_id, bbox as x y w h from the
image's outer edges; iscrowd) and `categories` (id, name). Masks are not used: there is no depth to place a cut-out by.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..frame import BrokenFrame, Intrinsics
from ..images import read_color
from ..json_record import JsonRecord, read_json_record
from .object_view import BrokenView, ObjectView, ObjectViews, ViewEntry, cut_out

LAYOUT = "annotations.json in the format of COCO, or one such *.json, also in annotations/"
KEYS = (b'"images"', b'"annotations"', b'"categories"')
SMALLEST, THINNEST = 12.0, 3.0  # pixels of a box's longer and shorter side: smaller ones hardly fill a cell
FOCAL = 525.0 / 640.0  # of the longer side: nothing is known of the camera, so that of a Kinect is assumed
REMEDY = "export the annotations as COCO's object detection format"


@dataclass(frozen=True, slots=True, eq=False)
class CocoImage:
    """An image and its annotated boxes.

    Attributes:
        name: its `file_name` in the annotations.
        path: where it should be; that it is missing shows when it is read.
        size: width and height, pixels, as the JSON says.
        labels: (N,) category of each box.
        xyxy: (N, 4) float64 pixels, from the image's outer edges, cut to the image.
        crowd: (N,) bool, a box about several objects.
    """

    name: str
    path: Path
    size: tuple[int, int]
    labels: tuple[str, ...]
    xyxy: np.ndarray
    crowd: np.ndarray

    @property
    def focal(self) -> float:
        """Pixels, assumed."""
        return FOCAL * max(self.size)

    def read(self) -> np.ndarray:
        """(H, W, 3) uint8 RGB.

        Raises:
            BrokenView: the image is missing, damaged or of another size.
        """
        try:
            return read_color(self.name, self.path, Intrinsics(*self.size, self.focal, self.focal, 0.0, 0.0))
        except BrokenFrame as broken:
            raise BrokenView(f"{broken.problem.value} ({broken.detail}, looked for as {self.path})") from None


def coco_files(path: Path) -> list[Path]:
    """The annotation files at a path: itself, else those in the usual places of a folder."""
    if path.is_file():
        return [path] if path.suffix.lower() == ".json" and _has_keys(path) else []
    if (path / "annotations.json").is_file():
        return [path / "annotations.json"]
    places = [*sorted(path.glob("*.json")), *sorted(path.glob("annotations/*.json"))]
    return [file for file in places if _has_keys(file)]


def coco_views(path: Path) -> ObjectViews:
    """The boxes of a COCO folder, or of its JSON; those of crowds and tiny ones are skipped.

    Raises:
        InputError: no annotation file or several, or one that is not in COCO's format.
    """
    entries, skipped = [], {}
    last = lru_cache(maxsize=1)(CocoImage.read)  # boxes come image by image
    for image in coco_images(path):
        for k, (label, box) in enumerate(zip(image.labels, image.xyxy, strict=True)):
            name = f"{image.name} box {k}"
            width, height = box[2:] - box[:2]
            if image.crowd[k]:
                skipped[name] = "its box is about a crowd"
            elif not (max(width, height) >= SMALLEST and min(width, height) >= THINNEST):
                skipped[name] = f"its box is {width:.0f} x {height:.0f} pixels, too small"
            else:
                read = partial(_view, image, k, name, last)
                entries.append(ViewEntry(label, f"{label} in {image.name}", name, read))
    return ObjectViews(entries, skipped)


def coco_images(path: Path) -> tuple[CocoImage, ...]:
    """All images with their boxes, by id; errors as `coco_views`."""
    files = coco_files(path)
    if len(files) != 1:
        found = ", ".join(str(file) for file in files[:4]) or "none"
        raise InputError(path, LAYOUT, found, "give the one JSON file that is meant" if files else REMEDY)
    top = read_json_record(files[0], "annotations in COCO's format", REMEDY)
    labels = {item.count("id"): item.name("name") for item in top.records("categories")}
    boxes: dict[int, list[JsonRecord]] = {}
    for item in top.records("annotations"):
        boxes.setdefault(item.count("image_id"), []).append(item)
    images = {}
    for item in top.records("images"):
        number, size = item.count("id"), (item.count("width"), item.count("height"))
        if number in images:
            raise InputError(files[0], "images of different ids", f"{number} twice", REMEDY)
        images[number] = _image(files[0], item.name("file_name"), size, boxes.pop(number, []), labels)
    if boxes:
        found = f"annotations of image {min(boxes)}, which is not among them"
        raise InputError(files[0], "all annotated images in `images`", found, REMEDY)
    return tuple(images[number] for number in sorted(images))


def _image(
    file: Path, name: str, size: tuple[int, int], items: Iterable[JsonRecord], labels: dict[int, str]
) -> CocoImage:
    rows, names, crowd = [], [], []
    for item in items:
        category = item.count("category_id")
        if category not in labels:
            raise InputError(file, "categories of all annotations", f"no category {category}", REMEDY)
        x, y, width, height = item.array("bbox", (4,))
        rows.append((x, y, x + width, y + height))
        names.append(labels[category])
        crowd.append("iscrowd" in item and item.count("iscrowd") > 0)
    box = np.clip(np.array(rows, dtype=np.float64).reshape(-1, 4), 0.0, np.tile(np.array(size, dtype=np.float64), 2))
    return CocoImage(name, _image_place(file, name), size, tuple(names), box, np.array(crowd, dtype=bool))


def _image_place(file: Path, name: str) -> Path:
    """Where an image of that name is; beside the annotations where it is nowhere, for the error to name."""
    split = file.stem.removeprefix("instances_")  # annotations/instances_train2017.json is about train2017/
    folders = [file.parent, file.parent / "images", file.parent.parent, file.parent.parent / "images"]
    folders += [file.parent.parent / split, file.parent.parent / "images" / split]
    return next((folder / name for folder in folders if (folder / name).is_file()), file.parent / name)


def _view(image: CocoImage, k: int, name: str, read: Callable[[CocoImage], np.ndarray]) -> ObjectView:
    instance = f"{image.labels[k]} in {image.name}"
    return cut_out(ObjectView(image.labels[k], instance, name, read(image), None, None, image.xyxy[k], image.focal))


def _has_keys(path: Path) -> bool:
    """Whether a JSON file may hold annotations; a large one is not parsed for that."""
    if not path.is_file() or path.stat().st_size == 0:
        return False
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return all(content.find(key) >= 0 for key in KEYS)

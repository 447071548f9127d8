"""COCO: a list of results, or a dict with `images`, `categories` and `annotations`.

A result is `{"image_id", "category_id", "bbox": [x, y, w, h], "score"}`. Names of images and classes come from a COCO
dict: the file itself, the one that the option `images` gives, or `annotations.json` beside the results. Without one,
an `image_id` that is text is a frame's name and one that is a number its position in the sequence, from 0; category
ids are then those of COCO's own 80 classes, 1 to 90. COCO has only whole objects; a result of a half's template may add
its `part`, a number as in our own format.
"""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Hashable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..coco import COCO_CATEGORIES
from ..detections import Detections, Part
from ..detections_from import from_coco
from .reading import load_json
from .recording import Malformed, MatchedBy, ReadOptions, Recording, add_frame, frame_key, within

logger = logging.getLogger(__name__)

_SIBLING = "annotations.json"


def read_coco(content: list | dict, path: Path, options: ReadOptions) -> Recording:
    """Read COCO results or annotations; `options.images` may give the dict that results lack."""
    if isinstance(content, dict):
        return _with_images(content["annotations"], content)
    listing = Path(options.images) if options.images is not None else path.with_name(_SIBLING)
    if listing != path and (options.images is not None or listing.exists()):
        with within(f"together with {listing.name}"):
            return _with_images(content, load_json(listing))
    return _without_images(content, path)


def _with_images(results: list[dict], coco: dict[str, Any]) -> Recording:
    keys: dict[Hashable, str] = {}
    groups: dict[str, list[dict]] = {}
    sizes: dict[str, tuple[int, int]] = {}
    for i, image in enumerate(coco["images"]):
        with within(f"image {i}"):
            key = frame_key(image["file_name"])
            add_frame(groups, key, [])
            if image["id"] in keys:
                raise Malformed(f"two images with id {image['id']!r}")
            keys[image["id"]] = key
            if "width" in image and "height" in image:
                sizes[key] = (int(image["width"]), int(image["height"]))
    for i, result in enumerate(results):
        with within(f"annotation {i}"):
            if result["image_id"] not in keys:
                raise Malformed(f"image_id {result['image_id']!r} is not among the {len(keys)} images")
            groups[keys[result["image_id"]]].append(result)
    categories = sorted(coco["categories"], key=lambda category: category["id"])
    return Recording(_names(categories), _detections(groups.items(), categories), sizes=sizes)


def _without_images(results: list[dict], path: Path) -> Recording:
    groups: defaultdict[Any, list[dict]] = defaultdict(list)
    for i, result in enumerate(results):
        with within(f"result {i}"):
            image_id = result["image_id"]
            groups[frame_key(image_id) if isinstance(image_id, str) else int(image_id)].append(result)
    matched_by = MatchedBy.INDEX if any(isinstance(key, int) for key in groups) else MatchedBy.NAME
    if matched_by is MatchedBy.INDEX:
        if any(isinstance(key, str) for key in groups):
            raise Malformed("some image ids are names and some are numbers")
        logger.warning("%s: image ids are numbers and no images are listed: taken as positions from 0", path)
    return Recording(_names(COCO_CATEGORIES), _detections(groups.items(), COCO_CATEGORIES), matched_by)


def _names(categories: Iterable[dict]) -> tuple[str, ...]:
    return tuple(category["name"] for category in categories)


def _detections(groups: Iterable[tuple[Any, list[dict]]], categories: Any) -> dict[Any, Detections]:
    frames = {}
    for key, results in groups:
        with within(f"frame {key!r}"):
            part = [result.get("part", Part.WHOLE) for result in results]
            frames[key] = replace(from_coco(results, categories), part=part)  # type: ignore[arg-type]
    return frames

"""`Detections` from what other libraries hand out, read by field names: none of them is imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .class_names import in_order
from .coco import COCO_CATEGORIES
from .detections import Detections


def from_supervision(found: Any, classes: Sequence[str] | None = None) -> Detections:
    """From `supervision.Detections`: `xyxy`, `class_id`, `confidence`, `data["class_name"]` and `mask`.

    It knows the best class only and names only the classes it saw. A sequence needs the same classes in every
    frame, so give all of them; boxes are not clipped, see `Detections.clip`.

    Args:
        found: the detections of one image; without `confidence` every score is 1.
        classes: all K names. With class names in `data` they are looked up by name, otherwise `class_id` is the
            index. None takes the names in `data`, in the order of their ids.

    Raises:
        ValueError: for a class that `classes` lacks, or where neither names nor ids are known.
    """
    count = len(found.xyxy)
    names = (found.data or {}).get("class_name")
    if names is not None and len(names):
        names = [str(name) for name in names]
        classes = _names_by_id(names, found.class_id) if classes is None else classes
        class_id = np.array([_position(list(classes), name) for name in names])
    elif classes is not None and (found.class_id is not None or count == 0):
        class_id = found.class_id
    elif count == 0:
        return Detections.empty(())
    else:
        raise ValueError('supervision detections need class_id and, where data["class_name"] is absent, classes')
    confidence = np.ones(count) if found.confidence is None else found.confidence
    return Detections.from_best_class(classes, found.xyxy, class_id, confidence, found.mask)


def from_ultralytics(result: Any) -> Detections:
    """From one of `ultralytics`' `Results`: `boxes.xyxy`, `.conf`, `.cls`, `names` and `orig_shape`.

    It knows the best class only. Masks are taken where they are at the image's resolution (`retina_masks=True`).

    Raises:
        ValueError: for a result without boxes, or names that are not numbered 0..K-1.
    """
    if result.boxes is None:
        raise ValueError("ultralytics result has no boxes; use a detection or segmentation model")
    classes = in_order(result.names) if isinstance(result.names, dict) else list(result.names)
    height, width = (int(side) for side in result.orig_shape)
    masks = getattr(result, "masks", None)
    mask = None if masks is None else _array(masks.data).astype(bool)
    if mask is not None and mask.shape[1:] != (height, width):
        mask = None
    boxes = result.boxes
    found = Detections.from_best_class(classes, _array(boxes.xyxy), _array(boxes.cls), _array(boxes.conf), mask)
    return found.clip(width, height)


def from_coco(
    annotations: Sequence[Mapping[str, Any]], categories: Sequence[Mapping[str, Any]] | None = None
) -> Detections:
    """From the COCO results or annotations of one image: `bbox` (x, y, w, h in pixels), `category_id`, `score`.

    An annotation made by people has no score: it gets 1. Boxes are not clipped, see `Detections.clip`;
    `segmentation` is not read.

    Args:
        annotations: dicts, one a box.
        categories: dicts with `id` and `name`, in the order of the classes; None for COCO's own 80, whose ids run
            from 1 to 90.

    Raises:
        ValueError: for a box without four numbers or of negative size, or a category that is not in the list.
        KeyError: for an annotation without one of its fields.
    """
    categories = COCO_CATEGORIES if categories is None else categories
    ids = [category["id"] for category in categories]
    xywh = np.array([box_of_four(item["bbox"]) for item in annotations]).reshape(-1, 4)
    return Detections.from_best_class(
        [category["name"] for category in categories],
        np.concatenate([xywh[:, :2], xywh[:, :2] + xywh[:, 2:]], axis=1),
        [_position(ids, item["category_id"]) for item in annotations],
        [item.get("score", 1.0) for item in annotations],
    )


def box_of_four(box: Any) -> list[float]:
    """The four numbers of a box.

    Raises:
        ValueError: for anything else.
    """
    if not isinstance(box, list | tuple | np.ndarray) or len(box) != 4:
        raise ValueError(f"a box needs 4 numbers, but got {box!r}")
    return [float(value) for value in box]


def _position(known: list, wanted: Any) -> int:
    if wanted not in known:
        raise ValueError(f"class {wanted!r} is not among the {len(known)} known: {known}")
    return known.index(wanted)


def _names_by_id(names: list[str], class_id: Any) -> list[str]:
    """The distinct names, in the order of their ids; in order of appearance where there are none."""
    ids = range(len(names)) if class_id is None else class_id
    first_id = {name: int(id_) for id_, name in reversed(list(zip(ids, names, strict=True)))}
    return sorted(first_id, key=lambda name: first_id[name])


def _array(tensor: Any) -> np.ndarray:
    """A torch tensor, on whatever device, or anything array-like."""
    return np.asarray(tensor.cpu().numpy() if hasattr(tensor, "cpu") else tensor)

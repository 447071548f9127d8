"""Detections of other libraries, given as objects with their fields."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from thingmap.detectors.coco import COCO_80
from thingmap.detectors.detections import Detections


class Tensor:
    """As much of a torch tensor as is needed: on the device it is no array."""

    def __init__(self, values) -> None:
        self.values = np.asarray(values, dtype=np.float32)

    def cpu(self) -> SimpleNamespace:
        return SimpleNamespace(numpy=lambda: self.values)


def of_supervision(names: list[str] | None, **change) -> SimpleNamespace:
    fields = {
        "xyxy": np.array([[0, 0, 4, 4], [1, 1, 5, 6]], dtype=np.float32),
        "confidence": np.array([0.5, 0.25], dtype=np.float32),
        "class_id": np.array([7, 2]),
        "mask": np.ones((2, 6, 8), dtype=bool),
        "data": {} if names is None else {"class_name": np.array(names)},
    }
    return SimpleNamespace(**(fields | change))


def test_supervision_by_name():
    found = Detections.from_supervision(of_supervision(["dog", "cup"]), ("cup", "cat", "dog"))
    assert found.classes == ("cup", "cat", "dog") and found.class_id.tolist() == [2, 0]
    assert found.confidence.tolist() == [0.5, 0.25] and np.isnan(found.scores).sum() == 4
    assert found.mask is not None and found.mask.shape == (2, 6, 8)


def test_supervision_names_alone_are_ordered_by_id():
    found = Detections.from_supervision(of_supervision(["dog", "cup"]))
    assert found.classes == ("cup", "dog") and found.class_id.tolist() == [1, 0]


def test_supervision_by_id_and_without_confidence():
    found = Detections.from_supervision(of_supervision(None, confidence=None), COCO_80)
    assert [COCO_80[k] for k in found.class_id] == ["truck", "car"]
    assert found.confidence.tolist() == [1.0, 1.0]


def test_supervision_that_says_too_little():
    with pytest.raises(ValueError, match="class_name"):
        Detections.from_supervision(of_supervision(None))
    with pytest.raises(ValueError, match="'dog' is not among the 1 known"):
        Detections.from_supervision(of_supervision(["dog", "cup"]), ("cup",))
    nothing = of_supervision(None, xyxy=np.zeros((0, 4)), class_id=None, confidence=None, mask=None)
    assert Detections.from_supervision(nothing, ("cup",)).scores.shape == (0, 1)
    assert Detections.from_supervision(nothing).classes == ()


def of_ultralytics(**change) -> SimpleNamespace:
    boxes = SimpleNamespace(xyxy=Tensor([[-3, 1, 4, 4], [2, 2, 9, 7]]), conf=Tensor([0.75, 0.5]), cls=Tensor([1, 0]))
    fields = {"boxes": boxes, "names": {0: "cup", 1: "dog"}, "orig_shape": (6, 8), "masks": None}
    return SimpleNamespace(**(fields | change))


def test_ultralytics():
    found = Detections.from_ultralytics(of_ultralytics())
    assert found.classes == ("cup", "dog") and found.class_id.tolist() == [1, 0]
    assert found.xyxy.tolist() == [[0, 1, 4, 4], [2, 2, 8, 6]]
    assert found.confidence.tolist() == [0.75, 0.5] and found.mask is None


def test_ultralytics_masks_only_at_image_size():
    full, small = (SimpleNamespace(data=Tensor(np.ones((2, *size)))) for size in ((6, 8), (3, 4)))
    mask = Detections.from_ultralytics(of_ultralytics(masks=full)).mask
    assert mask is not None and mask.dtype == bool and mask.all()
    assert Detections.from_ultralytics(of_ultralytics(masks=small)).mask is None


def test_ultralytics_that_says_too_little():
    with pytest.raises(ValueError, match="no boxes"):
        Detections.from_ultralytics(of_ultralytics(boxes=None))
    with pytest.raises(ValueError, match=r"class numbers \[1, 2\] instead of 0..1"):
        Detections.from_ultralytics(of_ultralytics(names={1: "cup", 2: "dog"}))


def test_coco_with_its_own_ids():
    results = [
        {"image_id": 1, "category_id": 47, "bbox": [10, 20, 5, 6], "score": 0.5},
        {"image_id": 1, "category_id": 90, "bbox": [0, 0, 1, 1]},
    ]
    found = Detections.from_coco(results)
    assert found.classes == COCO_80
    assert [COCO_80[k] for k in found.class_id] == ["cup", "toothbrush"]
    assert found.xyxy.tolist() == [[10, 20, 15, 26], [0, 0, 1, 1]]
    assert found.confidence.tolist() == [0.5, 1.0]


def test_coco_with_other_categories():
    categories = [{"id": 5, "name": "mug"}, {"id": 9, "name": "bowl"}]
    found = Detections.from_coco([{"category_id": 9, "bbox": [0, 0, 1, 1], "score": 0.1}], categories)
    assert found.classes == ("mug", "bowl") and found.class_id.tolist() == [1]
    assert len(Detections.from_coco([], categories)) == 0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"category_id": 12, "bbox": [0, 0, 1, 1]}, "class 12 is not among the 80 known"),
        ({"category_id": 1, "bbox": [0, 0, 1]}, r"a box needs 4 numbers, but got \[0, 0, 1\]"),
        ({"category_id": 1, "bbox": [5, 0, -1, 1]}, "x1 <= x2"),
        ({"category_id": 1, "bbox": [0, 0, 1, 1], "score": 1.5}, "but got 1.5"),
    ],
)
def test_coco_that_is_wrong(wrong: dict, message: str):
    with pytest.raises(ValueError, match=message):
        Detections.from_coco([wrong])

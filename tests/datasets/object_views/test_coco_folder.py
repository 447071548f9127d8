"""Images with boxes in the format of COCO."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.object_views.coco_folder import coco_images, coco_views


def _annotation(image: int, category: int, bbox: list[float], **more: Any) -> dict[str, Any]:
    return {"id": 1, "image_id": image, "category_id": category, "bbox": bbox, "iscrowd": 0, **more}


def _record() -> dict[str, Any]:
    return {
        "images": [{"id": 7, "file_name": "b.png", "width": 200, "height": 100}],
        "categories": [{"id": 3, "name": "cup"}, {"id": 9, "name": "dog"}],
        "annotations": [_annotation(7, 9, [50, 20, 60, 40]), _annotation(7, 3, [10, 10, 20.5, 30])],
    }


def _write(folder: Path, record: dict[str, Any], place: str = "annotations.json", images: str = "") -> np.ndarray:
    color = np.random.default_rng(0).integers(0, 256, (100, 200, 3), dtype=np.uint8)
    (folder / images).mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / images / "b.png"), color[..., ::-1])
    (folder / place).parent.mkdir(parents=True, exist_ok=True)
    (folder / place).write_text(json.dumps(record))
    return color


def test_boxes_show_the_pixels_they_are_about(tmp_path: Path) -> None:
    color = _write(tmp_path, _record())
    views = coco_views(tmp_path)
    dog, cup = views
    assert views.labels == ("cup", "dog") and not views.skipped
    assert (dog.label, dog.depth, dog.mask) == ("dog", None, None)
    x0, y0, x1, y1 = dog.xyxy.astype(int)
    assert np.array_equal(dog.color[y0:y1, x0:x1], color[20:60, 50:110])
    assert (cup.xyxy[2:] - cup.xyxy[:2]).tolist() == [20.5, 30]
    assert cup.focal == pytest.approx(525 / 640 * 200)


@pytest.mark.parametrize(
    ("place", "images"),
    [
        ("labels.json", ""),
        ("annotations/instances_train2017.json", "train2017"),
        ("annotations/all.json", "images"),
        ("annotations.json", "images"),
    ],
)
def test_the_usual_places_are_found(tmp_path: Path, place: str, images: str) -> None:
    _write(tmp_path, _record(), place, images)
    (tmp_path / "package.json").write_text('{"name": "something else"}')
    assert len(list(coco_views(tmp_path))) == len(list(coco_views(tmp_path / place))) == 2


def test_crowds_tiny_boxes_and_missing_images_are_counted_and_named(tmp_path: Path) -> None:
    record = _record()
    record["images"] += [{"id": 8, "file_name": "lost.png", "width": 200, "height": 100}]
    record["annotations"] += [
        _annotation(7, 3, [0, 0, 50, 50], iscrowd=1),
        _annotation(7, 3, [0, 0, 8, 8]),
        _annotation(7, 3, [190, 20, 300, 1]),
        _annotation(8, 3, [0, 0, 50, 50]),
    ]
    _write(tmp_path, record)
    views = coco_views(tmp_path)
    assert len(list(views)) == 2 and len(views) == 3
    assert "crowd" in views.skipped["b.png box 2"]
    assert "8 x 8" in views.skipped["b.png box 3"] and "10 x 1" in views.skipped["b.png box 4"]
    assert "missing" in views.skipped["lost.png box 0"]


def test_an_image_of_another_size_is_not_used(tmp_path: Path) -> None:
    record = _record()
    record["images"][0]["width"] = 300
    _write(tmp_path, record)
    views = coco_views(tmp_path)
    assert list(views) == [] and "200 x 100" in views.skipped["b.png box 0"]


def test_boxes_are_cut_to_the_image(tmp_path: Path) -> None:
    record = _record()
    record["annotations"] = [_annotation(7, 3, [-20, 50, 60, 80])]
    _write(tmp_path, record)
    (image,) = coco_images(tmp_path)
    assert image.xyxy.tolist() == [[0, 50, 40, 100]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"annotations": [_annotation(7, 4, [0, 0, 20, 20])]}, "no category 4"),
        ({"annotations": [_annotation(6, 3, [0, 0, 20, 20])]}, "image 6"),
        ({"annotations": [_annotation(7, 3, [0, 0, 20])]}, "bbox"),
        ({"images": _record()["images"] * 2}, "7 twice"),
        ({"categories": "none"}, "a list"),
    ],
)
def test_what_is_no_coco_is_an_error(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    _write(tmp_path, _record() | change)
    with pytest.raises(InputError, match=words):
        coco_views(tmp_path)


def test_several_annotation_files_are_an_error(tmp_path: Path) -> None:
    _write(tmp_path, _record(), "a.json")
    _write(tmp_path, _record(), "b.json")
    with pytest.raises(InputError, match=r"a\.json.*b\.json"):
        coco_views(tmp_path)

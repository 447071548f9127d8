"""The HOG benchmark on recorded images: which known objects a frame should show, and which boxes show them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import hog_real
import numpy as np
import pytest
from hog_real_truth import KnownPoint, is_in_view, judge, known_in_frame, read_seen, shows

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.truth import TrueObject
from thingmap.detectors.detections import Detections, Part

CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)


def found(*boxes: tuple[str, float, list[float]], part: Part = Part.WHOLE) -> Detections:
    classes = hog_real.CLASSES
    xyxy = [box for *_, box in boxes]
    ids = [classes.index(label) for label, *_ in boxes]
    one = Detections.from_best_class(classes, xyxy, ids, [score for _, score, _ in boxes])
    return replace(one, part=np.full(len(one), part))


def test_boxes_count_once_and_by_class_place_and_size() -> None:
    mug = KnownPoint("coffee mug", np.array([100.0, 100.0]), 20.0, 40.0)
    on = [80.0, 80.0, 120.0, 120.0]
    assert shows(np.array(on), "coffee mug", mug) and not shows(np.array(on), "bowl", mug)
    assert not shows(np.array(on) + 30.0, "coffee mug", mug)
    assert not shows(np.array([0.0, 0.0, 200.0, 200.0]), "coffee mug", mug)
    assert shows(np.array([0.0, 0.0, 200.0, 200.0]), "coffee mug", replace_known(mug))
    boxes = found(("coffee mug", 0.9, on), ("coffee mug", 0.8, on), ("bowl", 0.7, on), ("bowl", 0.2, on))
    verdict = judge([boxes, found(("cap", 0.9, on), part=Part.TOP)], [[mug], [mug]], 0.5, hog_real.CLASSES)
    assert (verdict.images, verdict.known, verdict.hits) == (2, 2, 1)
    assert {label: count for label, count in verdict.false.items() if count} == {"coffee mug": 1, "bowl": 1}


def replace_known(point: KnownPoint) -> KnownPoint:
    """As somebody would name it by looking: no distance, no size."""
    return KnownPoint(point.label, point.xy)


def test_a_known_object_is_asked_for_where_it_can_be_seen() -> None:
    thing = TrueObject(0, "cup", np.array([0.1, 0.0, 2.0]), np.full(3, np.nan), 0.0)
    truth = GroundTruth("kitchen", ("cup",), (thing,), tolerance={0: 0.08})
    depth = np.full((480, 640), 2.0, dtype=np.float32)
    frame = Frame(0, "0", 0.0, np.zeros((480, 640, 3), dtype=np.uint8), depth, CAMERA, np.eye(4))
    (point,) = known_in_frame(frame, truth, hog_real.CLASSES)
    assert point.label == "coffee mug" and point.reach == pytest.approx(20.0) and point.side == pytest.approx(25.0)
    np.testing.assert_allclose(point.xy, [344.5, 239.5])
    assert known_in_frame(frame, truth, ("bowl",)) == []
    assert known_in_frame(replace(frame, depth=depth - 0.5), truth, hog_real.CLASSES) == []
    assert len(known_in_frame(replace(frame, depth=depth * 0.0), truth, hog_real.CLASSES)) == 1
    away = np.diag([-1.0, 1.0, -1.0, 1.0])
    assert known_in_frame(replace(frame, T_world_camera=away), truth, hog_real.CLASSES) == []
    assert is_in_view(np.eye(4), CAMERA, truth, hog_real.CLASSES)
    assert not is_in_view(away, CAMERA, truth, hog_real.CLASSES)
    assert not is_in_view(np.eye(4), CAMERA, truth, ("bowl",))


def test_what_somebody_saw_is_read(tmp_path: Path) -> None:
    file = tmp_path / "seen.json"
    file.write_text(json.dumps({"scene_02": {"mug": [[10, 20]], "bowl": []}, "scene_05": {}}))
    seen = read_seen(file)
    assert [point.label for point in seen["scene_02"]] == ["coffee mug"] and seen["scene_05"] == []
    file.write_text('{"scene_02": [1, 2]}')
    with pytest.raises(InputError):
        read_seen(file)
    with pytest.raises(InputError):
        read_seen(tmp_path / "none.json")


def test_only_known_classes_are_learned_from_real_objects(
    real_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hog_real, "ROOMS", ())
    views, backgrounds = hog_real.material(real_data, tmp_path)
    assert set(views.labels) == set(hog_real.CLASSES)
    box = next(entry for entry in views.entries if "cracker" in entry.instance)
    assert entry_label(box) == "cereal box"
    kitchen = [int(name.split("-")[-1]) for name in backgrounds.names if name.startswith("redkitchen")]
    assert len(kitchen) > 5 and not any(number % hog_real.STEP == 0 for number in kitchen)


def entry_label(entry) -> str:
    assert entry.label == entry.read().label
    return entry.label

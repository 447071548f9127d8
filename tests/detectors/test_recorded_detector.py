"""Finding the format, and what all formats share."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError, UserError
from thingmap.detectors.detections import Detections
from thingmap.detectors.recorded import RecordedDetections, write_detections


@pytest.fixture
def recorded(tmp_path: Path) -> RecordedDetections:
    """Frames a and b; one box of b reaches over the image, one lies outside it."""
    boxes = np.array([[-5.0, 40.0, 10.0, 60.0], [70.0, 0.0, 90.0, 9.0]])
    found = Detections.from_best_class(("cup",), boxes, [0, 0], [0.5, 0.25])
    write_detections(tmp_path / "found.json", ("cup",), [("a", found.select([])), ("b", found)])
    return RecordedDetections(tmp_path / "found.json")


def test_boxes_are_cut_and_counted_once(recorded: RecordedDetections, make_frame):
    for _ in range(2):
        found = recorded(make_frame("b"))
        assert found.xyxy.tolist() == [[0, 40, 10, 48]] and found.confidence.tolist() == [0.5]
    assert recorded.dropped == 1


def test_missing_frames_are_named_once_in_order(recorded: RecordedDetections, make_frame):
    for name in ("z", "a", "y", "z"):
        found = recorded(make_frame(name))
        assert len(found) == 0 and found.classes == ("cup",)
    assert recorded.missing == ("z", "y")


def test_a_file_of_another_sequence(recorded: RecordedDetections):
    recorded.check_against(iter(["x", "b.color"]))
    with pytest.raises(InputError, match="expected detections of frames such as 'x', found 2 frames such as 'a'"):
        recorded.check_against(["x", "y"])
    with pytest.raises(InputError, match="an empty sequence"):
        recorded.check_against([])


def test_a_file_without_frames(tmp_path: Path):
    write_detections(tmp_path / "found.json", ("cup",), [])
    with pytest.raises(InputError, match="found 0 frames"):
        RecordedDetections(tmp_path / "found.json").check_against(["a"])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "expected JSON, found line 1: Expecting value"),
        ('[\n{"image_id": 1,\n', "expected JSON, found line 3"),
        ("[]", "found an empty list"),
        ("3", "found one value"),
        ("[1, 2]", "found a list"),
        ('{"boxes": [], "labels": []}', "found an object with boxes, labels"),
        ('[{"file": "a.png", "objects": []}]', "found a list with file, objects"),
    ],
)
def test_files_of_no_known_format(tmp_path: Path, content: str, message: str):
    path = tmp_path / "a.json"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        RecordedDetections(path)


def test_paths_that_do_not_fit(tmp_path: Path):
    with pytest.raises(InputError, match="no such file or folder"):
        RecordedDetections(tmp_path / "no.json")
    with pytest.raises(InputError, match="expected a file for format coco, found a folder"):
        RecordedDetections(tmp_path, "coco")
    path = tmp_path / "a.json"
    path.write_text("[]")
    with pytest.raises(InputError, match="expected a folder for format yolo, found a file"):
        RecordedDetections(path, "yolo")
    path.write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff")
    with pytest.raises(InputError, match="a JSON file"):
        RecordedDetections(path)


def test_a_format_that_is_asked_for_is_not_guessed(tmp_path: Path):
    path = tmp_path / "a.json"
    path.write_text(json.dumps([{"image_id": "a", "category_id": 1, "bbox": [0, 0, 1, 1], "score": 0.5}]))
    with pytest.raises(InputError, match="detections in format oaslam, found frame 0: no 'detections'"):
        RecordedDetections(path, "oaslam")
    with pytest.raises(InputError, match="detections in format thingmap"):
        RecordedDetections(path, "thingmap")
    with pytest.raises(UserError, match="format must be one of thingmap, coco, oaslam, yolo, boxes, but is 'voc'"):
        RecordedDetections(path, "voc")


def test_options_without_use_are_refused(tmp_path: Path):
    path = tmp_path / "a.json"
    path.write_text(json.dumps([{"image_id": "a", "category_id": 1, "bbox": [0, 0, 1, 1], "score": 0.5}]))
    with pytest.raises(UserError, match="format coco has no use for label, names; it takes images"):
        RecordedDetections(path, label="cup", names=("cup",))


# Anything that could stand in such a file, at any place.
_values = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 90), st.just(10**400), st.floats(), st.text(max_size=3), st.just("a.png")
)
_keys = st.sampled_from(
    [
        *("format", "classes", "frames", "name", "xyxy", "scores", "part", "mask", "embedding", "size", "counts"),
        *("values", "images", "categories", "annotations", "id", "file_name", "width", "height", "image_id"),
        *("category_id", "bbox", "score", "detections", "detection_score"),
    ]
)
_json = st.recursive(_values, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_keys, inner, max_size=6))


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(_json, st.sampled_from([None, "thingmap", "coco", "oaslam"]))
@example([{"image_id": "a", "category_id": 10**400, "bbox": [0, 0, 1, 1]}], "coco")
@example([{"file_name": "a", "detections": [{"category_id": 0, "detection_score": 10**400, "bbox": [0] * 4}]}], None)
def test_whatever_the_file_holds_there_is_no_other_error(tmp_path: Path, content, format):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    try:
        RecordedDetections(path, format)
    except InputError as error:
        assert str(path) in str(error)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.fixed_dictionaries({}, optional=dict.fromkeys(("name", "xyxy", "scores", "part", "mask", "embedding"), _json))
)
@example({"mask": {"size": [-2, -2], "counts": [[4]]}})
@example({"mask": {"size": [2, 2], "counts": [[2.5, 1.5]]}})
def test_our_own_format_neither(tmp_path: Path, make_frame, change: dict):
    frame = {"name": "a", "xyxy": [[0, 0, 1, 1]], "scores": [[0.5, 0.25]]} | change
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"format": "thingmap-detections/1", "classes": ["b", "c"], "frames": [frame]}))
    try:
        RecordedDetections(path)(make_frame("a"))
    except InputError as error:
        assert str(path) in str(error)

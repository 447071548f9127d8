"""Networks from end to end, hand-made ones and YOLOX-nano."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.coco import COCO_80
from thingmap.detectors.onnx import OnnxDetector

# A 64 x 64 input has 64 + 16 + 4 cells.
CELLS = 84


def yolov8(*columns: tuple[int, list[float]]) -> np.ndarray:
    """An output of two classes with features at the given cells."""
    output = np.zeros((1, 6, CELLS))
    for cell, features in columns:
        output[0, :, cell] = features
    return output


def yolox(*rows: tuple[int, list[float]]) -> np.ndarray:
    """An output of two classes with features at the given cells."""
    output = np.zeros((1, CELLS, 7))
    for cell, features in rows:
        output[0, cell] = features
    return output


def test_yolov8_boxes_come_back_to_the_image(write_onnx, make_frame):
    path = write_onnx(yolov8((5, [32, 32, 16, 8, 0.25, 0.5]), (9, [2, 32, 16, 8, 0.75, 0.125])))
    found = OnnxDetector(path, ("cup", "dog"), backend="opencv")(make_frame(size=(64, 48)))
    # The image is 64 x 48 at offset (0, 8); the box at the border is cut.
    np.testing.assert_allclose(found.xyxy, [[0, 20, 10, 28], [24, 20, 40, 28]], atol=1e-4)
    np.testing.assert_allclose(found.scores, [[0.75, 0.125], [0.25, 0.5]])
    assert found.classes == ("cup", "dog")


def test_yolov8_sees_red_green_blue_from_0_to_1(write_onnx, make_frame):
    by_color = np.zeros((6, 3))
    by_color[4, 0] = by_color[5, 2] = 1.0
    path = write_onnx(yolov8((5, [32, 32, 16, 8, 0, 0])), by_color)
    found = OnnxDetector(path, ("red", "blue"), backend="opencv")(make_frame(size=(64, 64), rgb=(204, 255, 51)))
    # The other cells have the scores too, but boxes without any area.
    np.testing.assert_allclose(found.scores, [[0.8, 0.2]], atol=1e-3)


def test_yolox_sees_blue_green_red_from_0_to_255(write_onnx, make_frame):
    # Objectness 1 and the class scores 1/255 of the first and the last channel, at the cell (4, 4) of stride 8.
    by_color = np.zeros((7, 3))
    by_color[5, 0] = by_color[6, 2] = 1 / 255
    path = write_onnx(yolox((36, [0, 0, np.log(2), 0, 1, 0, 0])), by_color)
    found = OnnxDetector(path, ("first", "last"), backend="opencv")(make_frame(size=(128, 128), rgb=(204, 255, 51)))
    np.testing.assert_allclose(found.xyxy, [[48, 56, 80, 72]], atol=1e-4)
    np.testing.assert_allclose(found.scores, [[0.2, 0.8]], atol=1e-3)


def test_yolox_decoded_has_to_be_asked_for(write_onnx, make_frame):
    path = write_onnx(yolox((36, [32, 16, 8, 4, 1, 0.5, 0.25])))
    found = OnnxDetector(path, ("a", "b"), family="yolox-decoded", backend="opencv")(make_frame(size=(64, 64)))
    np.testing.assert_allclose(found.xyxy, [[28, 14, 36, 18]], atol=1e-4)


def test_one_box_an_object_with_its_whole_score_vector(write_onnx, make_frame):
    cells = [(5, [32, 32, 16, 16, 0.75, 0.5]), (6, [33, 32, 16, 16, 0.25, 0.625]), (7, [10, 10, 4, 4, 0.25, 0.0])]
    path = write_onnx(yolov8(*cells))
    frame = make_frame(size=(64, 64))
    found = OnnxDetector(path, ("a", "b"), backend="opencv")(frame)
    np.testing.assert_allclose(found.scores, [[0.75, 0.5], [0.25, 0.0]])
    assert len(OnnxDetector(path, ("a", "b"), nms_iou=0.95, backend="opencv")(frame)) == 3
    assert len(OnnxDetector(path, ("a", "b"), confidence=0.3, backend="opencv")(frame)) == 1
    assert len(OnnxDetector(path, ("a", "b"), max_detections=1, backend="opencv")(frame)) == 1
    assert len(OnnxDetector(path, ("a", "b"), confidence=0.8, backend="opencv")(frame)) == 0


def test_half_precision_and_open_input(write_onnx, make_frame):
    path = write_onnx(yolov8((5, [32, 32, 16, 8, 0.25, 0.5])), input_shape=(1, 3, "h", "w"), dtype="float16")
    found = OnnxDetector(path, ("a", "b"), input_size=(64, 64), backend="opencv")(make_frame(size=(64, 64)))
    np.testing.assert_allclose(found.xyxy, [[24, 28, 40, 36]], atol=1e-3)
    # With the default of 640 x 640 the 84 columns are of no family.
    with pytest.raises(InputError, match=r"for a 640x640 input.*found shapes \(1, 6, 84\)"):
        OnnxDetector(path, ("a", "b"), backend="opencv")


def test_names_from_the_model_a_file_or_coco(write_onnx, tmp_path: Path):
    stored = write_onnx(yolov8(), metadata={"names": "{0: 'mug', 1: 'bowl'}"}, name="stored.onnx")
    assert OnnxDetector(stored, backend="opencv").classes == ("mug", "bowl")
    names = tmp_path / "names.txt"
    names.write_text("tasse\nschale\n")
    assert OnnxDetector(stored, names, backend="opencv").classes == ("tasse", "schale")
    coco = write_onnx(np.zeros((1, 84, CELLS)), name="coco.onnx")
    assert OnnxDetector(coco, backend="opencv").classes == COCO_80


def test_what_does_not_fit_is_said(write_onnx, tmp_path: Path):
    path = write_onnx(yolov8())
    with pytest.raises(InputError, match=r"expected 80 classes, one a name, found 2 in its output \(1, 6, 84\)"):
        OnnxDetector(path, backend="opencv")
    with pytest.raises(InputError, match=r"expected an output of yolox, found \(1, 6, 84\), which is yolov8's"):
        OnnxDetector(path, ("a", "b"), family="yolox", backend="opencv")
    with pytest.raises(InputError, match="expected an input of 96x96, found 64x64"):
        OnnxDetector(path, ("a", "b"), input_size=(96, 96), backend="opencv")
    odd = write_onnx(yolov8(), input_shape=(1, 3, 60, 64), name="odd.onnx")
    with pytest.raises(InputError, match="multiples of 32, found 64x60"):
        OnnxDetector(odd, ("a", "b"), backend="opencv")
    after_nms = write_onnx(np.zeros((1, 300, 6)), name="nms.onnx")
    with pytest.raises(InputError, match=r"found shapes \(1, 300, 6\); export without non-maximum"):
        OnnxDetector(after_nms, ("a", "b"), backend="opencv")
    junk = tmp_path / "junk.onnx"
    junk.write_bytes(path.read_bytes().replace(b"GlobalAveragePool", b"NoSuchOperatorYet"))
    with pytest.raises(InputError, match="expected a network that OpenCV can run"):
        OnnxDetector(junk, ("a", "b"), backend="opencv")


def test_scores_that_are_logits_are_refused(write_onnx, make_frame):
    detector = OnnxDetector(write_onnx(yolov8((5, [32, 32, 16, 8, 7.5, 0.5]))), ("a", "b"), backend="opencv")
    with pytest.raises(InputError, match=r"scores in \[0, 1\], found up to 7.5"):
        detector(make_frame(size=(64, 64)))


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"confidence": 1.5}, r"confidence must be in \[0, 1\], but is 1.5"),
        ({"nms_iou": -1}, "nms_iou must be"),
        ({"max_detections": 0}, "at least 1"),
        ({"backend": "torch"}, "backend must be one of auto, opencv, onnxruntime, but is 'torch'"),
        ({"family": "ssd"}, "family must be one of yolox,"),
    ],
)
def test_options_out_of_range(write_onnx, option: dict, message: str):
    with pytest.raises(UserError, match=message):
        OnnxDetector(write_onnx(yolov8()), ("a", "b"), **option)


@pytest.mark.skipif(find_spec("onnxruntime") is not None, reason="onnxruntime is installed")
def test_onnxruntime_asked_for_and_absent(write_onnx):
    with pytest.raises(UserError, match=r'onnxruntime is not installed; .*pip install ".+\[onnxruntime\]"'):
        OnnxDetector(write_onnx(yolov8()), ("a", "b"), backend="onnxruntime")
    assert OnnxDetector(write_onnx(yolov8()), ("a", "b"), backend="auto").classes == ("a", "b")


@pytest.mark.skipif(find_spec("onnxruntime") is None, reason="onnxruntime is not installed")
def test_both_backends_agree(write_onnx, make_frame):
    path = write_onnx(yolov8((5, [32, 32, 16, 8, 0.25, 0.5])))
    one, other = (OnnxDetector(path, ("a", "b"), backend=b)(make_frame()) for b in ("opencv", "onnxruntime"))
    np.testing.assert_allclose(one.xyxy, other.xyxy, atol=1e-3)
    np.testing.assert_allclose(one.scores, other.scores, atol=1e-5)


@pytest.fixture(scope="module")
def kitchen(real_data: Path) -> list[Frame]:
    """Six frames of a kitchen with mugs, chairs and books."""
    intrinsics = Intrinsics(640, 480, 585.0, 585.0, 320.0, 240.0)
    paths = sorted((real_data / "redkitchen").glob("*.color.jpg"))[::100]
    colors = [cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in paths]
    depth = np.zeros((480, 640), dtype=np.float32)
    return [Frame(i, p.stem, i / 30, c, depth, intrinsics) for i, (p, c) in enumerate(zip(paths, colors, strict=True))]


def test_yolox_nano_in_a_kitchen(real_data: Path, kitchen: list[Frame], assert_same):
    path = real_data / "detectors" / "yolox_nano.onnx"
    detector = OnnxDetector(path, backend="opencv")
    found = [detector(frame) for frame in kitchen]
    seen = {COCO_80[k] for d in found for k in d.class_id[d.confidence > 0.4]}
    assert {"cup", "chair"} <= seen
    assert {"book"} <= {COCO_80[k] for d in found for k in d.class_id[d.confidence > 0.25]}
    assert all(d.scores.shape == (len(d), 80) and not np.isnan(d.scores).any() for d in found)
    assert all((d.xyxy[:, 2:] <= [640, 480]).all() and (d.xyxy >= 0).all() for d in found)
    # The mug on the table of the first frame.
    cup = found[0].select(found[0].class_id == COCO_80.index("cup"))
    np.testing.assert_allclose(cup.xyxy[0], [366, 164, 403, 202], atol=3)
    # Another detector and a second call give the same to the bit.
    for frame, first in zip(kitchen, found, strict=True):
        assert_same(detector(frame), first)
    assert_same(OnnxDetector(path, backend="opencv")(kitchen[0]), found[0])

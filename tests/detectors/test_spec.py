"""Detectors by a line of text."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.views import subset
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.config import PyramidConfig
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.model import HogModel, HogTemplate
from thingmap.detectors.onnx import OnnxDetector
from thingmap.detectors.onnx.outputs import OutputFamily
from thingmap.detectors.proposals.detector import ProposalDetector
from thingmap.detectors.recorded import RecordedDetections, RecordedFormat, write_detections
from thingmap.detectors.shape_context.calibration import FEATURES, Calibration
from thingmap.detectors.shape_context.codebook import Codebook
from thingmap.detectors.shape_context.config import LENGTH, VotingConfig
from thingmap.detectors.shape_context.detector import ShapeContextDetector
from thingmap.detectors.shape_context.model import ShapeContextModel
from thingmap.detectors.simulated_config import SimulatedDetectorConfig
from thingmap.detectors.spec import make_detector


@pytest.fixture
def model(write_onnx, tmp_path: Path) -> Path:
    (tmp_path / "names.txt").write_text("cup\ndog\n")
    return write_onnx(np.zeros((1, 6, 84)), input_shape=(1, 3, "h", "w"))


def test_onnx_with_options(model: Path):
    spec = f"onnx:{model}?names={model.parent / 'names.txt'}&confidence=0.3&nms=0.6&max=7&backend=opencv&size=64x64"
    detector = make_detector(spec)
    assert isinstance(detector, OnnxDetector)
    assert detector.classes == ("cup", "dog") and detector.backend == "opencv"
    assert (detector.confidence, detector.nms_iou, detector.max_detections) == (0.3, 0.6, 7)
    assert make_detector(f"{model}?names={model.parent / 'names.txt'}&size=64&family=yolov8").family == (  # type: ignore[attr-defined]
        OutputFamily.YOLOV8.value
    )


def test_shape_context_with_options(tmp_path: Path, make_frame):
    book = Codebook(np.eye(2, LENGTH), np.zeros((2, 2)), np.ones((2, 2)), 0.1, 50.0, 5.0, 2e-3)
    certain = Calibration(np.ones((1, len(FEATURES))), np.zeros(1))
    file = tmp_path / "mugs.npz"
    ShapeContextModel(("mug",), (book,), {}, certain, VotingConfig(), {}).save(file)
    detector = make_detector(f"shape-context:{file}?confidence=0.3&max=7")
    assert isinstance(detector, ShapeContextDetector) and detector.classes == ("mug",)
    assert (detector.confidence, detector.max_detections) == (0.3, 7)
    assert len(detector(make_frame())) == 0
    assert isinstance(make_detector(str(file)), ShapeContextDetector)  # the file says what it is for


@pytest.fixture
def hog_model(tmp_path: Path) -> Path:
    whole, top = (
        HogTemplate(0, part, np.zeros((3, 3, 31)), 0.0, -9.0, (-1.0, 0.0), (0.0, 0.0, 1.0, 1.0))
        for part in (Part.WHOLE, Part.TOP)
    )
    HogModel(("mug",), Channels.RGB, (whole, top), PyramidConfig(), {}).save(tmp_path / "mugs.npz")
    return tmp_path / "mugs.npz"


def test_hog_with_options(hog_model: Path, make_frame):
    detector = make_detector(f"hog:{hog_model}?confidence=0.3&nms=0.6&max=7&parts=0&merge=0")
    assert isinstance(detector, HogDetector) and detector.classes == ("mug",)
    assert (detector.confidence, detector.nms_iou, detector.max_detections) == (0.3, 0.6, 7)
    assert not detector.parts and not detector.merge
    assert len(detector(make_frame())) == 0
    by_path = make_detector(str(hog_model))
    assert isinstance(by_path, HogDetector) and by_path.parts
    with pytest.raises(UserError, match=r"nms_iou must be in \[0, 1\], but is 2.0"):
        make_detector(f"{hog_model}?nms=2")


def test_hog_alone_is_the_shipped_model(hog_model: Path, monkeypatch):
    monkeypatch.setattr("thingmap.detectors.hog.detector.shipped_model", lambda: hog_model)
    for spec in ("hog", "hog:", "hog?confidence=0.2"):
        detector = make_detector(spec)
        assert isinstance(detector, HogDetector) and detector.classes == ("mug",)


def test_proposals_with_options(make_frame):
    detector = make_detector("proposals?confidence=0.4&max=7&edge=0")
    assert isinstance(detector, ProposalDetector) and detector.classes == ("unknown",)
    assert (detector.confidence, detector.max_detections, detector.edge) == (0.4, 7, False)
    assert len(detector(make_frame())) == 0
    with pytest.raises(UserError, match=r"confidence must be in \[0, 1\], but is 2.0"):
        make_detector("proposals?confidence=2")


def test_recorded(tmp_path: Path, make_frame):
    path = tmp_path / "found.json"
    found = Detections.from_best_class(("cup",), [[0, 0, 1, 1]], [0], [0.5])
    write_detections(path, ("cup",), [("a", found)])
    for spec in (f"recorded:{path}", str(path), f"recorded:{path}?format=thingmap"):
        assert len(make_detector(spec)(make_frame("a"))) == 1


class Frames:
    """As much of a sequence as choosing a detector takes."""

    name, intrinsics, poses, stamps, gravity = "frames", None, None, np.arange(10.0), None

    def __init__(self, *names: str) -> None:
        if names:
            self.names = names

    def __len__(self) -> int:
        return 10


def test_recorded_for_another_sequence(tmp_path: Path):
    path = tmp_path / "found.json"
    write_detections(path, ("cup",), [("a", Detections.empty(("cup",)))])
    make_detector(str(path), Frames("x", "a"))
    with pytest.raises(InputError, match="such as 'x', found 1 frames such as 'a'"):
        make_detector(str(path), Frames("x", "y"))  # type: ignore[arg-type]


def test_recorded_by_position_needs_every_frame(tmp_path: Path):
    path = tmp_path / "results.json"
    path.write_text('[{"image_id": 3, "category_id": 1, "bbox": [0, 0, 1, 1], "score": 0.5}]')
    frames: Any = Frames(*"abcdefgh")
    assert make_detector(str(path), subset(frames, max_frames=5))
    with pytest.raises(UserError, match="count all frames, but only some are used"):
        make_detector(str(path), subset(frames, stride=2))


def test_simulated_gets_the_sequence_and_the_options(monkeypatch):
    made = SimpleNamespace(SimulatedDetector=lambda *arguments: arguments)
    monkeypatch.setitem(sys.modules, "thingmap.detectors.simulated", made)
    frames: Any = Frames()
    with pytest.raises(UserError, match="needs a synthetic sequence"):
        make_detector("simulated", frames)
    frames.objects, frames.classes, frames.truth = (), (), lambda index: None
    assert make_detector("simulated?seed=3", frames) == (frames, SimulatedDetectorConfig(), 3)
    assert make_detector("simulated", frames) == (frames, SimulatedDetectorConfig(), 0)
    worse = make_detector("simulated?max_recall=0.5&background_spots=9", frames)
    assert worse == (frames, SimulatedDetectorConfig(max_recall=0.5, background_spots=9), 0)
    with pytest.raises(UserError, match="there is no option 'spot_score'"):
        make_detector("simulated?spot_score=1", frames)  # two numbers


def test_a_folder(tmp_path: Path):
    (tmp_path / "0_x.txt").write_text("0 0.5 0.5 1 1")
    for spec in (f"{tmp_path}", f"recorded:{tmp_path}"):
        detector = make_detector(spec)
        assert isinstance(detector, RecordedDetections) and detector.format is RecordedFormat.YOLO
    detector = make_detector(f"{tmp_path}?format=boxes&label=wall cabinet")
    assert isinstance(detector, RecordedDetections) and detector.classes == ("wall cabinet",)


def test_none(make_frame):
    assert len(make_detector("none")(make_frame())) == 0


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (
            "yolo:a.pt",
            "there is no 'yolo'; there are onnx:PATH, hog.*, recorded:PATH, simulated, none",
        ),
        ("a.pt", "there is no 'a.pt'; there are"),
        ("", "there is no ''; there are"),
        ("onnx", "give path, as in onnx:PATH"),
        ("onnx:", "give path, as in onnx:PATH"),
        ("none:a", "there is no path, as in none"),
        ("onnx:a.onnx?conf=0.1", "there is no option 'conf'; onnx has names, confidence, nms"),
        ("none?seed=1", "there is no option 'seed'; none has none"),
        ("hog?names=a.txt", "there is no option 'names'; hog has confidence, nms, max, parts, merge"),
        ("hog?parts=yes", "parts=yes is not 0 or 1"),
        ("proposals?nms=0.1", "there is no option 'nms'; proposals has confidence, max, edge"),
        ("proposals:a", "there is no path, as in proposals"),
        ("onnx:a.onnx?confidence=high", "confidence=high is not a number"),
        ("onnx:a.onnx?size=wide", "size=wide is not a size such as 640x480"),
        ("simulated?seed=x", "seed=x is not a whole number"),
        ("onnx:a.onnx?confidence", "options are name=value.*got 'confidence'"),
        ("onnx:a.onnx?nms=0.1&nms=0.2", "each once.*got 'nms=0.2'"),
        ("simulated", "needs a synthetic sequence"),
    ],
)
def test_lines_that_say_nothing_known(spec: str, message: str):
    with pytest.raises(UserError, match=message):
        make_detector(spec)


def test_files_that_are_not_there(tmp_path: Path):
    onnx, hog = (f"onnx:{tmp_path}/a.onnx", f"{tmp_path}/a.onnx"), (f"hog:{tmp_path}/a.npz", f"{tmp_path}/a.npz")
    for spec in (*onnx, *hog, f"recorded:{tmp_path}/a", f"{tmp_path}/a.json"):
        with pytest.raises(InputError, match="no such file"):
            make_detector(spec)

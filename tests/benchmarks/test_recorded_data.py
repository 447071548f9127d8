"""Both commands on a few frames of a real sequence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from real_sequence import beside_truth
from real_sequence import main as compare
from real_sequence_report import Track
from throughput import main as measure
from whole_loop import record

from thingmap.datasets.open import open_sequence


@pytest.fixture(scope="module")
def kitchen(real_data: Path) -> Path:
    return real_data / "redkitchen"


@pytest.fixture(scope="module")
def detections(kitchen: Path, real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "detections.json"
    record(open_sequence(kitchen, max_frames=12), f"onnx:{real_data}/detectors/yolox_nano.onnx", path)
    return path


def test_recording_has_every_frame(detections: Path) -> None:
    frames = json.loads(detections.read_text())["frames"]
    assert [frame["name"] for frame in frames] == [f"frame-{i:06d}" for i in range(12)]


def test_throughput_of_a_few_frames(kitchen: Path, detections: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--sequence", str(kitchen), "--detections", str(detections), "--max-frames", "12", "--laps", "2"]
    assert measure([*options, "--keyframes"]) == 0
    printed = capsys.readouterr().out
    assert "12 frames (0 skipped)" in printed
    assert "- smoothing" in printed
    assert "| 48 " in printed  # frames of two laps
    assert str(kitchen) not in printed


def test_comparison_of_a_few_frames(kitchen: Path, detections: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--sequence", str(kitchen), "--detector", f"recorded:{detections}", "--max-frames", "12"]
    assert compare(options) == 1  # 12 frames do not show all objects
    printed = capsys.readouterr().out
    assert "12 of 12 frames" in printed
    assert "MISSING" in printed
    assert "patterned mug" in printed


def test_a_wrong_objects_file_is_told(kitchen: Path, detections: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--sequence", str(kitchen), "--detector", f"recorded:{detections}", "--objects", str(detections)]
    assert compare(options) == 2
    assert "objects" in capsys.readouterr().err


def test_the_truth_itself_has_no_error(kitchen: Path) -> None:
    sequence = open_sequence(kitchen, max_frames=30)
    assert sequence.poses is not None
    track = beside_truth((sequence.stamps[5:], sequence.poses[5:]), sequence)
    assert isinstance(track, Track)
    assert len(track.truth) == 25
    np.testing.assert_allclose(track.errors(), 0.0, atol=1e-9)

"""A run through all protocols: what is answered, what is skipped and why, and which detector is under test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.truth import FrameTruth, TrueObject
from thingmap.mapper.evaluation import evaluate as module
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.evaluate import PROTOCOLS, choose_detections, evaluate_run
from thingmap.mapper.evaluation.result import VERSION, Metric, NotEvaluated, ProtocolResult
from thingmap.mapper.map.store import OutputFolder

BROKEN = 39  # a frame that cannot be read


@dataclass
class Images:
    """Grey images of the scene, whose objects are known; counts what is read."""

    known: GroundTruth
    name: str = "eight boxes"
    gravity: None = None
    read: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        assert self.known.intrinsics is not None
        self.names, self.stamps, self.poses = self.known.names, self.known.stamps, self.known.poses
        self.intrinsics: Intrinsics = self.known.intrinsics
        self.objects: tuple[TrueObject, ...] = self.known.objects
        self.classes: tuple[str, ...] = self.known.classes

    def truth(self, index: int) -> FrameTruth:
        assert self.known.frame_truth is not None
        seen = self.known.frame_truth(index)
        assert seen is not None
        return seen

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self):
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        self.read.append(index)
        if index == BROKEN:
            raise BrokenFrame(self.names[index], FrameProblem.UNREADABLE)
        color, depth = np.full((480, 640, 3), 127, dtype=np.uint8), np.ones((480, 640), dtype=np.float32)
        assert self.poses is not None
        stamp, pose = float(self.stamps[index]), self.poses[index]
        return Frame(index, self.names[index], stamp, color, depth, self.intrinsics, pose)


@pytest.fixture
def with_images(scene_truth) -> GroundTruth:
    """The scene with its images at hand."""
    return replace(scene_truth, sequence=Images(scene_truth))


@pytest.fixture
def run_with(scene_truth, perfect_run) -> Callable:
    """`run_with(detector)`: a perfect run that was made with this detector."""

    def make(detector: str | None):
        run = perfect_run(scene_truth)
        return replace(run, report={**run.report, "command": {"detector": detector}})

    return make


@pytest.fixture
def out(tmp_path: Path, scene_truth, perfect_run) -> Path:
    run = perfect_run(scene_truth)
    folder = OutputFolder.create(tmp_path / "table")
    folder.write_trajectory(run.stamps, run.poses)
    points, _ = run.cloud()
    folder.write_cloud(points, np.full((len(points), 3), 127, dtype=np.uint8))
    folder.write_report({**run.report, "command": {"detector": "simulated"}})
    folder.write_map(run.object_map)
    return folder.path


def test_the_protocols_are_those_of_the_evaluator_in_order() -> None:
    names = ("georgakis", "lai", "meger", "objects", "honesty", "trajectory", "cost")
    assert tuple(name for name, _ in PROTOCOLS) == names


def test_every_protocol_answers_or_says_what_is_missing(out: Path, scene_truth) -> None:
    asked: list[str] = []
    evaluation = evaluate_run(out, scene_truth, detector="none", on_protocol=asked.append)
    assert asked == [name for name, _ in PROTOCOLS]
    assert sorted([*evaluation.results, *evaluation.skipped]) == sorted(asked)
    assert all(result.protocol == name for name, result in evaluation.results.items())
    assert all(evaluation.skipped.values())
    assert "snapshot" in evaluation.skipped["meger"]
    assert {"objects", "trajectory", "cost"} <= set(evaluation.results)
    assert evaluation.version == VERSION and evaluation.truth == "eight boxes"
    assert evaluation.results["trajectory"].value("ATE rmse") < 1e-5  # the file has six decimals


def test_a_protocol_that_cannot_answer_does_not_stop_the_others(out: Path, scene_truth, monkeypatch) -> None:
    def lacks(case) -> ProtocolResult:
        raise NotEvaluated("there is no moon")

    def answers(case) -> ProtocolResult:
        return ProtocolResult("sun", "Sun", "the sky", (Metric("frame step", case.config.frame_step),))

    monkeypatch.setattr(module, "PROTOCOLS", (("moon", lacks), ("sun", answers)))
    evaluation = evaluate_run(out, scene_truth, EvaluationConfig(frame_step=3))
    assert evaluation.skipped == {"moon": "there is no moon"}
    assert evaluation.results["sun"].value("frame step") == 3


def test_facts_are_for_people(out: Path, scene_truth, monkeypatch) -> None:
    monkeypatch.setattr(module, "PROTOCOLS", ())
    evaluation = evaluate_run(out, scene_truth)
    run, alignment = evaluation.run, evaluation.alignment
    assert (run["map"], run["frame"], run["frames in common"], run["things judged"]) == ("table", "first camera", 40, 8)
    assert run["detector"] is None and "no images at hand" in run["notes"][0]
    assert "by poses" in alignment["method"]
    assert alignment["position error, rmse, m"] < 1e-5
    assert alignment["poses to positions, degrees"] < 0.01
    assert alignment["up error, degrees"] < 0.01


def test_a_truth_that_does_not_fit_is_refused(out: Path, scene_truth) -> None:
    with pytest.raises(UserError, match="no common frame"):
        evaluate_run(out, replace(scene_truth, stamps=scene_truth.stamps + 50.0))


def test_a_damaged_cloud_is_refused_and_an_absent_one_is_not(out: Path, scene_truth) -> None:
    cloud = out / "cloud.ply"
    cloud.write_bytes(cloud.read_bytes()[:2000])
    with pytest.raises(InputError, match=r"cloud\.ply"):
        evaluate_run(out, scene_truth)
    cloud.unlink()
    assert "no cloud" in evaluate_run(out, scene_truth).skipped["lai"]


def test_the_detector_of_the_run_is_the_one_under_test(with_images, run_with) -> None:
    detect, spec, reason = choose_detections(run_with("simulated?seed=3"), with_images, None)
    assert detect is not None and (spec, reason) == ("simulated?seed=3", None)
    assert sum(len(detect(index)) for index in range(5)) > 5


def test_every_frame_is_read_once(with_images, run_with) -> None:
    detect, _, _ = choose_detections(run_with("simulated"), with_images, None)
    assert detect is not None
    assert detect(4) is detect(4) and detect(7) is not detect(4)
    assert with_images.sequence.read.count(4) == with_images.sequence.read.count(7) == 1


def test_a_detector_given_replaces_that_of_the_run(with_images, run_with) -> None:
    assert choose_detections(run_with("recorded:absent.json"), with_images, "simulated")[1] == "simulated"
    assert choose_detections(run_with("simulated"), with_images, "none") == (None, None, None)


def test_a_detector_that_cannot_be_had_again_is_told_not_fatal(scene_truth, with_images, run_with) -> None:
    for truth, detector, why in (
        (with_images, "recorded:absent.json", "absent.json"),
        (scene_truth, "simulated", "no images"),
    ):
        detect, spec, reason = choose_detections(run_with(detector), truth, None)
        assert detect is None and spec is None and reason is not None and why in reason
        with pytest.raises(UserError, match=why):
            choose_detections(run_with(None), truth, detector)


def test_a_run_without_detector_has_none(with_images, run_with) -> None:
    for detector in (None, "none"):
        assert choose_detections(run_with(detector), with_images, None) == (None, None, None)


def test_a_frame_that_can_no_longer_be_read_is_named(with_images, run_with) -> None:
    detect, _, _ = choose_detections(run_with("simulated"), with_images, None)
    assert detect is not None
    with pytest.raises(UserError, match=f"frame-{BROKEN:06d}"):
        detect(BROKEN)

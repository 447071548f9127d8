"""A run through all protocols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import UserError
from ...datasets.frame import BrokenFrame
from ...datasets.ground_truth import GroundTruth
from ...datasets.sequence import Sequence
from ...detectors.detections import Detections
from ...detectors.spec import make_detector
from .config import EvaluationConfig
from .inputs.alignment import align_poses, align_positions, trajectory_error
from .inputs.build_case import build_case
from .inputs.case import Case, MappedRun
from .inputs.frames import common_poses
from .inputs.load_run import load_run
from .protocols import cost, georgakis, honesty, lai, meger, objects, trajectory
from .result import VERSION, NotEvaluated, ProtocolResult

NO_DETECTOR = "none"
Detect = Callable[[int], Detections]


PROTOCOLS: tuple[tuple[str, Callable[[Case], ProtocolResult]], ...] = (
    ("georgakis", georgakis.evaluate),
    ("lai", lai.evaluate),
    ("meger", meger.evaluate),
    ("objects", objects.evaluate),
    ("honesty", honesty.evaluate),
    ("trajectory", trajectory.evaluate),
    ("cost", cost.evaluate),
)


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """What came of it.

    Attributes:
        version: of the protocols.
        run: facts about the run, by name: texts, numbers, None or lists of texts.
        truth: its name.
        alignment: facts about how the map's axes were put over the truth's.
        results: of each protocol, in the order of `PROTOCOLS`.
        skipped: protocol -> what the truth or the run lacks for it.
        case: what the protocols were given.
    """

    version: str
    run: Mapping[str, Any]
    truth: str
    alignment: Mapping[str, Any]
    results: dict[str, ProtocolResult]
    skipped: dict[str, str]
    case: Case


def evaluate_run(
    out: str | Path,
    truth: GroundTruth,
    config: EvaluationConfig = EvaluationConfig(),  # noqa: B008
    detector: str | None = None,
    on_protocol: Callable[[str], None] | None = None,
) -> Evaluation:
    """The output folder of a run through all protocols.

    Args:
        out: what `thingmap run` wrote.
        truth: of the sequence that was mapped.
        config: every number of the evaluator.
        detector: line that describes the detector under test (`make_detector`), "none" for none. None is the one that
            the run was made with; where it cannot be had again, the facts about the run say why.
        on_protocol: told the name of each protocol before it begins.

    Raises:
        InputError: a file of the run is damaged.
        UserError: the truth does not fit the map, or the detector given cannot be had.
    """
    run = load_run(out)
    detections, spec, reason = choose_detections(run, truth, detector)
    case = build_case(run, truth, config, detections)
    results: dict[str, ProtocolResult] = {}
    skipped: dict[str, str] = {}
    for name, evaluate in PROTOCOLS:
        if on_protocol is not None:
            on_protocol(name)
        try:
            results[name] = evaluate(case)
        except NotEvaluated as lack:
            skipped[name] = str(lack)
    facts = run_facts(case, spec, reason)
    return Evaluation(VERSION, facts, truth.name, alignment_facts(case), results, skipped, case)


def choose_detections(
    run: MappedRun, truth: GroundTruth, detector: str | None
) -> tuple[Detect | None, str | None, str | None]:
    """The detector under test.

    Returns:
        Detections of a frame of the truth by its index, each found once; the line that describes the detector; and why
        there is none although the run had one. All None where none was asked for.

    Raises:
        UserError: `detector` is given and cannot be had.
    """
    command = run.report.get("command")
    spec = detector or (command.get("detector") if isinstance(command, Mapping) else None)
    if not isinstance(spec, str) or spec == NO_DETECTOR:
        return None, None, None
    if truth.sequence is None:
        reason = f"{truth.name} has no images at hand, on which to run the detector {spec}"
        if detector is not None:
            raise UserError(f"{reason}; give the sequence too, or --detector {NO_DETECTOR}")
        return None, None, reason
    try:
        return _on_frames(truth.sequence, spec), spec, None
    except UserError as error:
        if detector is not None:
            raise
        return None, None, str(error)


def _on_frames(sequence: Sequence, spec: str) -> Detect:
    detector = make_detector(spec, sequence)

    @cache
    def detect(index: int) -> Detections:
        try:
            frame = sequence[index]
        except BrokenFrame as broken:
            raise UserError(f"{sequence.name}: a frame that was mapped cannot be read again: {broken}") from None
        return detector(frame)

    return detect


def run_facts(case: Case, detector: str | None, no_detector: str | None) -> dict[str, Any]:
    """What was mapped, for people."""
    object_map, report = case.run.object_map, case.run.report
    notes = [*case.notes, *([f"No detections: {no_detector}."] if no_detector else [])]
    return {
        "map": case.run.folder.resolve().name,
        "source": object_map.source,
        "frame": str(object_map.frame),
        "frames mapped": len(case.run.stamps),
        "frames in common": len(case.truth_index),
        "keyframes": report.get("keyframes"),
        "things": len(object_map),
        "things judged": len(case.things),
        "classes": list(object_map.classes),
        "detector": detector,
        "snapshots": len(case.run.snapshots),
        "notes": notes,
    }


def alignment_facts(case: Case) -> dict[str, Any]:
    """How the map's axes were put over the truth's, and how sure that is."""
    estimate, true = common_poses(case.run, case.truth, case.truth_index, case.run_index)
    facts: dict[str, Any] = {"method": case.alignment.method, "covariances": case.anchored.method}
    if len(true):
        facts["position error, rmse, m"] = trajectory_error(estimate, true, case.alignment)
        by_poses = align_poses(estimate, true)
        try:
            angle = np.degrees(by_poses.angle_to(align_positions(estimate, true)))
        except UserError:  # a straight path, or two poses
            angle = None
        facts["poses to positions, degrees"] = None if angle is None else float(angle)
    if case.truth.up is not None:
        up = case.alignment.R @ case.run.object_map.up.direction
        facts["up error, degrees"] = float(np.degrees(np.arccos(np.clip(up @ case.truth.up, -1.0, 1.0))))
    return facts

"""A run and a truth become one case, or it is said why they do not fit."""

from __future__ import annotations

from collections.abc import Callable

from ....datasets.ground_truth import GroundTruth
from ....detectors.detections import Detections
from ..config import EvaluationConfig
from .case import Case, MappedRun
from .frames import align, common_frames, other_source
from .placing import check_classes, place_things


def build_case(
    run: MappedRun,
    truth: GroundTruth,
    config: EvaluationConfig = EvaluationConfig(),  # noqa: B008
    detections: Callable[[int], Detections] | None = None,
) -> Case:
    """What the protocols are given.

    Args:
        run: from `load_run`.
        truth: of the sequence that was mapped.
        config: every number of the evaluator.
        detections: of frames of the truth, by index, where there is a detector.

    Raises:
        UserError: the truth does not fit the map: classes that the map does not know, no common frames, or another
            world; the message says what differs.
    """
    check_classes(run.object_map, truth, config)
    truth_index, run_index = common_frames(run, truth, config)
    alignment, anchored = align(run, truth, truth_index, run_index)
    things, left_out = place_things(run.object_map, truth, alignment, config)
    return Case(
        run=run,
        truth=truth,
        truth_index=truth_index,
        run_index=run_index,
        alignment=alignment,
        anchored=anchored,
        things=things,
        detections=detections,
        config=config,
        notes=tuple(_notes(run, truth, len(truth_index), left_out)),
    )


def _notes(run: MappedRun, truth: GroundTruth, common: int, left_out: dict[str, int]) -> list[str]:
    notes = []
    if other_source(run, truth):
        notes.append(
            f"The map was made of {run.object_map.source}, the truth is that of {truth.name}: unless these are two "
            "names of one sequence, no number here means anything."
        )
    if left_out:
        counts = ", ".join(f"{count} {label}" for label, count in sorted(left_out.items()))
        many = sum(left_out.values())
        notes.append(f"{many} thing{'s' * (many > 1)} of classes unknown to the truth left out: {counts}.")
    if len(truth.stamps) and common < len(run.stamps):
        notes.append(f"{len(run.stamps) - common} of {len(run.stamps)} mapped frames are not among the truth's.")
    if stopped := run.report.get("stopped"):
        notes.append(f"The run did not end by itself: {stopped}.")
    return notes

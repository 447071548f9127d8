"""Protocol 4: the objects of a map, one to one with those of the scene.

A thing is a claim where existence times probability of its class is at least one half. Claims are matched with objects
whatever they are called (`things.matching`), by distance of centres (the main matching) and by volume; then names are
compared inside the matching (`things.scores`), and centres, sizes and volumes of the matched (`things.errors`). The
four papers count boxes in images, not objects in space; what is measured here is defined here.

Objects that no mapped frame showed well (`things.seen`) are matched too, and then neither they nor their things count.
A thing on an object of no class stands for nothing: it is a false positive.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ....datasets.truth import TrueObject
from ..inputs.case import Case, PlacedThing
from ..inputs.placing import place_things
from ..result import Better, Metric, NotEvaluated, ProtocolResult
from ..things.errors import Errors, measure_errors
from ..things.matching import Matching, believed, match_by_distance, match_by_volume, places_all, same_label
from ..things.pictures import worst_cases
from ..things.scores import Scores, label_f1, score
from ..things.seen import SeenObjects, see_objects
from ..things.tables import (
    Summary,
    centre_table,
    class_table,
    false_table,
    histograms,
    matching_table,
    occlusion_plot,
    occlusion_table,
    p95,
    size_table,
    summarise,
)

STRICT_IOU = 0.5  # the second threshold of matching by volume, that of boxes in images


def evaluate(case: Case) -> ProtocolResult:
    """Score the final map.

    Raises:
        NotEvaluated: the truth has no object with a position, or none that the run could have seen.
    """
    truth, objects = case.truth, case.truth.located
    if not objects:
        raise NotEvaluated("the truth tells no position of any object")
    seen = see_objects(case)
    counted = np.array([seen.counts(true.id) for true in objects])
    if not counted.any():
        raise NotEvaluated("no mapped frame shows any object well enough to be found")
    exhaustive = places_all(truth)
    claims = believed(case)
    matching = match_by_distance(case, claims, counted)
    by_distance = score(matching, exhaustive)
    by_volume = {
        iou: _score_by_volume(case, claims, counted, iou, exhaustive)
        for iou in sorted({case.config.volume_iou, STRICT_IOU})
    }
    false = believed_false_detections(case)
    errors = measure_errors(case, matching.matched)
    occlusion = occlusion_table(matching, seen)
    return ProtocolResult(
        protocol="objects",
        title="Objects",
        follows="defined here: one-to-one matching of things and objects in space, whatever they are called",
        metrics=(
            *_count_metrics(case, matching, by_distance, len(false)),
            *_error_metrics(errors),
            *_volume_metrics(by_volume),
        ),
        tables=(
            class_table(matching, truth.classes, exhaustive),
            matching_table(by_distance, by_volume),
            centre_table(errors),
            size_table(errors),
            *((occlusion,) if occlusion.rows else ()),
            *((false_table(case, false),) if truth.false_detections else ()),
        ),
        plots=(*((occlusion_plot(occlusion),) if occlusion.rows else ()), *histograms(errors)),
        worst=worst_cases(case, matching, seen, exhaustive, false),
        notes=_notes(case, matching, seen, exhaustive),
    )


def believed_false_detections(case: Case) -> list[tuple[PlacedThing, TrueObject]]:
    """Things believed to be of the class of a known false detection and near it, each with that false detection, the
    most believed first. Near is its tolerance, or `max_distance`. The truth's classes need not hold theirs."""
    reach = {claim.id: case.config.max_distance for claim in case.truth.false_detections} | dict(case.truth.tolerance)
    classes = tuple(dict.fromkeys(claim.label for claim in case.truth.false_detections))
    things, _ = place_things(case.run.object_map, replace(case.truth, classes=classes), case.alignment, case.config)
    found = []
    for thing in sorted(things, key=lambda thing: -thing.belief):
        for claim in case.truth.false_detections:
            is_near = float(np.linalg.norm(thing.position - claim.position)) <= reach[claim.id]
            if is_near and same_label(thing.label, claim.label) and thing.belief >= case.config.believed:
                found.append((thing, claim))
    return found


def _score_by_volume(
    case: Case, claims: Sequence[PlacedThing], counted: np.ndarray, iou: float, exhaustive: bool
) -> Scores | None:
    """None where the size of an object is unknown: what stands for it would be false, even if it need not be found."""
    sized = all(np.isfinite(true.size).all() for true in case.truth.located)
    return score(match_by_volume(case, claims, counted, iou), exhaustive) if sized else None


def _count_metrics(case: Case, matching: Matching, scores: Scores, false: int) -> tuple[Metric, ...]:
    return (
        Metric("joint F1", scores.joint_f1),
        Metric("joint precision", scores.joint_precision),
        Metric("joint recall", scores.joint_recall),
        Metric("detection F1", scores.f1),
        Metric("detection precision", scores.precision),
        Metric("detection recall", scores.recall),
        Metric("label accuracy", scores.label_accuracy),
        Metric("label F1", label_f1(matching)),
        Metric("count ratio", scores.count_ratio, better=Better.NEAR_ONE),
        Metric("true objects", scores.wanted, better=Better.NEITHER),
        Metric("claimed things", scores.claimed, better=Better.NEITHER),
        Metric("duplicates", len(matching.duplicates), better=Better.LOWER),
        Metric("believed false detections", false if case.truth.false_detections else None, better=Better.LOWER),
    )


def _error_metrics(errors: Errors) -> tuple[Metric, ...]:
    def lower(name: str, values: np.ndarray, summary: Summary, unit: str = "") -> Metric:
        return Metric(name, summarise(values, summary), unit, Better.LOWER)

    millimetres = 1000.0 * errors.distance
    return (
        lower("centre error, median", millimetres, np.median, "mm"),
        lower("centre error, mean", millimetres, np.mean, "mm"),
        lower("centre error, 95 %", millimetres, p95, "mm"),
        lower("size error", np.abs(errors.log_size), np.median),
        lower("size error in the truth's axes", np.abs(errors.log_own_size), np.median),
        lower("size error in cm", 100.0 * np.abs(errors.size), np.median, "cm"),
        Metric("volume IoU", summarise(errors.iou, np.mean)),
    )


def _volume_metrics(by_volume: Mapping[float, Scores | None]) -> tuple[Metric, ...]:
    metrics = []
    for iou, scores in by_volume.items():
        metrics.append(Metric(f"detection F1, IoU {iou:g}", None if scores is None else scores.f1))
        metrics.append(Metric(f"joint F1, IoU {iou:g}", None if scores is None else scores.joint_f1))
    return tuple(metrics)


def _notes(case: Case, matching: Matching, seen: SeenObjects, exhaustive: bool) -> tuple[str, ...]:
    config, truth = case.config, case.truth
    notes = [
        f"Claims: existence times probability at least {config.believed:g}. Centres within {config.distance_share:g} "
        f"of the object's diagonal or its tolerance; of unknown size, its tolerance or {config.max_distance:g} m.",
        f"Aligned: {case.alignment.method}.",
    ]
    if ignored := len(matching.objects) - len(matching.wanted):
        notes.append(
            "Objects that count neither as missed nor as found, as no mapped frame shows them by "
            f"{config.seen_visibility:g} and {config.seen_side:g} pixels large: {ignored}."
        )
    if seen.frames == 0:
        notes.append("Nobody knows which objects could be seen: all count.")
    if unplaced := len(truth.objects) - len(truth.located):
        notes.append(f"Objects without a known position, left out: {unplaced}.")
    if not exhaustive:
        notes.append("The truth does not place every object: other claims are not judged, precision is undefined.")
    return tuple(notes)

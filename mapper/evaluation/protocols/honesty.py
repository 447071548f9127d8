"""Protocol 5: whether a map knows what it does not know.

*Probabilities* (`calibration`). All things of the map file are matched with all objects, the likeliest first. Their
existence is right where they stand for an object; a duplicate does not. The class posteriors of those that do are held
against the objects' classes.

*Covariances* (`consistency`). The positions and sizes of claimed things, in the matching of protocol 4, and the poses
of keyframes, by their normalised errors squared. None of the four papers measures either.
"""

from __future__ import annotations

import numpy as np

from ..inputs.case import Case
from ..result import NotEvaluated, ProtocolResult, Table
from ..things.matching import believed, match_by_distance, match_ranked, places_all
from ..uncertainty.calibration import (
    LOG_FLOOR,
    Calibration,
    calibrate_classes,
    calibrate_outcomes,
    calibration_metrics,
    reliability_plot,
    reliability_table,
)
from ..uncertainty.claims import class_claims, existence_claims, pose_claims, position_claims, size_claims
from ..uncertainty.consistency import Consistency, consistency_metrics, consistency_plot, measure_consistency

FOLLOWS = "Guo et al. 2017 (calibration error), Brier 1950; Bar-Shalom et al. 2001, section 5.4 (NEES)"
DOUBTFUL = 0.5  # existence below which things are written only when asked for


def evaluate(case: Case) -> ProtocolResult:
    """Score what the final map says about its own uncertainty.

    Raises:
        NotEvaluated: the truth places no object, and no pose can be judged.
    """
    poses, exhaustive = pose_claims(case), places_all(case.truth)
    if not case.truth.located and poses is None:
        raise NotEvaluated(
            "the truth tells no position of any object, and there are no poses with covariances to judge"
        )
    calibrations = _calibrations(case, exhaustive)
    consistencies = _consistencies(case, poses)
    metrics = [metric for name, result in calibrations.items() for metric in calibration_metrics(name, result)]
    metrics += [metric for name, result in consistencies.items() for metric in consistency_metrics(name, result)]
    measured = {name: result for name, result in calibrations.items() if result.count}
    tables = [reliability_table(f"Reliability of {name}", result.reliability) for name, result in measured.items()]
    plots = [reliability_plot(f"Reliability of {name}", result.reliability) for name, result in measured.items()]
    plots += [consistency_plot(name, result) for name, result in consistencies.items() if len(result.nees)]
    return ProtocolResult(
        protocol="honesty",
        title="Honesty",
        follows=FOLLOWS,
        metrics=tuple(metrics),
        tables=(*tables, _consistency_table(consistencies)),
        plots=tuple(plots),
        notes=_notes(case, consistencies, exhaustive),
    )


def _calibrations(case: Case, exhaustive: bool) -> dict[str, Calibration]:
    """Existence has no samples where the truth is not complete: a thing on no known object may be right."""
    matching, bins = match_ranked(case), case.config.calibration_bins
    existence, stands = existence_claims(matching)
    judged = np.full(len(existence), exhaustive)
    return {
        "class": calibrate_classes(*class_claims(case, matching), bins),
        "existence": calibrate_outcomes(existence[judged], stands[judged], bins),
    }


def _consistencies(case: Case, poses: tuple[np.ndarray, np.ndarray] | None) -> dict[str, Consistency]:
    pairs = match_by_distance(case, believed(case), np.ones(len(case.truth.located), dtype=bool)).matched
    return {
        "position": measure_consistency(*position_claims(case, pairs)),
        "size": measure_consistency(*size_claims(pairs)),
        "pose": measure_consistency(*(poses or (np.empty((0, 6)), np.empty((0, 6, 6))))),
    }


def _consistency_table(consistencies: dict[str, Consistency]) -> Table:
    rows = []
    for name, result in consistencies.items():
        low, high = result.band or (None, None)
        counts = (result.dof, len(result.nees), result.singular)
        rows.append((name, *counts, result.mean_per_dof, low, high, result.inside, result.verdict))
    columns = ("of", "degrees of freedom", "samples", "singular, left out", "mean NEES per degree", "band from", "to")
    return Table("Normalised errors squared", (*columns, "inside 95 % ellipsoid", "the map is"), tuple(rows))


def _notes(case: Case, consistencies: dict[str, Consistency], exhaustive: bool) -> tuple[str, ...]:
    notes = [
        f"Log loss is natural, with probabilities of at least {LOG_FLOOR:g}. The Brier score of classes goes from 0 to "
        "2, that of existence from 0 to 1.",
        "The bands hold for independent errors. Those of one run share its drift, so the mean may leave the band by "
        "chance more often.",
        f"Positions: {case.anchored.method}.",
    ]
    things = case.run.object_map.things
    if things and exhaustive and all(thing.existence >= DOUBTFUL for thing in things):
        notes.append(
            "No thing of the map has an existence below 0.5, so only one half of what it claims can be judged: "
            "write the map with --all."
        )
    if case.truth.located and not exhaustive:
        notes.append("The truth does not place every object: existence is not judged.")
    if loose := sum(true.id in case.truth.tolerance for true in case.truth.located):
        notes.append(f"Objects placed with a tolerance only, left out of the NEES of positions: {loose}.")
    if case.run.keyframes is None:
        notes.append("The run wrote no covariances of keyframes: poses are not judged.")
    elif not len(consistencies["pose"].nees) and not consistencies["pose"].singular:
        notes.append("The truth lacks the poses of keyframes or of the first one: poses are not judged.")
    return tuple(notes)

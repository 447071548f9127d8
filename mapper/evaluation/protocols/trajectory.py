"""Protocol 6: absolute and relative trajectory error (Sturm et al. 2012, section V), as the TUM benchmark defines them.

The absolute error is over all common frames under several alignments, the headline being the least squares over
positions; the relative one is over neighbouring frames and over all pairs one second apart. See `trajectory_errors`.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from ....datasets.errors import UserError
from ...map.object_map import MapFrame
from ..inputs.alignment import align_poses, align_positions, align_similarity, anchor
from ..inputs.case import Alignment, Case
from ..result import Better, Metric, NotEvaluated, Plot, ProtocolResult, Series, Table, WorstCase
from .trajectory_errors import ErrorSummary, absolute_errors, neighbours, pairs_apart, relative_errors

FOLLOWS = "Sturm et al. 2012 (TUM RGB-D benchmark), section V; Umeyama 1991 for the alignments"
BY_POSITIONS, BY_POSES, FIRST_POSE = "SE(3) by positions", "SE(3) by poses", "first pose"
SIMILARITY = "Sim(3) by positions"
STATISTICS = ("rmse", "mean", "median", "max")
WORST_APART = 1.0  # s at least between two frames shown as worst: neighbours look alike
VISIBLE = 1e-3  # m, error below which there is nothing to show


@dataclass(frozen=True, slots=True, eq=False)
class _Aligned:
    """(N,) errors in metres under one alignment, and its scale; both None where the positions do not tell it."""

    errors: np.ndarray | None
    scale: float | None = 1.0

    @property
    def summary(self) -> ErrorSummary:
        return ErrorSummary.of(np.empty(0) if self.errors is None else self.errors)


def evaluate(case: Case) -> ProtocolResult:
    """The trajectory against the truth's poses.

    Raises:
        NotEvaluated: the truth has no pose, or of fewer than two mapped frames.
    """
    rows, estimate, truth = _common(case)
    stamps = case.truth.stamps[case.truth_index[rows]]
    absolute, notes = _align(estimate, truth, case.run.object_map.frame is MapFrame.DATASET)
    relative = {
        "frame": relative_errors(estimate, truth, neighbours(len(rows))),
        "second": relative_errors(estimate, truth, pairs_apart(stamps)),
    }
    best, errors = next((name, each.errors) for name, each in absolute.items() if each.errors is not None)
    if best != BY_POSITIONS:
        notes.append(f"ATE is under the alignment {best}.")
    if len(relative["second"][0]) == 0:
        notes.append("No two frames are one second apart.")
    coverage = Metric("coverage", len(case.truth_index) / len(case.truth.stamps), "", Better.HIGHER)
    return ProtocolResult(
        protocol="trajectory",
        title="Trajectory",
        follows=FOLLOWS,
        metrics=(*_absolute_metrics(absolute, best), *_relative_metrics(relative), coverage),
        tables=(_ate_table(absolute), _rpe_table(relative)),
        plots=(_top_view(case, estimate, truth), _over_time(stamps, errors, best)),
        worst=_worst(case, rows, stamps, errors),
        notes=(*notes, *_coverage_notes(case, len(rows))),
    )


def _common(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the case's frames that have a true pose, and (N, 4, 4) estimated and true poses of those."""
    if case.truth.poses is None:
        raise NotEvaluated("the truth has no poses")
    true = case.truth.poses[case.truth_index]
    rows = np.flatnonzero(np.isfinite(true).all(axis=(1, 2)))
    if len(rows) < 2:
        raise NotEvaluated(f"a trajectory needs two frames with a true pose, and {len(rows)} of those mapped have one")
    return rows, case.run.poses[case.run_index[rows]], true[rows]


def _align(estimate: np.ndarray, truth: np.ndarray, same_axes: bool) -> tuple[dict[str, _Aligned], list[str]]:
    """Errors under every alignment, the best known first, and what cannot be told."""
    table, notes = {BY_POSITIONS: _Aligned(None, None)}, []
    similarity = _Aligned(None, None)
    try:
        table[BY_POSITIONS] = _Aligned(absolute_errors(estimate, truth, align_positions(estimate, truth)))
        rigid, scale = align_similarity(estimate, truth)
        similarity = _Aligned(absolute_errors(estimate, truth, rigid, scale), scale)
    except UserError as error:
        notes.append(f"No alignment by positions: {error}.")
    table[BY_POSES] = _Aligned(absolute_errors(estimate, truth, align_poses(estimate, truth)))
    table[FIRST_POSE] = _Aligned(absolute_errors(estimate, truth, anchor(estimate, truth)))
    if same_axes:
        table["none"] = _Aligned(absolute_errors(estimate, truth, Alignment(np.eye(3), np.zeros(3))))
    table[SIMILARITY] = similarity
    return table, notes


def _absolute_metrics(table: dict[str, _Aligned], best: str) -> tuple[Metric, ...]:
    ate, lower = table[best].summary, Better.LOWER
    return (
        *(Metric(f"ATE {name}", getattr(ate, name), "m", lower) for name in STATISTICS),
        Metric("ATE rmse by poses", table[BY_POSES].summary.rmse, "m", lower),
        Metric("ATE rmse, first pose", table[FIRST_POSE].summary.rmse, "m", lower),
        Metric("ATE rmse, Sim(3)", table[SIMILARITY].summary.rmse, "m", lower),
        Metric("scale", table[SIMILARITY].scale, "", Better.NEAR_ONE),
    )


def _relative_metrics(errors: dict[str, tuple[np.ndarray, np.ndarray]]) -> list[Metric]:
    metrics = []
    for over, (metres, radians) in errors.items():
        metrics.append(Metric(f"RPE per {over}", ErrorSummary.of(metres).rmse, "m", Better.LOWER))
        angle = ErrorSummary.of(np.degrees(radians)).rmse
        metrics.append(Metric(f"RPE rotation per {over}", angle, "degrees", Better.LOWER))
    return metrics


def _ate_table(table: dict[str, _Aligned]) -> Table:
    rows = ((name, *astuple(each.summary), each.scale) for name, each in table.items())
    return Table("Absolute error, m", ("alignment", *STATISTICS, "scale"), tuple(rows))


def _rpe_table(errors: dict[str, tuple[np.ndarray, np.ndarray]]) -> Table:
    rows = []
    for name, (metres, radians) in errors.items():
        m, d = ErrorSummary.of(metres), ErrorSummary.of(np.degrees(radians))
        rows.append((name, len(metres), m.rmse, m.median, m.max, d.rmse, d.median, d.max))
    units = (f"{kind}, {unit}" for unit in ("m", "degrees") for kind in ("rmse", "median", "max"))
    return Table("Relative error", ("over one", "pairs", *units), tuple(rows))


def _top_view(case: Case, estimate: np.ndarray, truth: np.ndarray) -> Plot:
    """Both paths from above, in the truth's axes under the alignment of the case."""
    R = case.R_truth_upright
    series = []
    for name, positions in (("true", truth[:, :3, 3]), ("estimated", case.alignment.apply(estimate[:, :3, 3]))):
        x, y, _ = (positions @ R).T
        series.append(Series(name, tuple(x.tolist()), tuple(y.tolist())))
    return Plot("Trajectory from above", "x, m", "y, m", tuple(series), equal=True)


def _over_time(stamps: np.ndarray, errors: np.ndarray, alignment: str) -> Plot:
    since = tuple((stamps - stamps[0]).tolist())
    return Plot("Position error", "time, s", "error, m", (Series(alignment, since, tuple(errors.tolist())),))


def _worst(case: Case, rows: np.ndarray, stamps: np.ndarray, errors: np.ndarray) -> tuple[WorstCase, ...]:
    """The frames that are furthest off, `WORST_APART` from one another."""
    chosen: list[int] = []
    for k in np.argsort(-errors, kind="stable"):
        if len(chosen) == case.config.worst_cases or errors[k] < VISIBLE:
            break
        if all(abs(stamps[k] - stamps[other]) >= WORST_APART for other in chosen):
            chosen.append(int(k))
    frames = case.truth_index[rows]
    return tuple(
        WorstCase(f"{_frame_name(case, int(frames[k]))}: the camera is {errors[k]:.3f} m off", int(frames[k]))
        for k in chosen
    )


def _frame_name(case: Case, index: int) -> str:
    return case.truth.names[index] if index < len(case.truth.names) else f"frame {index}"


def _coverage_notes(case: Case, judged: int) -> list[str]:
    notes = [f"{judged} of {len(case.truth.stamps)} frames have an estimated and a true pose."]
    command = case.run.report.get("command") or {}
    stride = command.get("stride") if isinstance(command, dict) else None
    if isinstance(stride, int) and stride > 1:
        notes.append(f"Only every {stride}th frame was to be mapped: a frame of the RPE is one of those.")
    return notes

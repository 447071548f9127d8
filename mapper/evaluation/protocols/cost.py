"""Protocol 7: what the map cost, as the run itself measured it (`report.json`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..inputs.case import Case
from ..result import Better, Metric, NotEvaluated, ProtocolResult, Table

COLUMNS = ("stage", "times", "mean, ms", "median, ms", "p95, ms", "total, s")


def evaluate(case: Case) -> ProtocolResult:
    """Speed, time per stage and memory.

    Raises:
        NotEvaluated: the report has no times.
    """
    report = case.run.report
    rate, loop = _number(report, "frames_per_second"), _stages(report)
    if rate is None or not loop:
        raise NotEvaluated("report.json tells no times of the run")
    mapper = report.get("mapper")
    inner = _stages(mapper) if isinstance(mapper, Mapping) else {}
    mapping = loop.get("mapping", {})
    lower, neither = Better.LOWER, Better.NEITHER
    frames = _number(report, "frames_used")
    return ProtocolResult(
        protocol="cost",
        title="Cost",
        follows="the run's own account: wall time of one process, and its largest resident size",
        metrics=(
            Metric("frames per second", rate, "1/s", Better.HIGHER),
            Metric("mapping per frame, mean", _number(mapping, "mean_ms"), "ms", lower),
            Metric("mapping per frame, median", _number(mapping, "median_ms"), "ms", lower),
            Metric("mapping per frame, p95", _number(mapping, "p95_ms"), "ms", lower),
            Metric("wall time", _number(report, "seconds"), "s", lower),
            Metric("peak memory", _number(report, "peak_memory_mb"), "MB", lower),
            Metric("frames", frames, "", neither),
            Metric("keyframes", _number(report, "keyframes"), "", neither),
            Metric("skipped frames", _number(report, "frames_skipped"), "", lower),
        ),
        tables=tuple(
            Table(title, COLUMNS, tuple(_row(name, stage, frames) for name, stage in stages.items()))
            for title, stages in (("Stages of the loop", loop), ("Stages of the mapper", inner))
            if stages
        ),
        notes=_notes(report),
    )


def _stages(report: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    stages = report.get("stages")
    if not isinstance(stages, Mapping):
        return {}
    return {str(name): stage for name, stage in stages.items() if isinstance(stage, Mapping)}


def _row(name: str, stage: Mapping[str, Any], frames: float | int | None) -> tuple[str | float | int | None, ...]:
    """One stage: of the loop, which every frame passes and whose mean is told, or of the mapper, which counts."""
    total_ms, total, mean = _number(stage, "total_ms"), _number(stage, "total_s"), _number(stage, "mean_ms")
    count = _number(stage, "count") if "count" in stage else frames
    if total is None and total_ms is not None:
        total = total_ms / 1e3
    if mean is None and total is not None and count:
        mean = 1e3 * total / count
    return name, count, mean, _number(stage, "median_ms"), _number(stage, "p95_ms"), total


def _number(values: Mapping[str, Any], name: str) -> float | int | None:
    value = values.get(name)
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


def _notes(report: Mapping[str, Any]) -> tuple[str, ...]:
    skipped = report.get("skipped")
    if not isinstance(skipped, Mapping) or not skipped:
        return ()
    counts = ", ".join(f"{len(names)} with {problem}" for problem, names in skipped.items())
    return (f"Skipped frames: {counts}.",)

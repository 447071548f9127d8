"""Reports side by side: a row a metric, a column a report, the best of every row, and what else differs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ....datasets.errors import UserError
from ..result import Better, Metric
from .markup import fact_text
from .report import Report

Number = float | int | None
RUN_FACTS = ("source", "frames in common", "detector")  # where they differ, numbers may for that alone
SAME = 1e-9  # relative: values nearer than this are equal


@dataclass(frozen=True, slots=True)
class Row:
    """One metric: a value a report, None where a report does not have it; `best` says which are the best ones."""

    name: str
    unit: str
    better: Better
    values: tuple[Number, ...]
    best: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Group:
    """The metrics of one protocol."""

    title: str
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Several reports.

    Attributes:
        names: of the reports, unique.
        warnings: what makes their numbers unlike: other evaluators, truths, numbers of the evaluator.
        groups: the metrics, in the order of the reports.
        skipped: protocols that were not evaluated, why, and in which reports where it is not all.
    """

    names: tuple[str, ...]
    warnings: tuple[str, ...]
    groups: tuple[Group, ...]
    skipped: tuple[str, ...]


def compare(reports: Mapping[str, Report], across_versions: bool = False) -> Comparison:
    """Put reports, by their names, side by side.

    Reports of different evaluator versions are refused: the version changes whenever a number of an unchanged map
    would. With `across_versions` they are shown all the same, under a warning and without marking a best one.

    Raises:
        UserError: fewer than two reports, or different versions.
    """
    if len(reports) < 2:
        raise UserError(f"a comparison needs two reports or more, got {len(reports)}; give more")
    versions = {name: report.evaluator for name, report in reports.items()}
    mixed = len(set(versions.values())) > 1
    if mixed and not across_versions:
        raise UserError(
            f"the reports come from different evaluators ({_by_value(versions)}), whose numbers cannot be compared; "
            "evaluate the maps again with one version, or show them all the same with --across-versions"
        )
    return Comparison(
        names=tuple(reports),
        warnings=tuple(_warnings(reports, mixed)),
        groups=tuple(_groups(list(reports.values()), mark=not mixed)),
        skipped=tuple(_skipped(reports)),
    )


def unique_names(paths: Sequence[Path]) -> tuple[str, ...]:
    """A name a report: its folder, with as many of the folders above as it takes; the same path twice is numbered."""
    parts = [(path.parent if path.suffix == ".json" else path).resolve().parts[1:] or ("report",) for path in paths]
    depths = [1] * len(parts)
    while True:
        names = ["/".join(part[-depth:]) for part, depth in zip(parts, depths, strict=True)]
        counts = Counter(names)
        longer = [counts[n] > 1 and depth < len(part) for n, part, depth in zip(names, parts, depths, strict=True)]
        if not any(longer) or len(set(parts)) == 1:
            break
        depths = [depth + more for depth, more in zip(depths, longer, strict=True)]
    seen: Counter[str] = Counter()
    numbered = []
    for name in names:
        seen[name] += 1
        numbered.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(numbered)


def best_of(values: Sequence[Number], better: Better) -> tuple[bool, ...]:
    """Which values are the best; none where fewer than two are known, all are equal or no direction is better."""
    loss = [_loss(value, better) for value in values]
    known = [x for x in loss if x is not None]
    if len(known) < 2 or _same(min(known), max(known)):
        return (False,) * len(values)
    return tuple(x is not None and _same(x, min(known)) for x in loss)


def _loss(value: Number, better: Better) -> float | None:
    """What is smaller for better values; None where that means nothing."""
    if value is None or not math.isfinite(value) or better is Better.NEITHER:
        return None
    if better is Better.NEAR_ONE:
        return abs(value - 1.0)
    return float(value) if better is Better.LOWER else -float(value)


def _same(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=SAME, abs_tol=SAME)


def _groups(reports: list[Report], mark: bool) -> Iterator[Group]:
    titles = {result.protocol: result.title for report in reports for result in report.results}
    for protocol, title in titles.items():
        results = [report.result(protocol) for report in reports]
        found = [{metric.name: metric for metric in result.metrics} if result else {} for result in results]
        names = dict.fromkeys(name for metrics in found for name in metrics)
        yield Group(title, tuple(_row([metrics.get(name) for metrics in found], mark) for name in names))


def _row(metrics: list[Metric | None], mark: bool) -> Row:
    known = next(metric for metric in metrics if metric is not None)
    values = tuple(metric.value if metric is not None else None for metric in metrics)
    best = best_of(values, known.better) if mark else (False,) * len(values)
    return Row(known.name, known.unit, known.better, values, best)


def _warnings(reports: Mapping[str, Report], mixed: bool) -> Iterator[str]:
    if mixed:
        versions = _by_value({name: report.evaluator for name, report in reports.items()})
        yield f"Different evaluators, whose numbers cannot be compared; no best value is marked: {versions}."
    aspects: dict[str, dict[str, Any]] = {
        "truth": {name: report.truth for name, report in reports.items()},
        "classes": {name: report.classes for name, report in reports.items()},
    }
    for key in RUN_FACTS:
        aspects[key] = {name: report.run.get(key) for name, report in reports.items()}
    aspects["alignment"] = {name: report.alignment.get("method") for name, report in reports.items()}
    for key in dict.fromkeys(key for report in reports.values() for key in report.config):
        aspects[f"{key} of the evaluator"] = {name: report.config.get(key) for name, report in reports.items()}
    for aspect, values in aspects.items():
        texts = {name: fact_text(value) for name, value in values.items()}
        if len(set(texts.values())) > 1:
            yield f"Different {aspect}: {_by_value(texts)}."


def _by_value(values: Mapping[str, str]) -> str:
    """ "1.0 in a, b; 1.1 in c"."""
    names: dict[str, list[str]] = {}
    for name, value in values.items():
        names.setdefault(value, []).append(name)
    return "; ".join(f"{value} in {', '.join(owners)}" for value, owners in names.items())


def _skipped(reports: Mapping[str, Report]) -> Iterator[str]:
    without: dict[str, list[str]] = {}
    for name, report in reports.items():
        for protocol, reason in report.skipped.items():
            without.setdefault(f"{protocol}: {reason}", []).append(name)
    for what, names in without.items():
        yield what if len(names) == len(reports) else f"{what} ({', '.join(names)})"

"""Tables of trajectories: a row for each kind of sequence, a column for each mapper."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from results import table
from trajectory_measures import Measured

from thingmap.mapper.evaluation.uncertainty.consistency import CONFIDENCE, Consistency

OWN_POSES = "own-poses"  # the sequence's own, which errors are counted from: only their surfaces tell something
Results = dict[tuple[str, str], list[Measured]]  # by row and mapper, of all seeds


@dataclass(frozen=True, slots=True)
class Row:
    """Sequences of one kind: their name, the error in mm that is aimed at, and whether the true poses are exact."""

    name: str
    target: float | None
    exact: bool


def describe(
    rows: Sequence[Row], titles: Mapping[str, str], results: Results, left_out: Sequence[str]
) -> dict[str, str]:
    """Markdown by section; `titles` are the mappers' by name, `left_out` says which are not there and why."""
    absent = "".join(f"\n\nNot measured: {why}." for why in left_out)
    mappers = {name: title for name, title in titles.items() if name != OWN_POSES}
    texts = {"errors": _errors(rows, mappers, results)} if mappers else {}
    texts["thickness of surfaces"] = _surfaces(rows, titles, results)
    texts = {title: text + absent for title, text in texts.items()}
    if mappers:
        texts["tracking and loops"] = _tracking(rows, mappers, results)
    honesty = _honesty(rows, mappers, results)
    return {**texts, "honesty of the measured motions": honesty} if honesty else texts


def _errors(rows: Sequence[Row], titles: Mapping[str, str], results: Results) -> str:
    targets = {row.name: "-" if row.target is None else f"{row.target:.0f}" for row in rows}
    parts = [
        "ATE in mm: root mean square over all frames with a pose, aligned by SE(3); mean over a row's scenes, and the "
        "worst of them in brackets.",
        _grid(rows, titles, results, lambda one: 1e3 * one.ate, 1, targets),
        "Relative error of pairs one second apart, mm / degrees, root mean square; mean over scenes.",
        _paired(rows, titles, results),
    ]
    missing = [
        f"{titles[name]} on {row}: {sum(one.frames - one.posed for one in several)}"
        for (row, name), several in results.items()
        if name in titles and any(one.posed < one.frames for one in several)
    ]
    if missing:
        parts.append(f"Frames without a pose, which the errors know nothing of: {'; '.join(missing)}.")
    return "\n\n".join(parts)


def _surfaces(rows: Sequence[Row], titles: Mapping[str, str], results: Results) -> str:
    text = (
        "Median thickness in mm of the surfaces that come of putting all depth images together under a trajectory (see "
        "`surface_thickness.py`; it does not rise above about 50): no true poses play a part. Mean over a row's "
        "scenes, and the worst of them in brackets; - where no place is seen over a long enough time."
    )
    return f"{text}\n\n{_grid(rows, titles, results, _thickness, 2, {})}"


def _grid(
    rows: Sequence[Row],
    titles: Mapping[str, str],
    results: Results,
    of: Callable[[Measured], float | None],
    digits: int,
    targets: Mapping[str, str],
) -> str:
    head = ["sequence", "scenes", *(["aim"] if targets else []), *titles.values()]
    cells = []
    for row in rows:
        values = [[of(one) for one in results[row.name, name]] for name in titles]
        aim = [targets[row.name]] if targets else []
        cells.append([row.name, _count(row, titles, results), *aim, *(mean_and_worst(v, digits) for v in values)])
    return table(head, cells)


def mean_and_worst(values: Sequence[float | None], digits: int) -> str:
    """Such as "4.2 (6.0)": the mean and the largest; the mean alone of one value, "-" where one is not known."""
    known = [value for value in values if value is not None]
    if not known or len(known) < len(values):
        return "-"
    mean = f"{np.mean(known):.{digits}f}"
    return mean if len(known) == 1 else f"{mean} ({max(known):.{digits}f})"


def _thickness(one: Measured) -> float | None:
    return None if one.thickness is None or one.thickness.median is None else 1e3 * one.thickness.median


def _paired(rows: Sequence[Row], titles: Mapping[str, str], results: Results) -> str:
    cells = [[row.name, *(_relative(results[row.name, name]) for name in titles)] for row in rows]
    return table(["sequence", *titles.values()], cells)


def _relative(several: Sequence[Measured]) -> str:
    known = [one.rpe for one in several if one.rpe is not None]
    if not known or len(known) < len(several):
        return "-"
    metres, radians = np.mean(known, axis=0)
    return f"{1e3 * metres:.1f} / {np.degrees(radians):.2f}"


def _tracking(rows: Sequence[Row], titles: Mapping[str, str], results: Results) -> str:
    shown = [name for name in titles if any(_is_told(results[row.name, name]) for row in rows)]
    text = (
        "Frames that were degenerate / lost, and loop closures in the graph at the end + measurements taken out again, "
        "of all scenes together; - where the mapper does not tell."
    )
    cells = [
        [row.name, _count(row, titles, results), *(_tracked(results[row.name, name]) for name in shown)] for row in rows
    ]
    return f"{text}\n\n{table(['sequence', 'scenes', *(titles[name] for name in shown)], cells)}"


def _is_told(several: Sequence[Measured]) -> bool:
    return any(one.outcomes or one.loops is not None for one in several)


def _tracked(several: Sequence[Measured]) -> str:
    def of(outcome: str) -> Any:
        return sum(one.outcomes.get(outcome, 0) for one in several) if all(one.outcomes for one in several) else "-"

    loops = [one.loops for one in several if one.loops is not None]
    closed = f"; {sum(loops)} + {sum(one.dropped for one in several)}" if loops else ""
    return f"{of('degenerate')} / {of('lost')}{closed}"


def _honesty(rows: Sequence[Row], titles: Mapping[str, str], results: Results) -> str:
    """Of the first mapper that has a graph, on sequences whose poses are exact."""
    name = next((name for name in titles if any(one.steps for row in rows for one in results[row.name, name])), None)
    exact = [row for row in rows if row.exact]
    if name is None or not exact:
        return ""
    cells = []
    for row in exact:
        kinds = dict.fromkeys(kind for one in results[row.name, name] for kind in one.steps)
        for kind in kinds:
            found = [one.steps[kind] for one in results[row.name, name] if kind in one.steps]
            if found:
                cells.append([row.name, kind, *_consistency(pool(found))])
    text = (
        f"Motions between keyframes as the ledger of '{titles[name]}' has them, without those taken out again, and "
        "those of its graph in the end (keyframes 1, 5 or 20 apart, by their joint covariance), against the true ones: "
        f"mean NEES per degree of freedom with the {CONFIDENCE:.0%} band it would lie in were errors Gaussian, "
        f"independent and of the stated covariances, and the share inside the {CONFIDENCE:.0%} ellipsoid. "
        "Neighbouring errors are not independent (one map, one scene), so that the true band is wider."
    )
    head = ["sequence", "record", "motions", "NEES / 6", "band", "inside", "verdict"]
    return f"{text}\n\n{table(head, cells)}"


def pool(several: Sequence[Consistency]) -> Consistency:
    """All their errors as one."""
    nees = np.concatenate([one.nees for one in several])
    return Consistency(several[0].dof, nees, sum(one.singular for one in several))


def _consistency(one: Consistency) -> list[str]:
    if one.mean_per_dof is None or one.band is None or one.inside is None:
        return [f"0 (and {one.singular} without an inverse)", "-", "-", "-", "-"]
    low, high = one.band
    return [
        str(len(one.nees)),
        f"{one.mean_per_dof:.2f}",
        f"{low:.2f} to {high:.2f}",
        f"{one.inside:.1%}",
        one.verdict or "-",
    ]


def _count(row: Row, titles: Mapping[str, str], results: Results) -> int:
    return max(len(results[row.name, name]) for name in titles)

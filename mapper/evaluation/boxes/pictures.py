"""The worst boxes of a map, to be shown: what it claims and is not there, and what is there and not claimed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..inputs.case import Case
from ..result import WorstCase
from .image_boxes import box_areas
from .matching import Matches, Outcome


def worst_boxes(case: Case, matches: Sequence[Matches]) -> tuple[WorstCase, ...]:
    """At most `worst_cases` false positives, the most believed first, then as many misses, the best seen first.

    `matches` are of the things of the case's final map; only those with a belief of at least `believed` count. A thing
    that is false in many frames is shown once, where it is largest, and an object that is missed in many frames where
    it is seen best.
    """
    return (*_false(case, matches), *_missed(case, matches))


def _false(case: Case, matches: Sequence[Matches]) -> list[WorstCase]:
    shown: dict[int, tuple[float, WorstCase]] = {}
    for match in matches:
        area = box_areas(match.found.xyxy)
        for box in np.flatnonzero((match.outcome == Outcome.FALSE) & (match.found.score >= case.config.believed)):
            source = int(match.found.source[box])
            if source not in shown or area[box] > shown[source][0]:
                placed = case.things[source]
                text = f"{placed.thing.id}: no {placed.label} here, or a second one on it (belief {placed.belief:.2f})"
                shown[source] = float(area[box]), WorstCase(text, match.frame, None, _box(match.found.xyxy[box]))
    ranked = sorted(shown, key=lambda source: (-case.things[source].belief, source))
    return [shown[source][1] for source in ranked[: case.config.worst_cases]]


def _missed(case: Case, matches: Sequence[Matches]) -> list[WorstCase]:
    shown: dict[int, tuple[tuple[float, float], WorstCase]] = {}
    for match in matches:
        believed = match.found.score >= case.config.believed
        found = np.zeros(len(match.true), dtype=bool)
        found[match.object_row[(match.outcome == Outcome.FOUND) & believed]] = True
        area = box_areas(match.true.whole)
        for row in np.flatnonzero(match.true.fair & ~found):
            rank = (float(match.true.visibility[row]), float(area[row]))
            thing = int(match.true.object_id[row])
            if thing not in shown or rank > shown[thing][0]:
                label = case.truth.classes[match.true.class_id[row]]
                text = f"{label} {thing} is in no box of the map ({rank[0]:.0%} visible)"
                shown[thing] = rank, WorstCase(text, match.frame, _box(match.true.whole[row]), None)
    ranked = sorted(shown.items(), key=lambda item: (-item[1][0][0], -item[1][0][1], item[0]))
    return [picture for _, (_, picture) in ranked[: case.config.worst_cases]]


def _box(xyxy: np.ndarray) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = (float(value) for value in xyxy)
    return x0, y0, x1, y1

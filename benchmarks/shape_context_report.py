"""Tables of the shape-context benchmark, as Table II of Georgakis et al."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from results import table
from shape_context_boxes import Called
from shape_context_job import GRAPHS, JUDGES, TRACKS, JudgedScene, Mode

from thingmap.mapper.evaluation.boxes.curves import Scored, at_threshold, best_threshold, counts
from thingmap.mapper.evaluation.boxes.matching import Matches, scored
from thingmap.mapper.evaluation.points.label_scores import BACKGROUND, LabelScore, score_labels

AIM = 15.0  # points of recall that several views add to one (the paper: 62.8 -> 89.6)
MARGIN = 0.05  # of precision on the threshold scenes: other scenes differ by chance
Thresholds = Mapping[Mode, float | None]

PRECISIONS = (0.6, 0.7, 0.8, 0.85, 0.9)


@dataclass(frozen=True, slots=True)
class Share:
    """Precision and recall of one class; None where undefined."""

    precision: float | None
    recall: float | None


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the table.

    Attributes:
        by_class: of every class that has objects.
        background: None where it is not defined.
    """

    by_class: Mapping[str, Share]
    background: Share | None

    @property
    def mean(self) -> Share:
        """Over the classes of objects; a class that is never called counts as precision 0."""
        return _mean(self.by_class.values())

    @property
    def whole_mean(self) -> Share | None:
        """With the background as one more class, as in the paper; None where that is not defined."""
        return None if self.background is None else _mean([*self.by_class.values(), self.background])

    @property
    def f1(self) -> float:
        """Of the mean precision and recall."""
        precision, recall = self.mean.precision or 0.0, self.mean.recall or 0.0
        return 2.0 * precision * recall / max(precision + recall, 1e-12)


def thresholds(judged: Sequence[JudgedScene]) -> dict[Mode, float | None]:
    """Of every mode the score with the best F1 on these scenes, all classes together.

    Of judged tracks, whose recall is to be compared at no lower precision, the lowest score at which they are more
    precise than single views at theirs, by `MARGIN`; that of the best F1 where none is.
    """
    best = {mode: best_threshold(scored(_matches(judged, mode))) for mode in judged[0].matches}
    precision = at_threshold(scored(_matches(judged, Mode.SINGLE)), best[Mode.SINGLE]).precision
    for mode in JUDGES:
        if mode in best and precision is not None:
            lowest = threshold_at(scored(_matches(judged, mode)), precision + MARGIN)
            best[mode] = best[mode] if lowest is None else lowest
    return best


def threshold_at(claims: Scored, precision: float) -> float | None:
    """The lowest score whose claims are at least so precise; None where none are."""
    passed = counts(claims)
    enough = np.flatnonzero(passed.right >= precision * (passed.right + passed.wrong))
    return float(passed.threshold[enough[-1]]) if len(enough) else None


def box_row(judged: Sequence[JudgedScene], mode: Mode, threshold: float | None) -> Row:
    """What one mode calls at a threshold, over these scenes."""
    matches = _matches(judged, mode)
    by_class = {}
    for number, label in enumerate(judged[0].classes):
        ranked = scored(matches, number)
        if ranked.objects:
            point = at_threshold(ranked, threshold)
            by_class[label] = Share(point.precision, point.recall)
    called = [one for scene in judged for one in scene.called.get(mode, ())]
    return Row(by_class, background_share(called, threshold) if called else None)


def background_share(called: Iterable[Called], threshold: float | None) -> Share:
    """Proposals that are called no object: how many of them are none, and how many of those that are none."""
    several = list(called)
    truly = np.concatenate([one.is_background for one in several])
    silent = np.concatenate([one.score for one in several]) < (np.inf if threshold is None else threshold)
    both = float(np.sum(truly & silent))
    return Share(both / silent.sum() if silent.any() else None, both / truly.sum() if truly.any() else None)


def point_row(judged: Sequence[JudgedScene], mode: Mode) -> Row:
    """Labelled points of one mapper, those of all scenes together."""
    labelled = [scene.points[mode] for scene in judged]
    found, true = (np.concatenate([getattr(one, name) for one in labelled]) for name in ("found", "true"))
    scores = score_labels(found, true, judged[0].classes)
    by_class = {score.name: _share(score) for score in scores.objects if score.points}
    return Row(by_class, _share(scores.background))


def result_table(rows: Mapping[str, Row]) -> str:
    """Precision/recall (%) by class."""
    first = next(iter(rows.values()))
    labels = list(first.by_class)
    head = ("", *labels, BACKGROUND, "mean of objects", "with background")
    lines = [
        (name, *(_shown(row.by_class.get(label)) for label in labels), *map(_shown, (row.background, row.mean)),
         _shown(row.whole_mean))
        for name, row in rows.items()
    ]  # fmt: skip
    return table(head, lines)


def level_table(groups: Mapping[str, Mapping[str, Row]]) -> str:
    """Means over the classes of objects, a column for each level of clutter."""
    names = list(next(iter(groups.values())))
    lines = [(name, *(_shown(rows[name].mean) for rows in groups.values())) for name in names]
    return table(("", *groups), lines)


def recall_table(judged: Sequence[JudgedScene], precisions: Sequence[float] = PRECISIONS) -> str:
    """The greatest recall (%) of each mode at precisions, all classes together, by hindsight; "-" where none is."""
    lines = []
    for mode in judged[0].matches:
        ranked = scored(_matches(judged, mode))
        right = np.cumsum(ranked.right[np.argsort(-ranked.scores, kind="stable")])
        precision, recall = right / np.arange(1, len(right) + 1), right / max(ranked.objects, 1)
        most = [recall[precision >= least].max(initial=0.0) for least in precisions]
        lines.append((mode, *(f"{100.0 * value:.1f}" if value > 0.0 else "-" for value in most)))
    return table(("", *(f"precision {100.0 * least:.0f} %" for least in precisions)), lines)


def verdicts(rows: Mapping[str, Row]) -> str:
    """What the paper claims, and what the graph should do, in lines; of poses given and estimated."""
    single, lines = rows[Mode.SINGLE], []
    for mode in (*TRACKS, *JUDGES):
        gain = _difference(rows[mode], single, lambda share: share.recall)
        change = _difference(rows[mode], single, lambda share: share.precision)
        reached = gain >= AIM and change >= 0.0
        lines.append(
            f"- {mode}: recall {gain:+.1f} points against single views, precision {change:+.1f}: "
            f"{'reaches' if reached else 'does NOT reach'} {AIM:g} at no lower precision."
        )
    for mode, graph in zip(TRACKS, GRAPHS, strict=True):
        several, full = rows[mode], rows[graph]
        recall = _difference(full, several, lambda share: share.recall)
        precision = _difference(full, several, lambda share: share.precision)
        better = full.f1 >= several.f1
        lines.append(
            f"- {graph} against {mode}: recall {recall:+.1f} points, precision {precision:+.1f}, F1 of the means "
            f"{100.0 * (full.f1 - several.f1):+.1f}: {'at least as good' if better else 'NOT as good'}."
        )
    return "\n".join(lines)


def _difference(row: Row, other: Row, part: Callable[[Share], float | None]) -> float:
    return 100.0 * ((part(row.mean) or 0.0) - (part(other.mean) or 0.0))


def _matches(judged: Sequence[JudgedScene], mode: Mode) -> list[Matches]:
    return [match for scene in judged for match in scene.matches[mode]]


def _share(score: LabelScore) -> Share:
    return Share(score.precision, score.recall)


def _mean(shares: Iterable[Share]) -> Share:
    several = list(shares)
    recalls = [share.recall for share in several if share.recall is not None]
    precision = float(np.mean([share.precision or 0.0 for share in several])) if several else None
    return Share(precision, float(np.mean(recalls)) if recalls else None)


def _shown(share: Share | None) -> str:
    if share is None:
        return "-"
    return " / ".join("-" if value is None else f"{100.0 * value:.1f}" for value in (share.precision, share.recall))

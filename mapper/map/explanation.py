"""Why a map says what it says of a thing: every view on record, and what it spoke for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ...datasets.errors import UserError
from ...detectors.detections import Part
from ..estimation.view_log import FAINT, Verdict, ViewNote
from .text import probability_text
from .views_file import ThingViews

PART_NAMES = tuple(part.name.lower() for part in Part)
NOT_INDEPENDENT = "each view by itself; views are not independent, ratios do not add up"
LISTED = 12  # views in a table, unless asked otherwise
WIDTH = 100  # columns of a table; below `NARROW` the last one says why, but not what follows from it
NARROW = 92
FRAME_WIDTH = 20  # columns of a frame's name; of a longer one the end is shown
SUPPORTED, CONTRADICTED, SAID_NOTHING = "supported", "contradicted", "said nothing"
REASONS = {  # what a view did, and why
    Verdict.SUPPORTED: (SUPPORTED, "found"),
    Verdict.OCCLUDED: (SAID_NOTHING, "hidden"),
    Verdict.MISSED: (CONTRADICTED, "missed"),
    Verdict.SEEN_THROUGH: (CONTRADICTED, "seen through"),
    Verdict.UNCLEAR: (SAID_NOTHING, "unclear"),
}


@dataclass(frozen=True, slots=True, eq=False)
class ViewExplanation:
    """What one view said about a thing and a label.

    Attributes:
        keyframe, stamp, frame: which view: number in the graph, seconds, name of the frame.
        visible: part name -> share of it that the camera saw, in [0, 1].
        score: best score of the detection; None without one.
        template: part that the detection shows; None without one.
        found_as: class of that score; None without one.
        log_ratio: nats: log p(view | such a thing) - log p(view | no thing), for the label, times the view's weight.
        weight: in [0, 1]: how new the view was.
        verdict: what it said about the thing, whatever its class.
        text: the same as a sentence.
    """

    keyframe: int
    stamp: float
    frame: str
    visible: Mapping[str, float]
    score: float | None
    template: str | None
    found_as: str | None
    log_ratio: float
    weight: float
    verdict: Verdict
    text: str

    @property
    def says(self) -> str:
        """ "supported", "contradicted" or "said nothing"."""
        return REASONS[self.verdict][0]

    @property
    def strength(self) -> tuple[float, bool, float]:
        """By which views are ranked: the log ratio's size, then whether it said anything, then what was to be seen."""
        return abs(self.log_ratio), self.says != SAID_NOTHING, self.visible["whole"]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, numbers to four digits after the point: no more are kept."""
        values = {**asdict(self), "visible": {part: round(share, 4) for part, share in self.visible.items()}}
        for name in ("score", "log_ratio", "weight"):
            values[name] = None if values[name] is None else round(values[name], 4)
        return {"says": self.says, **values, "verdict": self.verdict.name.lower()}


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """Every view on record of a thing, and what it said for or against a label; as text it is a short table.

    Attributes:
        thing_id: whose.
        label: which.
        probability: P(it exists and is a `label`).
        views: strongest first or in time order, as asked for.
        totals: number of views by verdict, those that are only counted among them; every verdict is a key.
        left_out: how many views said nothing and are not among `views`.
    """

    thing_id: str
    label: str
    probability: float
    views: tuple[ViewExplanation, ...]
    totals: Mapping[Verdict, int]
    left_out: int

    def __len__(self) -> int:
        return len(self.views)

    def __iter__(self) -> Iterator[ViewExplanation]:
        return iter(self.views)

    def __str__(self) -> str:
        return self.table()

    def summary(self) -> str:
        """How many views supported, contradicted, and said nothing, and why."""
        parts = []
        for side in (SUPPORTED, CONTRADICTED, SAID_NOTHING):
            counts = [(self.totals[verdict], why) for verdict, (says, why) in REASONS.items() if says == side]
            reasons = ", ".join(f"{count} {why}" for count, why in counts if count and side != SUPPORTED)
            parts.append(f"{sum(count for count, _ in counts)} {side}" + (f" ({reasons})" if reasons else ""))
        return f"{sum(self.totals.values())} views: " + ", ".join(parts)

    def table(self, limit: int = LISTED, width: int = WIDTH) -> str:
        """The first `limit` views, one a line of at most `width` columns where that can be, and what is not shown."""
        lines = [f"{self.thing_id} as {self.label} ({probability_text(self.probability)})", self.summary()]
        shown, rest = self.views[:limit], self.views[limit:]
        if shown:
            lines += _columns([_cells(view, self.label, width < NARROW) for view in shown])
        if more := len(rest) + self.left_out:
            hidden = self.totals[Verdict.OCCLUDED] - sum(view.verdict is Verdict.OCCLUDED for view in shown)
            lines.append(f"and {more} more {'view' if more == 1 else 'views'}, {hidden} of them hidden")
        if shown:
            lines.append(NOT_INDEPENDENT)
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "label": self.label,
            "totals": {verdict.name.lower(): self.totals[verdict] for verdict in Verdict},
            "left_out": self.left_out,
            "views": [view.to_dict() for view in self.views],
        }


def explain_views(
    views: ThingViews, thing_id: str, label: str, probability: float, in_time_order: bool = False
) -> Explanation:
    """What the views of a thing said about a label.

    Raises:
        UserError: no class is named so, upper and lower case being the same.
    """
    names = [name.casefold() for name in views.classes]
    if label.casefold() not in names:
        known = ", ".join(views.classes[:30]) or "none"
        raise UserError(f"{thing_id}: no class {label!r} was looked for in its views; choose one of: {known}")
    column = names.index(label.casefold())
    explained = [_explain_note(note, views.classes, column) for note in views.notes]
    totals = {verdict: views.left_out.get(verdict, 0) for verdict in Verdict}
    for note in views.notes:
        totals[note.verdict] += 1
    if not in_time_order:  # a stable sort: equally strong views stay in time order
        explained.sort(key=lambda view: view.strength, reverse=True)
    left_out = sum(views.left_out.values())
    return Explanation(thing_id, views.classes[column], probability, tuple(explained), totals, left_out)


def _explain_note(note: ViewNote, classes: tuple[str, ...], column: int) -> ViewExplanation:
    return ViewExplanation(
        keyframe=note.keyframe,
        stamp=note.stamp,
        frame=note.frame,
        visible={name: float(share) for name, share in zip(PART_NAMES, note.visible, strict=True)},
        score=float(note.score) if math.isfinite(note.score) else None,
        template=PART_NAMES[note.part] if note.part >= 0 else None,
        found_as=classes[note.class_id] if note.class_id >= 0 else None,
        log_ratio=float(note.log_ratio[column]),
        weight=float(note.weight),
        verdict=note.verdict,
        text=_sentence(note, classes, column),
    )


def _sentence(note: ViewNote, classes: tuple[str, ...], column: int) -> str:
    says, ratio = REASONS[note.verdict][0], float(note.log_ratio[column])
    seen = f"{100.0 * note.visible[Part.WHOLE]:.0f} % of it visible"
    name = f" as {classes[note.class_id]}" if note.class_id >= 0 else ""
    score = f" with a score of {probability_text(note.score)}" if math.isfinite(note.score) else ""
    part = f" by its {PART_NAMES[note.part]}" if note.part > Part.WHOLE else ""
    why = {
        Verdict.SUPPORTED: f"found{name}{score}{part}, {seen}",
        Verdict.OCCLUDED: f"hidden, {seen}",
        Verdict.MISSED: f"not found although {seen}",
        Verdict.SEEN_THROUGH: "the camera looked through its volume",
        Verdict.UNCLEAR: f"not found, nor was that to be expected with {seen}",
    }
    # a thing that is found may be of another class, and depths may show the surface of what is not found
    expected = {SUPPORTED: ratio > -FAINT, CONTRADICTED: ratio < FAINT, SAID_NOTHING: abs(ratio) < FAINT}[says]
    side = "for" if ratio > 0.0 else "against"
    return f"{says}: {why[note.verdict]}" + ("" if expected else f"; all in all it speaks {side} {classes[column]}")


def _cells(view: ViewExplanation, label: str, narrow: bool) -> tuple[str, ...]:
    name = view.frame if len(view.frame) <= FRAME_WIDTH else "…" + view.frame[1 - FRAME_WIDTH :]
    visible = (f"{100.0 * view.visible[part]:.0f}%" for part in PART_NAMES)
    score = "-" if view.score is None else f"{view.score:.2f}"
    says, why = REASONS[view.verdict]
    if view.verdict is Verdict.SUPPORTED:
        other = view.found_as not in (None, label)
        says = f"found as {view.found_as}" if other and narrow else f"{says} as {view.found_as}" if other else says
    else:
        says = why if narrow else f"{says}: {why}"
    ratio = f"{view.log_ratio:+.2f}" if abs(view.log_ratio) >= 0.005 else "0.00"
    return name, f"{view.stamp:.2f}", *visible, score, ratio, says


def _columns(rows: list[tuple[str, ...]]) -> list[str]:
    """Lines of a table under two lines of heads: the first and the last column to the left, the others to the right."""
    above = ("", "", "visible:", *[""] * (len(PART_NAMES) - 1), "", "log", "")
    heads = ("frame", "stamp", *PART_NAMES, "score", "ratio", "the view")
    table = [above, heads, *rows]
    widths = [max(map(len, column)) for column in zip(*table[1:], strict=True)]
    ends = 0, len(heads) - 1
    lines = []
    for row in table:
        sides = (str.ljust if k in ends else str.rjust for k in range(len(row)))
        cells = (side(cell, width) for side, cell, width in zip(sides, row, widths, strict=True))
        lines.append(" ".join(cells).rstrip())
    return lines

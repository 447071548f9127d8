"""Why a map says what it says of a thing: every view on record, and what it spoke for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from ...detectors.detections import Part
from ..estimation.view_log import Verdict
from .text import probability_text

if TYPE_CHECKING:
    from ..edits.edit import Edit

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
        views_label: of which label the views speak: `label`, unless only a person said that; then the likeliest class
            that was looked for.
        edits: what people changed of the thing, the oldest first; no view says anything of that.
        views: strongest first or in time order, as asked for.
        totals: number of views by verdict, those that are only counted among them; every verdict is a key.
        left_out: how many views said nothing and are not among `views`.
    """

    thing_id: str
    label: str
    probability: float
    views_label: str
    edits: tuple[Edit, ...]
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
        """What people said, and the first `limit` views, one a line of at most `width` columns where that can be, and
        what is not shown."""
        lines = [f"{self.thing_id} as {self.label} ({probability_text(self.probability)})"]
        lines += [
            f"{edit.who} said on {edit.when}: {edit}" + (f" ({edit.why})" if edit.why else "") for edit in self.edits
        ]
        if self.views_label != self.label:
            lines.append(
                f"no view was asked about {self.label}, which only people said; they speak of {self.views_label}"
            )
        lines.append(self.summary())
        shown, rest = self.views[:limit], self.views[limit:]
        if shown:
            lines += _columns([_cells(view, self.views_label, width < NARROW) for view in shown])
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
            "views_label": self.views_label,
            "edits": [edit.to_dict() for edit in self.edits],
            "totals": {verdict.name.lower(): self.totals[verdict] for verdict in Verdict},
            "left_out": self.left_out,
            "views": [view.to_dict() for view in self.views],
        }


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

"""From what was noted of every view of a thing to why it is taken for what it is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ...datasets.errors import UserError
from ...detectors.detections import Part
from ..estimation.view_log import FAINT, Verdict, ViewNote
from .explanation import CONTRADICTED, PART_NAMES, REASONS, SAID_NOTHING, SUPPORTED, Explanation, ViewExplanation
from .text import probability_text

if TYPE_CHECKING:
    from .thing import Thing
    from .views_file import ThingViews


def explain_thing(thing: Thing, views: ThingViews, label: str, in_time_order: bool = False) -> Explanation:
    """What the views of a thing, and the people who edited it, said about a label.

    Raises:
        UserError: no class is named so, upper and lower case being the same, nor did a person say so.
    """
    known = {name.casefold(): column for column, name in enumerate(views.classes)}
    column = known.get(label.casefold())
    said = label if column is None else views.classes[column]
    if column is None:
        if not views.classes or not any(_same(edit.label, label) for edit in thing.edits):
            names = ", ".join(views.classes[:30]) or "none"
            raise UserError(f"{thing.id}: no class {label!r} was looked for in its views; choose one of: {names}")
        column = max(range(len(views.classes)), key=lambda k: thing.belief(views.classes[k]))
    explained = [_explain_note(note, views.classes, column) for note in views.notes]
    totals = {verdict: views.left_out.get(verdict, 0) for verdict in Verdict}
    for note in views.notes:
        totals[note.verdict] += 1
    if not in_time_order:  # a stable sort: equally strong views stay in time order
        explained.sort(key=lambda view: view.strength, reverse=True)
    return Explanation(
        thing_id=thing.id,
        label=said,
        probability=thing.belief(label),
        views_label=views.classes[column],
        edits=thing.edits,
        views=tuple(explained),
        totals=totals,
        left_out=sum(views.left_out.values()),
    )


def _same(said: str | None, label: str) -> bool:
    return said is not None and said.casefold() == label.casefold()


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

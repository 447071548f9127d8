"""Which question the arguments of `thingmap query` ask, and asking it of a map."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...datasets.errors import UserError
from .query_places import pose_of
from .query_sentence import FORMS, Kind, is_question, parse_sentence

if TYPE_CHECKING:
    from ..map.object_map import ObjectMap

RELATIONS = {
    Kind.ON: ("on", "on"),
    Kind.SUPPORTS: ("supports_of", "below"),
    Kind.INSIDE: ("inside", "inside"),
    Kind.UNDER: ("under", "under"),
    Kind.NEXT_TO: ("next_to", "next to"),
}  # the method, and how the relation reads
NEEDS_LABEL = 'say what to look for: a LABEL such as cup, a question such as "what is on the table?", or an option'


@dataclass(frozen=True, slots=True)
class Question:
    """One question to a map.

    Attributes:
        kind: of question.
        subject: thing, label, region or written pose that the kind is about; for `FIND` the words.
        label: words that answers must be; None for anything.
        near: (x, y, z) metres, from which distances are measured; only of `FIND`.
        min_probability: of an answer.
    """

    kind: Kind
    subject: Any
    label: str | None
    near: tuple[float, float, float] | None
    min_probability: float


def question_of(
    label: str | None,
    asked: dict[Kind, Any],
    near: tuple[float, float, float] | None,
    min_probability: float,
    object_map: ObjectMap,
) -> Question:
    """The one question that the arguments ask.

    Args:
        label: LABEL: a label, other words, or a sentence.
        asked: the options that were given, with their values.
        near: of --near.
        min_probability: of --min-probability.
        object_map: a text that is a label, a name or an id in it is no sentence.

    Raises:
        UserError: none is asked, or several; a sentence is not understood, or --near does not go with the question.
    """
    if len(asked) > 1:
        raise UserError(f"{' and '.join(kind.value for kind in asked)} are different questions; ask one at a time")
    if label is not None and not object_map.knows(label) and not object_map.called(label):
        sentence = parse_sentence(label)
        if sentence is not None and not asked:
            subject = sentence.phrase if object_map.called(sentence.phrase) else sentence.subject
            asked, label = {sentence.kind: subject}, sentence.label
            if sentence.kind is Kind.FIND:
                asked, label = {}, subject
        elif is_question(label):
            raise UserError(f"{label!r} is not understood; the questions are: {'  '.join(FORMS)}")
    if not asked and label is None:
        raise UserError(NEEDS_LABEL)
    ((kind, subject),) = asked.items() or {Kind.FIND: label}.items()
    if near is not None and kind is not Kind.FIND:
        raise UserError(f"--near goes with a LABEL alone, not with {kind.value}")
    if label is not None and kind in (Kind.LAST_SEEN, Kind.EXPECTED, Kind.LOOK):
        raise UserError(f"{kind.value} takes no LABEL besides, but {label!r} was given; leave it out")
    return Question(kind, subject, label, near, min_probability)


def remark(question: Question, object_map: ObjectMap) -> str | None:
    """What to tell the user of how the words were understood; None where they are a label, a name or an id.

    Raises:
        UserError: the map knows no such label or thing.
    """
    notes = []
    if question.label is not None and not object_map.called(question.label):
        object_map.labels_of(question.label)
        if not object_map.knows(question.label):
            notes.append(str(object_map.understand(question.label)))
    if question.kind in (Kind.ON, Kind.UNDER, Kind.NEXT_TO):
        tops = object_map.table_tops(question.subject)
        if tops:
            what = "level surface" if len(tops) == 1 else f"{len(tops)} level surfaces"
            notes.append(f"no {question.subject} in the map: taken as the {what} as high as a table in its cloud")
    return "\n".join(notes) or None


def ask(question: Question, object_map: ObjectMap, out: Path) -> list[Any]:
    """The answers, in their order: of the types that the methods of `ObjectMap` give; see there for what they raise."""
    kind, subject, label, least = question.kind, question.subject, question.label, question.min_probability
    if kind is Kind.FIND:
        if question.near is not None:
            return object_map.nearest(question.near, label, min_probability=least)
        return object_map.find(str(label), least)
    if kind in RELATIONS:
        return getattr(object_map, RELATIONS[kind][0])(subject, label, least)
    if kind is Kind.WITHIN:
        return object_map.within(subject, label, least)
    if kind is Kind.LAST_SEEN:
        return object_map.last_seen(subject, least)
    if kind is Kind.LOOK:
        return object_map.where_to_look(subject)
    pose = pose_of(subject, out, kind.value)
    if kind is Kind.EXPECTED:
        return [seen for seen in object_map.expected_at(pose) if seen.probability >= least]
    seen = object_map.visible_from(pose, label=label)
    return [sighting for sighting in seen if sighting.probability >= least]


def nothing_found(question: Question, object_map: ObjectMap) -> str:
    """What is said in place of no answers."""
    what = question.label or "thing"
    least, count = f"with a probability of at least {question.min_probability:g}", len(object_map)
    if question.kind is Kind.FIND:
        return f"no {what} {least} among {count} things"
    if question.kind is Kind.SUPPORTS:
        return f"no {what} carries {question.subject} {least}: it may stand on the floor, or on what is not in the map"
    if question.kind in RELATIONS:
        return f"no {what} {RELATIONS[question.kind][1]} {question.subject} {least} among {count} things"
    if question.kind is Kind.LOOK:
        return f"no viewpoint tells more of {question.subject}: what can be known from here on is known"
    return f"no {what} {least} for {question.kind.value} among {count} things"

"""Plain questions of a few forms, by a small grammar: the same words always mean the same."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum

FORMS = (
    "where is X?",
    "what is on X?",
    "what is in X?",
    "what is under X?",
    "what is next to X?",
    "what does X stand on?",
    "when was X last seen?",
    "where should I look for X?",
)


class Kind(Enum):
    """What can be asked; the values are the options of `thingmap query`."""

    FIND = "find"
    ON = "--on"
    SUPPORTS = "--supports-of"
    INSIDE = "--inside"
    UNDER = "--under"
    NEXT_TO = "--next-to"
    WITHIN = "--within-..."
    LAST_SEEN = "--last-seen"
    VISIBLE = "--visible-from"
    EXPECTED = "--expected-at"
    LOOK = "--where-to-look"


@dataclass(frozen=True, slots=True)
class Sentence:
    """What a sentence asks.

    Attributes:
        kind: of question.
        subject: the X of the form, as it was written but for an article.
        phrase: the X with its article: "my mug" may be a name.
        label: words for what is asked for ("which cups are on X"); None for anything.
    """

    kind: Kind
    subject: str
    phrase: str
    label: str | None = None


RELATIONS = {
    Kind.ON: "on|on top of",
    Kind.INSIDE: "in|inside|within",
    Kind.UNDER: "under|underneath|below|beneath",
    Kind.NEXT_TO: "next to|near|beside|by",
}
STANDS = r"(?:standing|stand|stands|resting|rest|rests|lying|lie|lies|sitting|sit|sits)"
ARE = r"(?:is|are)"
THE = r"(?P<the>(?:the |an |a |my |your |our )?)"
PATTERNS: tuple[tuple[str, Kind], ...] = (
    (rf"(?:when|where) (?:was|were) {THE}(?P<x>.+?) (?:last seen|seen last)", Kind.LAST_SEEN),
    (rf"where (?:should i|to|do i|must i) look for {THE}(?P<x>.+)", Kind.LOOK),
    (rf"where {ARE} {THE}(?P<x>.+)", Kind.FIND),
    (rf"{ARE} there (?:any )?{THE}(?P<x>.+)", Kind.FIND),
    (rf"(?:find|show|show me) {THE}(?P<x>.+)", Kind.FIND),
    (rf"what (?:do|does) {THE}(?P<x>.+?) {STANDS} on", Kind.SUPPORTS),
    (rf"what {ARE} {THE}(?P<x>.+?)(?: {STANDS})? on", Kind.SUPPORTS),
    *(
        (rf"(?:what|which)(?: (?P<label>.+?))? {ARE} (?:{STANDS} )?(?:{words}) {THE}(?P<x>.+)", kind)
        for kind, words in RELATIONS.items()
    ),
)
IS = re.compile(r"^\s*(what|where|which|when)'s ", re.IGNORECASE)
QUESTION = re.compile(r"(?:what|which|where|when|who|whose|how|why|is|are|does|do|can)\b", re.IGNORECASE)


def parse_sentence(text: str) -> Sentence | None:
    """What a sentence of one of the `FORMS`, or of their variants, asks; None where it has none of these forms."""
    plain = " ".join(re.sub(IS, r"\1 is ", text).split()).strip(" ?!.")
    for pattern, kind in PATTERNS:
        found = re.fullmatch(pattern, plain, re.IGNORECASE)
        if found:
            return Sentence(kind, found["x"], found["the"] + found["x"], found.groupdict().get("label"))
    return None


def is_question(text: str) -> bool:
    """Whether a text is meant as a question, understood or not: it begins as one, or ends with a question mark."""
    return (bool(QUESTION.match(text.strip())) and len(text.split()) > 1) or text.rstrip().endswith("?")

"""From words to the labels of a map, with no model: always the same way, and always said which way."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from .synonyms import normal_words, synonyms

SIMILAR = 0.82  # difflib's ratio from which on a word is taken as another one misspelt: one letter wrong in six
ARTICLES = frozenset({"a", "an", "the", "my", "your", "our", "some", "any", "that", "this", "all"})

Words = tuple[str, ...]


class Match(Enum):
    """How a text was understood; the first that applies counts."""

    LABEL = "a label of the map"
    SYNONYM = "another word for a label"
    WORDS = "a label, or another word for one, among the words"
    SPELLING = "a label or another word for one, written otherwise"
    NONE = "not understood"


@dataclass(frozen=True, slots=True)
class LabelMatch:
    """The labels that a text means.

    Attributes:
        text: as it was asked.
        labels: of the map, in its order; none where nothing was understood.
        how: they were found.
        understood: the words that led to them, as they were understood.
        ignored: words of the text that say more than the map knows, such as "red".
    """

    text: str
    labels: tuple[str, ...]
    how: Match
    understood: str = ""
    ignored: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.how is Match.NONE:
            return f"{self.text!r}: not understood"
        labels = " or ".join(self.labels)
        unknown = f"; the map knows nothing of {', '.join(map(repr, self.ignored))}" if self.ignored else ""
        return f"{self.text!r} is taken as {labels}{unknown}"


def match_labels(text: str, classes: Iterable[str]) -> LabelMatch:
    """The labels among `classes` that `text` means.

    In this order: a label itself, upper and lower case being the same; a label in another form (plural, hyphens) or a
    synonym, or the last word of a label ("box" for "cereal box"); the same for part of the words, the longest part
    first and of equally long ones the last ("the red mug": mug); a word that is spelt nearly so.
    """
    labels = tuple(dict.fromkeys(classes))
    exact = tuple(label for label in labels if label.casefold() == text.strip().casefold())
    if exact:
        return LabelMatch(text, exact, Match.LABEL, text.strip())
    words = tuple(word for word in normal_words(text) if word not in ARTICLES)
    by_words = [(label, normal_words(label)) for label in labels]
    for length in range(len(words), 0, -1):
        for start in range(len(words) - length, -1, -1):
            part = words[start : start + length]
            meant = _meant(part, by_words)
            if meant:
                how = Match.SYNONYM if length == len(words) else Match.WORDS
                return LabelMatch(text, meant, how, " ".join(part), words[:start] + words[start + length :])
    return _nearly(text, words, by_words)


def _meant(part: Words, by_words: list[tuple[str, Words]]) -> tuple[str, ...]:
    """Labels that are this phrase; else its synonyms; else those of which it is the end."""
    same = tuple(label for label, words in by_words if words == part)
    if same:
        return same
    phrases = synonyms().of(part)
    other = tuple(label for label, words in by_words if words in phrases)
    ending = tuple(label for label, words in by_words if words[-len(part) :] == part)
    return tuple(label for label, _ in by_words if label in {*other, *ending})


def _nearly(text: str, words: Words, by_words: list[tuple[str, Words]]) -> LabelMatch:
    """The whole text, then each word from the last one on, against labels and their synonyms as they are spelt."""
    known = {" ".join(phrase) for _, own in by_words for phrase in synonyms().of(own)}
    tried = dict.fromkeys([words, *((word,) for word in reversed(words))])
    for part in tried:
        near = difflib.get_close_matches(" ".join(part), sorted(known), n=1, cutoff=SIMILAR)
        if near:
            ignored = tuple(word for word in words if word not in part)
            return LabelMatch(text, _meant(tuple(near[0].split()), by_words), Match.SPELLING, near[0], ignored)
    return LabelMatch(text, (), Match.NONE)

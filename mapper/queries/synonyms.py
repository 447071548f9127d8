"""What else things are called: the groups of `synonyms.yaml`, and words in a form in which they can be compared."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

Words = tuple[str, ...]

FILE = Path(__file__).with_name("synonyms.yaml")
KEPT_S = ("ss", "us", "is")  # glass, cactus, tennis: no plurals
PLURALS = (("ies", "y"), ("shes", "sh"), ("ches", "ch"), ("sses", "ss"), ("xes", "x"), ("oes", "o"), ("s", ""))
IRREGULAR = {
    **{"knives": "knife", "shelves": "shelf", "loaves": "loaf", "mice": "mouse", "people": "person"},
    **{"men": "man", "women": "woman", "children": "child", "shoes": "shoe", "buses": "bus", "cookies": "cookie"},
}
NOT_PLURAL = {"scissors", "skis", "headphones", "pants", "shorts", "lens"}


@dataclass(frozen=True, slots=True, eq=False)
class Synonyms:
    """What `synonyms.yaml` says, in the form of `normal_words`.

    Attributes:
        groups: each a set of phrases for the same things.
        flat_topped: phrases for what is hollow below a flat top, groups written out.
        on_floor: phrases for what stands on the floor, groups written out.
        table_tops: phrases for a level surface at a table's height, groups written out.
    """

    groups: tuple[frozenset[Words], ...]
    flat_topped: frozenset[Words]
    on_floor: frozenset[Words]
    table_tops: frozenset[Words]

    def of(self, words: Words) -> frozenset[Words]:
        """All phrases in the groups that hold a phrase, and that phrase."""
        return _alike(self.groups, words) | {words}


@cache
def synonyms() -> Synonyms:
    """The file's content, read once."""
    document = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    groups = tuple(frozenset(map(normal_words, group)) for group in document["groups"])
    lists = ("flat_topped", "on_floor", "table_tops")
    return Synonyms(groups, *(_with_synonyms(groups, document[name]) for name in lists))


def _with_synonyms(groups: tuple[frozenset[Words], ...], names: Iterable[str]) -> frozenset[Words]:
    return frozenset().union(*({words} | _alike(groups, words) for words in map(normal_words, names)))


def _alike(groups: tuple[frozenset[Words], ...], words: Words) -> frozenset[Words]:
    return frozenset().union(*(group for group in groups if words in group))


@cache
def normal_words(text: str) -> Words:
    """Words of a text in lower case and in the singular; hyphens and underscores part words as blanks do."""
    return tuple(_singular(word) for word in re.findall(r"[^\W_]+", text.casefold().replace("'s", "")))


def _singular(word: str) -> str:
    if word in IRREGULAR or word in NOT_PLURAL or word.endswith(KEPT_S):
        return IRREGULAR.get(word, word)
    for ending, instead in PLURALS:
        if word.endswith(ending) and len(word) > len(ending) + 1:
            return word.removesuffix(ending) + instead
    return word

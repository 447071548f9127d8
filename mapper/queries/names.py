"""What things are called."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable

import numpy as np

from ...datasets.errors import UserError
from ..map.explanation import Explanation
from ..map.thing import Thing
from .answer import Answer
from .embeddings import TEMPERATURE, find_by_embedding
from .label_match import LabelMatch, match_labels
from .map_content import MapContent

LISTED = 30  # labels named in a message
ID = re.compile(r"thing-\d+")


class NameQuestions(MapContent):
    """Questions about labels and other words."""

    __slots__ = ()

    def knows(self, label: str) -> bool:
        """Whether `label`, upper and lower case being the same, is a class of this map."""
        return label.casefold() in {name.casefold() for name in self.classes}

    def understand(self, text: str) -> LabelMatch:
        """The labels of this map that `text` means, and how it was understood; see `match_labels`."""
        return match_labels(text, self.classes)

    def called(self, text: str) -> tuple[Thing, ...]:
        """Things that `text` means whatever they are: by id, or by the very name that somebody gave; none where it is a
        label of the map, or nothing of that kind.

        Raises:
            UserError: it is written as an id is, and there is no such thing.
        """
        text = text.strip()
        if self.knows(text):
            return ()
        own = self._by_id(text)
        return self.index.named(text) if own is None else (own,)

    def belief_of(self, text: str | None) -> Callable[[Thing], float]:
        """P(a thing exists and is what `text` means) of things of this map: one that is called so, or one of the labels
        that are understood; None for anything. Raises `UserError` as `called`."""
        if text is None:
            return lambda thing: thing.existence
        called = {thing.id for thing in self.called(text)}
        if called:
            return lambda thing: thing.existence if thing.id in called else 0.0
        labels = self.understand(text).labels
        return lambda thing: belief_in(thing, labels)

    def find(
        self,
        text: str,
        min_probability: float = 0.0,
        *,
        encoder: Callable[[str], np.ndarray] | None = None,
        temperature: float = TEMPERATURE,
    ) -> list[Answer]:
        """Things that `text` may mean, likeliest first.

        An id or a given name means the thing that has it, ranked by its existence. Any other text is understood as
        labels (`understand`), and things are ranked by existence times the probability of *those* labels in their own
        posterior, so a thing that is likelier a bowl is still found as a cup. Things that cannot be one are left out;
        a text that is not understood gives an empty list.

        Args:
            text: a label, a synonym, words that hold one, the name given to a thing, or an id.
            min_probability: of an answer.
            encoder: turns a text into an embedding (D,) of the space of the things' own. With one, things are ranked by
                how alike the embeddings are, labels and names play no part; see `find_by_embedding` for what the
                probability then is.
            temperature: of that ranking.

        Raises:
            UserError: `text` is written as an id is, and there is no such thing; with `encoder`, no thing has an
                embedding, or they are of other lengths.
        """
        if encoder is not None:
            answers = find_by_embedding(self.things, text, encoder, temperature)
        else:
            called = self.called(text)
            if not called:
                return self.index.ranked(self.understand(text).labels, min_probability)
            answers = [Answer(thing, thing.existence) for thing in called]
        answers = [answer for answer in answers if answer.probability >= min_probability and answer.probability > 0.0]
        return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))

    def explain(self, thing: Thing | str, label: str | None = None) -> Explanation:
        """`Thing.explain` of a thing of this map or its id; raises `UserError` where there is no such thing."""
        return self.thing(thing).explain(label)

    def _by_id(self, which: Thing | str) -> Thing | None:
        """The thing that is meant where `which` is one or is written as an id is, else None; `UserError` as `thing`."""
        is_id = isinstance(which, Thing) or ID.fullmatch(which) or self.index.thing(which) is not None
        return self.thing(which) if is_id else None

    def labels_of(self, text: str) -> tuple[str, ...]:
        """The labels that a text means; raises `UserError` with a guess and the list of labels where there are none."""
        found = self.understand(text)
        if found.labels:
            return found.labels
        classes = sorted(self.classes)
        near = difflib.get_close_matches(text.casefold(), classes, n=1)
        guess = f"did you mean {near[0]}? " if near else ""
        more = f" and {len(classes) - LISTED} more" if len(classes) > LISTED else ""
        known = ", ".join(classes[:LISTED]) or "none"
        raise UserError(f"no label {text!r} in this map; {guess}its labels are: {known}{more}")


def belief_in(thing: Thing, labels: Iterable[str]) -> float:
    """P(it exists and is one of `labels`; upper and lower case are the same)."""
    return min(sum(map(thing.belief, dict.fromkeys(label.casefold() for label in labels))), thing.existence)

"""What things are called."""

from __future__ import annotations

from .answer import Answer
from .map_content import MapContent


class NameQuestions(MapContent):
    """Questions about labels."""

    __slots__ = ()

    def knows(self, label: str) -> bool:
        """Whether `label`, upper and lower case being the same, is a class of this map."""
        return label.casefold() in {name.casefold() for name in self.classes}

    def find(self, label: str, min_probability: float = 0.0) -> list[Answer]:
        """Things that may be a `label`, likeliest first.

        Each is ranked by existence times the probability of *that* label in its own posterior, so a thing that is
        likelier a bowl is still found as a cup. Things that cannot be a `label` are left out; an unknown label gives
        an empty list.
        """
        answers = [Answer(thing, thing.belief(label)) for thing in self.things]
        answers = [answer for answer in answers if answer.probability >= min_probability and answer.probability > 0.0]
        return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))

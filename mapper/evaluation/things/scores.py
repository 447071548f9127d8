"""Counts of a matching as shares: how many objects were found, how many of them by their right name.

Found means that a thing stands for the object, whatever it is called; joint means that it is called right as well. Both
use the same one-to-one matching: with a matching inside each class instead, a mug that is called a bowl could take the
place of a bowl beside it, and detection and joint scores would speak of different pairs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .matching import Matching, same_label


@dataclass(frozen=True, slots=True)
class Scores:
    """Counts.

    Attributes:
        wanted: objects that must be found.
        claimed: things that count.
        matched: of these, things that stand for an object.
        right: of these, things with the object's label.
        exhaustive: whether every object is in the truth; if not, nobody knows which claims are false, and all that
            needs to know is None.
    """

    wanted: int
    claimed: int
    matched: int
    right: int
    exhaustive: bool = True

    @property
    def recall(self) -> float | None:
        return share(self.matched, self.wanted)

    @property
    def precision(self) -> float | None:
        return share(self.matched, self.claimed) if self.exhaustive else None

    @property
    def f1(self) -> float | None:
        """2 found / (claimed + wanted), which is 0 for an empty map."""
        return share(2 * self.matched, self.claimed + self.wanted) if self.exhaustive else None

    @property
    def joint_recall(self) -> float | None:
        return share(self.right, self.wanted)

    @property
    def joint_precision(self) -> float | None:
        return share(self.right, self.claimed) if self.exhaustive else None

    @property
    def joint_f1(self) -> float | None:
        return share(2 * self.right, self.claimed + self.wanted) if self.exhaustive else None

    @property
    def label_accuracy(self) -> float | None:
        return share(self.right, self.matched)

    @property
    def count_ratio(self) -> float | None:
        return share(self.claimed, self.wanted) if self.exhaustive else None


def share(part: float, whole: float) -> float | None:
    """part / whole; None where there is no whole."""
    return part / whole if whole else None


def score(matching: Matching, exhaustive: bool) -> Scores:
    """Count all classes together."""
    matched = matching.matched
    right = sum(same_label(thing.label, true.label) for thing, true in matched)
    return Scores(len(matching.wanted), len(matching.claims), len(matched), right, exhaustive)


def label_f1(matching: Matching) -> float | None:
    """F1 of labels among matched pairs, 2 right / (called so + being so), averaged over the classes that occur there
    as a name or as the truth."""
    named = [(thing.label.casefold(), true.label.casefold()) for thing, true in matching.matched]
    values = []
    for label in sorted({label for pair in named for label in pair}):
        right = sum(a == b == label for a, b in named)
        values.append(2 * right / sum((a == label) + (b == label) for a, b in named))
    return float(np.mean(values)) if values else None

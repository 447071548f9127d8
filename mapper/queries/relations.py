"""What is on, inside, under and next to what."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...datasets.errors import UserError
from ..map.thing import Thing
from .answer import PROBABLE, Answer
from .level_surfaces import LevelSurface
from .names import NameQuestions
from .relation_boxes import Pairs, UprightBoxes, upright_boxes
from .relation_candidates import Near, candidate_pairs
from .relation_places import gaps, is_beside, is_inside, is_under
from .relation_support import Support, carried_by, supports
from .table_tops import means_table, table_tops, with_table_tops

MEANT = 0.05  # belief in a label from which on a thing may be the one that a question means


class RelationQuestions(NameQuestions):
    """Questions about where things are relative to each other, answered with probabilities.

    The other thing, `which`, is a thing of this map, its id, its given name, or words for a class as in `find`: "the
    table" stands for whatever may be a table, each as probably as it is one. Answers are ranked; the probability is
    that both things exist, that each is what was asked for, and that the relation holds given how uncertain positions
    and sizes are. Yaws are taken as exact and the errors of different things as independent (`Pairs`). A map knows
    nothing but boxes: what lies on a chair's seat is inside the chair's box, because its back is the top of that.

    Every question takes:
        which: the other thing.
        label: words for a class, as in `find`: only answers that are one, as probably as they are; or the name of the
            one thing that may be the answer; None for anything.
        min_probability: of an answer.
    and raises `UserError` where the map has no such thing as `which`, or does not know `label`.

    Where nothing in the map is a table, "the table" of `on`, `under` and `next_to` is any level surface of the cloud at
    a table's height (`table_tops`), the probability being that of the relation to one of those.
    """

    __slots__ = ()

    def on(self, which: Thing | str, label: str | None = None, min_probability: float = PROBABLE) -> list[Answer]:
        """Things that rest on `which`, touching it; what stands on a book on the table is on the book. Definition and
        equations: `relation_support`."""
        return self._related(which, label, min_probability, _carried, self.table_tops(which))

    def supports_of(
        self, which: Thing | str, label: str | None = None, min_probability: float = PROBABLE
    ) -> list[Answer]:
        """What `which` rests on, the reverse of `on`. For one thing the probabilities sum to at most 1; what is missing
        is that it stands on something that the map does not hold, such as the floor."""
        return self._related(which, label, min_probability, _carrying)

    def inside(self, which: Thing | str, label: str | None = None, min_probability: float = PROBABLE) -> list[Answer]:
        """Things of whose volume the larger part is in the box of `which`, a larger thing (`is_inside`)."""
        return self._related(which, label, min_probability, _placed(is_inside, Near.WITHIN))

    def under(self, which: Thing | str, label: str | None = None, min_probability: float = PROBABLE) -> list[Answer]:
        """Things below `which`, whether or not they touch it; below the top of what stands on legs (`is_under`)."""
        relation, tops = _placed(is_under, Near.ABOVE_OR_BELOW), self.table_tops(which)
        return self._related(which, label, min_probability, relation, tops)

    def next_to(
        self,
        which: Thing | str,
        label: str | None = None,
        min_probability: float = PROBABLE,
        reach: float | None = None,
    ) -> list[Answer]:
        """Things side by side with `which`, at most `reach` metres apart; by default so close that no third thing of
        their size fits between (`is_beside`). `Answer.distance` is the horizontal gap between the boxes."""
        if reach is not None and not 0.0 <= reach < np.inf:
            raise ValueError(f"reach must be a number of metres >= 0, but got {reach}")

        def beside(pairs: Pairs) -> np.ndarray:
            return is_beside(pairs, reach)

        relation, tops = _placed(beside, Near.BESIDE, reach), self.table_tops(which)
        return self._related(which, label, min_probability, relation, tops, with_gaps=True)

    def _related(
        self,
        which: Thing | str,
        label: str | None,
        min_probability: float,
        relation: Callable[[UprightBoxes, np.ndarray], Support],
        tops: tuple[LevelSurface, ...] = (),
        with_gaps: bool = False,
    ) -> list[Answer]:
        boxes = upright_boxes(self.things, self.up)
        if tops:
            boxes = with_table_tops(boxes, tops)
            meant = dict.fromkeys(range(len(self.things), len(boxes)), 1.0)
        else:
            meant = self._meant(which)
        found = relation(boxes, np.array(sorted(meant), dtype=np.intp))
        share = np.array([meant[int(b)] for b in found.second])
        if label is not None and not self.called(label):
            self.labels_of(label)  # words that mean nothing are a mistake
        belief = self.belief_of(label)
        probability = _of_any(found, share, len(boxes), exclusive=relation is _carried)
        answers = []
        for i in np.flatnonzero(probability[: len(self.things)] > 0.0):
            thing = self.things[i]
            p = float(probability[i]) * belief(thing) / thing.existence
            if p >= min_probability and p > 0.0:
                answers.append(Answer(thing, p, *(_gap(boxes, found, int(i)) if with_gaps else (None, None))))
        return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))

    def table_tops(self, which: Thing | str) -> tuple[LevelSurface, ...]:
        """The surfaces that `which` is taken as, upright frame: none unless it means a table and no thing is one."""
        if not isinstance(which, str) or self.cloud is None or not means_table(which):
            return ()
        return () if self.called(which) or self.find(which, MEANT) else table_tops(self)

    def _meant(self, which: Thing | str) -> dict[int, float]:
        """Place among the things -> P(it is what `which` means | it exists), for those that it may mean."""
        places = {thing.id: place for place, thing in enumerate(self.things)}
        own = self._by_id(which)
        if own is not None:
            return {places[own.id]: 1.0}
        text = str(which)
        answers = self.find(text, MEANT)
        if not answers:
            known = self.labels_of(text)
            raise UserError(f"no {' or '.join(known)} in the map of {self.source}; ask for one of its things")
        return {places[a.thing.id]: min(a.probability / a.thing.existence, 1.0) for a in answers}


def _carried(boxes: UprightBoxes, which: np.ndarray) -> Support:
    found = carried_by(boxes, which)
    asked = np.isin(found.second, which)
    return Support(found.first[asked], found.second[asked], found.probability[asked])


def _carrying(boxes: UprightBoxes, which: np.ndarray) -> Support:
    found = supports(boxes, which)
    return Support(found.second, found.first, found.probability)


def _placed(
    relation: Callable[[Pairs], np.ndarray], near: Near, reach: float | None = None
) -> Callable[[UprightBoxes, np.ndarray], Support]:
    def placed(boxes: UprightBoxes, which: np.ndarray) -> Support:
        pairs = candidate_pairs(boxes, np.arange(len(boxes)), which, near, reach)
        return Support(pairs.first, pairs.second, relation(pairs))

    return placed


def _of_any(found: Support, share: np.ndarray, count: int, exclusive: bool) -> np.ndarray:
    """(count,) P(related to any that is meant): a sum where one excludes the other, else as if independent."""
    each = found.probability * share
    if exclusive:
        return np.bincount(found.first, weights=each, minlength=count)
    none = np.bincount(found.first, weights=np.log1p(-np.minimum(each, 1.0 - 1e-15)), minlength=count)
    return -np.expm1(none)


def _gap(boxes: UprightBoxes, found: Support, first: int) -> tuple[float, float]:
    """Gap to the likeliest of those that are meant, and its standard deviation, metres."""
    rows = np.flatnonzero(found.first == first)
    best = rows[np.argmax(found.probability[rows])]
    mean, std = gaps(Pairs.of(boxes, found.first[best : best + 1], found.second[best : best + 1]))
    return float(mean[0]), float(std[0])

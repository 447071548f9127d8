"""Which box shows which object of an image: greedy, by descending score, as PASCAL VOC does it.

A box finds an object of its class where its intersection over union with the box of the whole object, or with that of
its visible part, reaches `box_iou`: detectors draw what they see, maps know whole things, and both are right. Among
objects not yet taken by a better box it gets the one that it overlaps most. (The VOC kit asks only for the object that
the box overlaps most of all, and calls the box false if that one is taken; of two cups behind one another it would
lose one that is in its place.) A second box on an object is false.

An object that is hardly visible is nobody's fault: missing it costs nothing, and a box of its class on it is ignored.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ....detectors.boxes import box_ious
from .curves import Scored
from .image_boxes import FoundBoxes, TrueBoxes

NOTHING = -1  # row of the object that a box found, where it found none
MIN_INSIDE = 0.5  # a claim with less of its box in the image is not false there: most of it cannot be checked


class Outcome(IntEnum):
    """What became of a box."""

    FALSE = 0
    FOUND = 1
    IGNORED = 2


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """The boxes of one image and what they are.

    Attributes:
        frame: index into the truth's frames.
        found: N boxes.
        true: M objects.
        outcome: (N,) `Outcome` values.
        object_row: (N,) row of `true` that a box found, `NOTHING` for others.
    """

    frame: int
    found: FoundBoxes
    true: TrueBoxes
    outcome: np.ndarray
    object_row: np.ndarray


def match_boxes(found: FoundBoxes, true: TrueBoxes, box_iou: float, frame: int = 0) -> Matches:
    """Give every box its object, or none; see the module's rules.

    Boxes of equal score are taken by overlap, so that their order does not matter.
    """
    overlap = np.maximum(box_ious(found.xyxy, true.whole), box_ious(found.xyxy, true.visible))
    reaches = (overlap >= box_iou) & (found.class_id[:, None] == true.class_id[None, :])
    outcome = np.where(found.inside >= MIN_INSIDE, Outcome.FALSE, Outcome.IGNORED)
    outcome[np.any(reaches & ~true.fair, axis=1)] = Outcome.IGNORED
    object_row = np.full(len(found), NOTHING)
    boxes, objects = np.nonzero(reaches & true.fair)
    taken = np.zeros(len(true), dtype=bool)
    for pair in np.lexsort((-overlap[boxes, objects], -found.score[boxes])):
        box, thing = boxes[pair], objects[pair]
        if object_row[box] == NOTHING and not taken[thing]:
            object_row[box], taken[thing] = thing, True
    outcome[object_row != NOTHING] = Outcome.FOUND
    return Matches(frame, found, true, outcome, object_row)


def scored(matches: Iterable[Matches], class_id: int | None = None) -> Scored:
    """Ranked outcomes of all images, of one class or (None) of all; ignored boxes and objects are left out."""
    scores, right, objects, images = [np.empty(0)], [np.empty(0, dtype=bool)], 0, 0
    for match in matches:
        of_class = np.ones(len(match.found), dtype=bool) if class_id is None else match.found.class_id == class_id
        counted = of_class & (match.outcome != Outcome.IGNORED)
        scores.append(match.found.score[counted])
        right.append(match.outcome[counted] == Outcome.FOUND)
        fair = match.true.fair if class_id is None else match.true.fair & (match.true.class_id == class_id)
        objects += int(fair.sum())
        images += 1
    return Scored(np.concatenate(scores), np.concatenate(right), objects, images)

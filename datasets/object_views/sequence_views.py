"""Objects as they stand in a sequence whose truth is known: views with their true surroundings.

They have no mask: cut out, an object that something else hides in part would be a part of one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from ..errors import UserError
from ..frame import BrokenFrame, Frame
from ..sequence import Sequence
from .known_boxes import known_boxes
from .object_view import BrokenView, ObjectView, ObjectViews, ViewEntry, cut_out

STRIDE = 10  # frames: at 30 Hz the next ones show nearly the same
VISIBLE = 0.8  # share of an object that must be seen: a view is of a whole object
SMALLEST = 16.0  # pixels of a box's longer side, two cells of gradients


def sequence_views(sequence: Sequence, stride: int = STRIDE, visibility: float = VISIBLE) -> ObjectViews:
    """Objects in every `stride`-th frame that are seen to at least the share `visibility`, wholly in the image.

    Args:
        sequence: one whose objects are known (see `known_boxes`).
        stride: frames from one to the next.
        visibility: share of the object.

    Raises:
        UserError: nothing is known of the sequence's objects, or the stride is below 1.
        InputError: a file of the truth is damaged.
    """
    if stride < 1:
        raise UserError(f"the stride must be at least 1, got {stride}")
    boxes_of = known_boxes(sequence)
    if boxes_of is None:
        raise UserError(
            f"{sequence.name}: expected a sequence whose objects are known, found no truth of them; "
            "give synth:..., a folder with truth/, or a video of RGB-D Scenes v1 with its .mat"
        )
    names, limits = tuple(sequence.names), np.tile([sequence.intrinsics.width, sequence.intrinsics.height], 2)
    last = lru_cache(maxsize=1)(partial(_read, sequence))  # views come frame by frame
    entries = []
    for index in range(0, len(sequence), stride):
        boxes = boxes_of(index)
        for k, (label, xyxy) in enumerate(zip(boxes.labels, boxes.xyxy, strict=True)):
            whole = (xyxy >= 0.0).all() and (xyxy <= limits).all()
            if not whole or boxes.visibility[k] < visibility or (xyxy[2:] - xyxy[:2]).max() < SMALLEST:
                continue  # as asked for: that an object is hidden is no fault of the view
            number = int(boxes.object_id[k])
            instance = f"{label} {number} of {sequence.name}"
            name = f"{sequence.name} {names[index]} object {number}"
            entries.append(ViewEntry(label, instance, name, partial(_view, last, index, (label, instance, name), xyxy)))
    return ObjectViews(entries)


def _view(read: Callable[[int], Frame], index: int, names: tuple[str, str, str], xyxy: np.ndarray) -> ObjectView:
    """The object in the box (4,) of a frame; `names` are the view's label, instance and name."""
    frame = read(index)
    return cut_out(ObjectView(*names, frame.color, frame.depth, None, xyxy, frame.intrinsics.fx))


def _read(sequence: Sequence, index: int) -> Frame:
    try:
        return sequence[index]
    except BrokenFrame as broken:
        raise BrokenView(f"{broken.problem.value} ({broken.detail})") from None

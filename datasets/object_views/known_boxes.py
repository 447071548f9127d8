"""The boxes of true objects in the frames of a sequence, where somebody knows them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..rgbd_scenes_v1 import RgbdScenesV1
from ..sequence import Sequence
from ..truth import FrameTruth, HasTruth
from ..truth_scenes import truth_of_v1
from ..views import Subset
from .class_names import class_name


@dataclass(frozen=True, slots=True, eq=False)
class KnownBoxes:
    """True objects in one image.

    Attributes:
        labels: (N,) class names.
        object_id: (N,) int64.
        xyxy: (N, 4) float64 pixels, boxes of the whole objects, from the image's outer edges, not cut to the image.
        visible: (N, 4) float64, the same of what is seen of them; NaN where nothing is, or nobody knows.
        visibility: (N,) share of each object that is seen.
    """

    labels: tuple[str, ...]
    object_id: np.ndarray
    xyxy: np.ndarray
    visible: np.ndarray
    visibility: np.ndarray

    @staticmethod
    def none() -> KnownBoxes:
        """No object."""
        return KnownBoxes((), np.zeros(0, np.int64), np.zeros((0, 4)), np.zeros((0, 4)), np.zeros(0))


def known_boxes(sequence: Sequence) -> Callable[[int], KnownBoxes] | None:
    """Frame index to the objects in it; None for a sequence whose objects nobody knows.

    Known are those of rendered sequences, of folders with `truth/`, and of RGB-D Scenes v1 videos with their `.mat`.

    Raises:
        InputError: a file of boxes is damaged.
    """
    if isinstance(sequence, HasTruth):
        objects, frame_truth = sequence.objects, sequence.truth
    elif isinstance(sequence, RgbdScenesV1) and sequence.box_file.is_file():
        truth = truth_of_v1(sequence)
        assert truth.frame_truth is not None
        objects, frame_truth = truth.objects, truth.frame_truth
    elif isinstance(sequence, Subset):
        boxes_of, indices = known_boxes(sequence.sequence), sequence.indices
        return None if boxes_of is None else lambda index: boxes_of(indices[index])
    else:
        return None
    labels = {thing.id: class_name(thing.label) for thing in objects}
    return lambda index: _boxes(frame_truth(index), labels)


def _boxes(truth: FrameTruth | None, labels: dict[int, str]) -> KnownBoxes:
    if truth is None:
        return KnownBoxes.none()
    ids = np.asarray(truth.object_id, dtype=np.int64)
    names = tuple(labels[int(number)] for number in ids)
    # truth counts from pixel centres
    return KnownBoxes(names, ids, truth.xyxy + 0.5, truth.xyxy_visible + 0.5, truth.visibility)

"""Background frames as a detector sees them, and what their proposals truly show."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ....datasets.frame import Frame, Intrinsics
from ....datasets.object_views.backgrounds import Background
from ...boxes import box_ious
from ...proposals.objectness import proposal_features, shipped_objectness
from ...proposals.proposals import find_proposals
from ...training.keeping import Kept
from ..codebook import Codebook
from ..described import Described
from ..scoring import ImageScores, Rivals, describe_frame, score_proposals
from .config import TrainConfig

NEITHER = -1
"""Label of a proposal that shows part of an object, or is not looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The N proposals of a frame.

    Attributes:
        described: points of those that a detector would look at.
        labels: (H, W) int32, the proposal of each pixel, -1 for none and for those that are not looked at.
        xyxy: (N, 4) pixels.
        objectness: (N,).
        shows: (N,) int: a class, C for background, or `NEITHER`.
    """

    described: Described
    labels: np.ndarray
    xyxy: np.ndarray
    objectness: np.ndarray
    shows: np.ndarray

    def scores(self, codebooks: Sequence[Codebook], config: TrainConfig, rivals: Rivals | None = None) -> ImageScores:
        """What classes say of the proposals."""
        return score_proposals(self.described, self.labels, self.xyxy, codebooks, config.voting, rivals)


def look(background: Background, classes: Sequence[str], config: TrainConfig) -> Scene:
    """A frame as the detector of a model would see it.

    Args:
        background: with depth; the optical axis is taken to meet its middle.
        classes: C labels.
        config: the numbers.
    """
    assert background.depth is not None
    height, width = background.depth.shape
    camera = Intrinsics(width, height, background.focal, background.focal, (width - 1) / 2.0, (height - 1) / 2.0)
    frame = Frame(0, background.name, 0.0, background.color, background.depth, camera)
    found = find_proposals(frame, config.proposals)
    objectness = shipped_objectness()(proposal_features(found, config.proposals)) if len(found) else np.zeros(0)
    looked_at = objectness >= config.voting.min_objectness
    described, labels = describe_frame(frame, found, looked_at, config.voting)
    shows = np.where(looked_at, shown(found.xyxy, background, classes, config), NEITHER)
    return Scene(described, labels, found.xyxy, objectness, shows)


def scenes_of(
    frames: Kept[Background | None], classes: Sequence[str], config: TrainConfig, on_item: Callable[[int], None]
) -> Iterator[Scene]:
    """Those of the frames that can be used; `on_item` hears how many are done."""
    for number, background in enumerate(frames):
        if background is not None:
            yield look(background, classes, config)
        on_item(number + 1)


def shown(xyxy: np.ndarray, background: Background, classes: Sequence[str], config: TrainConfig) -> np.ndarray:
    """(N,) int: the class that each box (N, 4) shows; C for background, `NEITHER` for part of a known object.

    Background is also what shows a known object of none of the C classes.
    """
    if len(background.labels) == 0:
        return np.full(len(xyxy), len(classes), dtype=np.int64)
    number = {label: k for k, label in enumerate(classes)}
    of_object = np.array([number.get(label, len(classes)) for label in background.labels])
    overlap = box_ious(xyxy, background.xyxy)
    best = overlap.max(axis=1)
    label = np.where(best >= config.known_overlap, of_object[overlap.argmax(axis=1)], NEITHER)
    return np.where(best < config.clear_overlap, len(classes), label)

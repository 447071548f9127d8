"""The windows that templates propose, judged by the second stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...boxes import areas, cut_to_image
from ...detections import Part
from ..candidates import Candidates, ScoredLevel, candidates, without_lesser
from ..model import HogTemplate
from ..pyramid import Pyramid
from ..score_vectors import LEAST
from ..suppression import suppress
from .network import WindowNetwork
from .window_views import window_views

# Windows of at least so much probability by their template are looked at again, and so many of a class, the best. On
# three rendered tables (seed 41), 90 objects of a hundred are in one of them with little clutter, and 75 with much; in
# those of 0.1 and more, the confidence from which detections are reported, are 76 and 41. They are 130 a frame.
PROPOSED, MOST_PROPOSED = 0.002, 60
PROPOSED_IOU = 0.4  # intersection over union above which the lesser of two windows of a class goes


@dataclass(frozen=True, slots=True, eq=False)
class JudgedWindows:
    """N windows of whole objects, each about one object or none.

    Attributes:
        xyxy: (N, 4) pixels, boxes of what they show, cut to the image; some may have no area.
        probability: (N, K) of the classes.
    """

    xyxy: np.ndarray
    probability: np.ndarray

    @property
    def scores(self) -> np.ndarray:
        """(N, K) as detections have them: a class is never impossible."""
        return np.clip(self.probability, LEAST, 1.0)

    @classmethod
    def of(
        cls, network: WindowNetwork, pyramid: Pyramid, depth: np.ndarray, focal: float, proposed: Candidates
    ) -> JudgedWindows:
        """What a network makes of windows of an image with its (H, W) depth in metres and focal length in pixels."""
        views = window_views(pyramid, depth, focal, proposed, network.classes)
        probability, xyxy = network.judge(views, proposed.xyxy)
        return cls(cut_to_image(xyxy, pyramid.width, pyramid.height), probability)

    def of_each_class(self, least: float, nms_iou: float, most: int) -> Candidates:
        """Those of each class for itself, of at least a probability, that no better one of it suppresses."""
        n, class_id = np.nonzero(self.probability >= least)
        found = Candidates(class_id, np.full(len(n), Part.WHOLE, np.int8), self.xyxy[n], self.probability[n, class_id])
        found = found.select(areas(found.xyxy) > 0.0)
        found = found.select(np.argsort(-found.probability, kind="stable"))
        return found.select(suppress(found.xyxy, found.class_id, nms_iou, most))

    def merged(self, least: float, nms_iou: float, most: int) -> JudgedWindows:
        """Those whose likeliest class has at least a probability, and that none that is surer suppresses, the surest
        first: one box at a place, with the probabilities of all classes."""
        best = self.probability.max(axis=1, initial=0.0)
        order = np.argsort(-best, kind="stable")
        order = order[(best[order] >= least) & (areas(self.xyxy[order]) > 0.0)]
        kept = order[suppress(self.xyxy[order], np.zeros(len(order), dtype=np.int64), nms_iou, most)]
        return JudgedWindows(self.xyxy[kept], self.probability[kept])


def proposed_windows(
    levels: Sequence[ScoredLevel], templates: Sequence[HogTemplate], width: int, height: int
) -> Candidates:
    """The windows of an image that templates of whole objects propose, their boxes cut to it: of those of one class
    that overlap the most probable one."""
    found = candidates(levels, templates, PROPOSED, (Part.WHOLE,))
    found = without_lesser(found, width, height, PROPOSED_IOU, MOST_PROPOSED)
    return replace(found, xyxy=cut_to_image(found.xyxy, width, height))

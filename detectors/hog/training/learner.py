"""One template while it is being learned: its examples, its negatives and what they have made of it so far."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...detections import Part
from ..model import HogTemplate
from .negatives import Negatives, sample_rows
from .positives import Examples
from .svm import fit_svm
from .windows import WindowShape, part_share

UNFITTED = (-1.0, 0.0)  # Platt's (u, v) before calibration


@dataclass(slots=True, eq=False)
class Learner:
    """Everything of one class and part.

    Attributes:
        template: as it is now; zero weights at first.
        positives: (P, D) float16 samples, see `sample_rows`.
        others: (M, D) the same of objects of other classes: negatives that always stay.
        negatives: mined ones.
        done: the last round found nothing new.
    """

    template: HogTemplate
    positives: np.ndarray
    others: np.ndarray
    negatives: Negatives
    done: bool = False

    @property
    def cells(self) -> tuple[int, int]:
        """Rows and columns of the window."""
        rows, columns, _ = self.template.weights.shape
        return rows, columns

    def fit(self, cost: float) -> None:
        """Learn weights from all that there is."""
        negatives = np.concatenate([self.others, self.negatives.samples])
        weights, bias = fit_svm(self.positives, negatives, cost)
        self.template = replace(
            self.template,
            weights=weights[:-1].reshape(self.template.weights.shape).astype(np.float32),
            scale_weight=float(weights[-1]),
            bias=bias,
        )

    def score(self, samples: np.ndarray) -> np.ndarray:
        """(N,) float32 scores of samples (N, D)."""
        weights = np.append(self.template.weights.ravel(), np.float32(self.template.scale_weight))
        return samples.astype(np.float32) @ weights + np.float32(self.template.bias)

    def take(self, found: Negatives, cache: int) -> None:
        """Take what a round of mining found; the easiest of the old ones make room. Done where nothing is found."""
        self.done = len(found) == 0
        room = max(cache - len(found), 0)
        self.negatives = self.negatives.hardest(self.score(self.negatives.samples), room).with_more(found)


def new_learner(class_id: int, part: Part, shape: WindowShape, own: Examples, others: Examples) -> Learner:
    """Cuts the part's windows from those of whole objects."""
    rows, columns = shape.cells(part)
    positives = sample_rows(own.features[:, rows, columns], own.scale)
    weights = np.zeros_like(own.features[0, rows, columns], dtype=np.float32)
    template = HogTemplate(class_id, part, weights, 0.0, 0.0, UNFITTED, part_share(part, own.window, own.xyxy))
    strangers = sample_rows(others.features[:, rows, columns], others.scale)
    return Learner(template, positives, strangers, Negatives.none(positives.shape[1]))

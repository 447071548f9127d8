"""How probably a proposal is a thing: logistic regression on simple features of it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.special import expit

from ...datasets.errors import InputError
from .config import ProposalConfig
from .outline import Beyond, outline_counts
from .proposals import Proposals

SHIPPED = Path(__file__).with_name("objectness.json")
FEATURES = (
    "log extent",
    "log extent squared",
    "log width",
    "flatness",
    "log points",
    "box fill",
    "depth",
    "border",
    "no reading",
    "farther",
    "nearer",
    "support",
    "plane",
    "rest",
    "above support",
    "hangs",
)
HIGHEST = 0.4  # metres above a support: what stands on it has its middle below that


@dataclass(frozen=True, slots=True)
class Objectness:
    """p = 1 / (1 + exp(-(bias + weights . features))).

    Attributes:
        bias: log-odds.
        weights: one for each of `FEATURES`, per unit of the feature.
    """

    bias: float
    weights: tuple[float, ...]

    def __call__(self, features: np.ndarray) -> np.ndarray:
        """(N,) probabilities of (N, F) features."""
        return expit(features @ np.asarray(self.weights) + self.bias)

    def save(self, path: Path) -> None:
        """A JSON file of the numbers by feature."""
        named = dict(zip(FEATURES, self.weights, strict=True))
        path.write_text(json.dumps({"bias": self.bias, "weights": named}, indent=2) + "\n", "utf-8")


def load_objectness(path: Path) -> Objectness:
    """Raises InputError for a file that is not what `Objectness.save` writes."""
    try:
        values = json.loads(path.read_text("utf-8"))
        weights = tuple(float(values["weights"][name]) for name in FEATURES)
        return Objectness(float(values["bias"]), weights)
    except (OSError, ValueError, KeyError, TypeError) as error:
        remedy = "make it with benchmarks/proposal_scores.py"
        raise InputError(path, "a bias and a weight for each feature", repr(error), remedy) from error


@cache
def shipped_objectness() -> Objectness:
    """Fitted on rendered tables and rooms, see benchmarks/proposal_scores.py."""
    return load_objectness(SHIPPED)


def proposal_features(found: Proposals, config: ProposalConfig) -> np.ndarray:
    """(N, F) features of proposals, the columns of `FEATURES`.

    "border" to "rest" are shares of the outline by what is beyond it (`Beyond`); "above support" is how far the middle
    is above the next support below, in units of `HIGHEST` and at most 1, 1 too where there is none; "hangs" is 1 for
    that.
    """
    count = len(found)
    grid, planes = found.grid, found.planes
    around = outline_counts(
        found.grid_labels, grid.depth, planes.owner, planes.is_support, count, config.jump_share, config.jump
    )
    shares = around / np.maximum(around.sum(axis=1, keepdims=True), 1.0)
    points = np.bincount(found.grid_labels[found.grid_labels >= 0], minlength=count)
    sides = (found.xyxy[:, 2:] - found.xyxy[:, :2]) / grid.step
    extents = np.maximum(found.extents, 1e-3)
    size = np.log(extents[:, 0])
    height, hangs = _above_support(found)
    return np.column_stack(
        [
            size,
            size**2,
            np.log(extents[:, 1]),
            extents[:, 2] / extents[:, 0],
            np.log(points),
            points / np.maximum(sides.prod(axis=1), 1.0),
            found.centroids[:, 2],
            *(shares[:, kind] for kind in Beyond),
            height,
            hangs,
        ]
    )


def _above_support(found: Proposals) -> tuple[np.ndarray, np.ndarray]:
    """(N,) "above support" and (N,) "hangs" of `proposal_features`."""
    planes = found.planes
    normals, offsets = planes.normals[planes.is_support], planes.offsets[planes.is_support]
    height = found.centroids @ normals.T - offsets
    least = np.where(height > 0.0, height, np.inf).min(axis=1, initial=np.inf)
    return np.minimum(least / HIGHEST, 1.0), (least > HIGHEST).astype(np.float64)

"""A small multilayer perceptron: from the description of a window to its class and its true box.

    h_0 = clip((x - centre) / spread),   h_l = max(W_l' h_(l-1) + b_l, 0),   z = W_L' h_(L-1) + b_L

The first K + 1 of z are log odds of the classes and the background, up to a constant (softmax); the last four are the
box of the object, relative to the window (the regression of R-CNN: Girshick et al. 2014, appendix C).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import softmax

LIMIT = 5.0  # spreads from the centre beyond which a number says no more
MOST_SHIFT, MOST_ZOOM = 0.5, 1.0  # shares of a window's sides, and their logarithm: further away it shows another thing
STEPS, LEAST_STEP = 127, 1e-12  # of weights in a file, on either side of 0; and of a unit that weighs nothing
_PRODUCTS = 1 << 18  # multiplications below which BLAS keeps to the calling thread (see `scoring`)
_ROWS = 32  # of which products are taken: of all at once they would be slivers, 13 ms instead of 3 for 256 units


@dataclass(frozen=True, slots=True, eq=False)
class WindowNetwork:
    """The parameters, for F numbers and K classes.

    Attributes:
        centre, spread: (F,) float32, of the numbers.
        weights: of L layers, (F, H), (H, ...), ..., (..., K + 5) float32.
        biases: of each, (outputs,) float32.

    Raises:
        ValueError: shapes that do not fit each other, numbers that are not finite, or a spread that is not positive.
    """

    centre: np.ndarray
    spread: np.ndarray
    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        sizes = [len(self.centre), *(layer.shape[-1] for layer in self.weights)]
        expected = list(pairwise(sizes))
        found = [layer.shape for layer in self.weights]
        if found != expected or [bias.shape for bias in self.biases] != [(size,) for size in sizes[1:]]:
            raise ValueError(f"layers must follow each other, but have the shapes {found}")
        if self.spread.shape != self.centre.shape or not (self.spread > 0.0).all():
            raise ValueError("expected a positive spread for each number")
        if not all(np.isfinite(array).all() for array in (self.centre, self.spread, *self.weights, *self.biases)):
            raise ValueError("the second stage must have finite numbers only")

    @property
    def inputs(self) -> int:
        """F."""
        return len(self.centre)

    @property
    def classes(self) -> int:
        """K."""
        return len(self.biases[-1]) - 5

    def outputs(self, views: np.ndarray) -> np.ndarray:
        """(N, K + 5) z of (N, F) descriptions."""
        h = np.clip((views - self.centre) / self.spread, -LIMIT, LIMIT)
        for number, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            h = _product(h if number == 0 else np.maximum(h, 0.0), weights) + bias
        return h

    def judge(self, views: np.ndarray, xyxy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What N windows show.

        Args:
            views: (N, F) descriptions.
            xyxy: (N, 4) pixels, their boxes.

        Returns:
            (N, K) probabilities of the classes, which leave the background's, and (N, 4) the boxes of what they show.
        """
        z = self.outputs(views)
        return softmax(z[:, :-4], axis=1)[:, :-1].astype(np.float64), moved_boxes(xyxy, z[:, -4:])

    def arrays(self) -> dict[str, np.ndarray]:
        """For a file. Weights have 8 bits, each unit's in steps of its own: 1.6 % of noise, and half the size."""
        numbers = {"second_centre": self.centre, "second_spread": self.spread}
        weights: dict[str, np.ndarray] = {}
        for k, (layer, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            step = np.maximum(np.abs(layer).max(axis=0) / STEPS, LEAST_STEP)
            weights[f"second_weights_{k}"] = np.round(layer / step).astype(np.int8)
            numbers |= {f"second_step_{k}": step, f"second_bias_{k}": bias}
        return weights | {name: array.astype(np.float32) for name, array in numbers.items()}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, np.ndarray], layers: int) -> WindowNetwork:
        """From those of a file; raises `KeyError` for one that is absent, `ValueError` as the class."""

        def read(name: str) -> np.ndarray:
            return np.asarray(arrays[f"second_{name}"], dtype=np.float32)

        def layer(k: int) -> np.ndarray:
            weights = read(f"weights_{k}")
            return weights * read(f"step_{k}") if arrays[f"second_weights_{k}"].dtype == np.int8 else weights

        weights, biases = [layer(k) for k in range(layers)], [read(f"bias_{k}") for k in range(layers)]
        return cls(read("centre"), read("spread"), tuple(weights), tuple(biases))


def box_offsets(xyxy: np.ndarray, true: np.ndarray) -> np.ndarray:
    """(N, 4) what makes (N, 4) true boxes of windows in `moved_boxes`: shift over size, log of the sizes' ratio."""
    size, true_size = xyxy[:, 2:] - xyxy[:, :2], true[:, 2:] - true[:, :2]
    shift = 0.5 * (true[:, :2] + true[:, 2:] - xyxy[:, :2] - xyxy[:, 2:]) / size
    return np.concatenate([shift, np.log(true_size / size)], axis=1)


def moved_boxes(xyxy: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """(N, 4) boxes of windows (N, 4), shifted and stretched by as much as is allowed at most."""
    size = xyxy[:, 2:] - xyxy[:, :2]
    centre = 0.5 * (xyxy[:, :2] + xyxy[:, 2:]) + np.clip(offsets[:, :2], -MOST_SHIFT, MOST_SHIFT) * size
    half = 0.5 * size * np.exp(np.clip(offsets[:, 2:], -MOST_ZOOM, MOST_ZOOM))
    return np.concatenate([centre - half, centre + half], axis=1)


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a @ b as a sum of products so small that BLAS starts no threads for them: beside others' work they are slower."""
    total = np.zeros((len(a), b.shape[1]), np.float32)
    for top in range(0, len(a), _ROWS):
        some, sums = a[top : top + _ROWS], total[top : top + _ROWS]
        step = max(1, _PRODUCTS // max(1, sums.size))
        for first in range(0, len(b), step):
            sums += some[:, first : first + step] @ b[first : first + step]
    return total

"""The network of the second stage, learned from windows whose truth is known: Adam on cross entropy and box offsets.

scikit-learn's perceptrons have neither two kinds of outputs nor dropout, and a framework that has them is larger than
all else together; backpropagation through three layers is a page.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..second_stage.network import LIMIT, WindowNetwork

UNKNOWN = -1  # label of a window that neither shows an object nor clearly none
BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8  # of Adam (Kingma and Ba 2015)
WARM_UP = 0.3  # share of the steps in which the rate rises, as in one-cycle schedules
NEAR = 0.1  # offset from which on a wrong box costs in proportion, not as the square (smooth L1)
LEAST_SPREAD = 1e-3  # is added: some numbers are all the same


@dataclass(frozen=True, slots=True)
class FitConfig:
    """How the network is learned.

    Measured on frames of rendered tables (seeds 41 to 44) that nothing was learned from, as average precision of boxes
    of all classes together.

    Attributes:
        hidden: units of the layers between. Learned from 3810 frames, of 240 scenes: 0.816 with 64 in the first, 0.835
            with 128, 0.845 with 256; from 2700 frames of 96 scenes 0.810 with 64, and 128 gave hardly more.
        dropout: shares of what enters each layer that are left out at random; of 1800 frames, with 64 units, 0.785 with
            the numbers here, 0.745 with 0.2, 0.5, 0.25, and 0.680 with 0.5, 0.5, 0.25.
        epochs: times that all windows are gone through.
        batch: windows of a step.
        rate: of Adam, at most.
        decay: of weights, in shares of themselves for a rate of 1.
        box_cost: of offsets beside cross entropy.
        seed: of everything that is drawn.
    """

    hidden: tuple[int, ...] = (256, 64)
    dropout: tuple[float, ...] = (0.0, 0.3, 0.1)
    epochs: int = 15
    batch: int = 512
    rate: float = 1e-3
    decay: float = 1e-4
    box_cost: float = 4.0
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class WindowSamples:
    """N windows.

    Attributes:
        views: (N, F) as `window_views` describes them; half precision will do.
        label: (N,) class, K for the background, or `UNKNOWN`.
        offsets: (N, 4) float32, to the box of what the window shows; counts only where it shows an object.
    """

    views: np.ndarray
    label: np.ndarray
    offsets: np.ndarray


def fit_network(
    samples: WindowSamples, classes: int, config: FitConfig, on_epoch: Callable[[int, float], None]
) -> WindowNetwork:
    """A network for K classes; `on_epoch` is told how many epochs are done, and the mean cross entropy of the last.

    The same samples and numbers give the same network, up to the order in which BLAS adds.
    """
    rng = np.random.default_rng(config.seed)
    rows = np.flatnonzero(samples.label != UNKNOWN)
    centre, spread = _moments(samples.views, rows)
    parameters = _first_parameters(samples.views.shape[1], classes + 5, config, rng)
    layers, steps = len(parameters) // 2, config.epochs * -(-len(rows) // config.batch)
    moments = [(np.zeros_like(p), np.zeros_like(p)) for p in parameters]
    step = 0
    for epoch in range(config.epochs):
        rng.shuffle(rows)
        total = 0.0
        for first in range(0, len(rows), config.batch):
            taken = rows[first : first + config.batch]
            x = np.clip((samples.views[taken].astype(np.float32) - centre) / spread, -LIMIT, LIMIT)
            truth = WindowSamples(x, samples.label[taken], samples.offsets[taken])
            gradients, loss = _gradients(parameters[:layers], parameters[layers:], truth, config, rng)
            step += 1
            _adam(parameters, gradients, moments, step, _rate(step / steps, config.rate), config.decay)
            total += loss
        on_epoch(epoch + 1, total / len(rows))
    return WindowNetwork(centre, spread, tuple(parameters[:layers]), tuple(parameters[layers:]))


def _moments(views: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and deviation of every number, of so many windows as fit easily."""
    some = views[rows[:: max(1, len(rows) // 30_000)]].astype(np.float32)
    return some.mean(axis=0), some.std(axis=0) + np.float32(LEAST_SPREAD)


def _first_parameters(inputs: int, outputs: int, config: FitConfig, rng: np.random.Generator) -> list[np.ndarray]:
    """Weights of all layers, then their biases (He et al. 2015)."""
    sizes = [inputs, *config.hidden, outputs]
    deviations = [np.sqrt(2.0 / size) for size in sizes[:-2]] + [np.sqrt(1.0 / sizes[-2])]
    shapes = zip(sizes[:-1], sizes[1:], deviations, strict=True)
    weights = [rng.normal(0.0, deviation, (a, b)).astype(np.float32) for a, b, deviation in shapes]
    return weights + [np.zeros(size, np.float32) for size in sizes[1:]]


def _gradients(
    weights, biases, batch: WindowSamples, config: FitConfig, rng: np.random.Generator
) -> tuple[list, float]:
    """Of the mean loss of a batch with respect to weights, then biases; and its summed cross entropy."""
    entered, kept, z = [], [], batch.views
    for number, share in enumerate(config.dropout):
        h = z if number == 0 else np.maximum(z, 0.0)
        mask = (rng.random(h.shape, dtype=np.float32) >= share) / np.float32(1.0 - share) if share else None
        h = h if mask is None else h * mask
        entered.append(h)
        kept.append(mask)
        z = h @ weights[number] + biases[number]
    g, loss = _loss_gradient(z, batch.label, batch.offsets, config.box_cost)
    of_weights, of_biases = [], []
    for number in reversed(range(len(weights))):
        of_weights.insert(0, entered[number].T @ g)
        of_biases.insert(0, g.sum(axis=0))
        if number:
            mask = kept[number]
            g = (g @ weights[number].T) * (entered[number] > 0.0)
            g = g if mask is None else g * mask
    return of_weights + of_biases, loss


def _loss_gradient(z: np.ndarray, label: np.ndarray, offsets: np.ndarray, box_cost: float) -> tuple[np.ndarray, float]:
    """Of (N, K + 5) outputs: the gradient of mean cross entropy and smooth L1, and the sum of the former."""
    rows, classes = np.arange(len(z)), z.shape[1] - 5
    p = np.exp(z[:, :-4] - z[:, :-4].max(axis=1, keepdims=True))
    p /= p.sum(axis=1, keepdims=True)
    loss = -float(np.log(np.maximum(p[rows, label], 1e-12)).sum())
    p[rows, label] -= 1.0
    is_object = label < classes
    off = np.where(is_object[:, None], z[:, -4:] - offsets, 0.0)
    of_box = np.clip(off / NEAR, -1.0, 1.0) * (box_cost / (4.0 * max(1, int(is_object.sum()))))
    return np.concatenate([p / len(z), of_box], axis=1).astype(np.float32), loss


def _rate(share: float, most: float) -> float:
    """Rises in a line, then falls as a cosine."""
    if share < WARM_UP:
        return most * share / WARM_UP
    return most * 0.5 * (1.0 + np.cos(np.pi * (share - WARM_UP) / (1.0 - WARM_UP)))


def _adam(parameters, gradients, moments, step: int, rate: float, decay: float) -> None:
    """One step, in place; weights also decay by themselves."""
    for p, g, (first, second) in zip(parameters, gradients, moments, strict=True):
        first += (1.0 - BETA_1) * (g - first)
        second += (1.0 - BETA_2) * (g * g - second)
        change = first / (1.0 - BETA_1**step) / (np.sqrt(second / (1.0 - BETA_2**step)) + EPSILON)
        p -= np.float32(rate) * (change + (decay * p if p.ndim == 2 else 0.0))

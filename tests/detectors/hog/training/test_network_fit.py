"""Learning the network of the second stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.detectors.hog.training.network_fit import (
    UNKNOWN,
    FitConfig,
    WindowSamples,
    _first_parameters,
    _gradients,
    _loss_gradient,
    fit_network,
)

PLAIN = FitConfig(hidden=(12, 8), dropout=(0.0, 0.0, 0.0), epochs=60, batch=32, rate=1e-2)


def samples(count: int = 600, seed: int = 0) -> WindowSamples:
    """Two classes and background by the signs of two numbers; offsets follow a third."""
    rng = np.random.default_rng(seed)
    views = rng.normal(size=(count, 8))
    label = np.where(views[:, 0] > 0.0, 0, np.where(views[:, 1] > 0.0, 1, 2))
    offsets = np.outer(views[:, 2], [0.1, -0.1, 0.2, 0.0])
    return WindowSamples(views.astype(np.float32), label, offsets.astype(np.float32))


def loss_of(weights, biases, batch: WindowSamples, box_cost: float) -> float:
    """Mean cross entropy and smooth L1, in double precision."""
    h = batch.views.astype(np.float64)
    for number, (w, b) in enumerate(zip(weights, biases, strict=True)):
        h = (h if number == 0 else np.maximum(h, 0.0)) @ w + b
    z = h[:, :3]
    entropy = np.log(np.exp(z).sum(axis=1)) - z[np.arange(len(z)), batch.label]
    off = np.abs(h[:, 3:] - batch.offsets)[batch.label < 2]
    smooth = np.where(off < 0.1, 0.5 * off**2 / 0.1, off - 0.05)
    return float(entropy.mean() + box_cost * smooth.mean())


def test_gradients_are_those_of_the_loss():
    rng, batch = np.random.default_rng(3), samples(40)
    parameters = [p.astype(np.float64) for p in _first_parameters(8, 7, PLAIN, rng)]
    for p in parameters[3:]:
        p += rng.normal(scale=0.1, size=p.shape)
    gradients, entropy = _gradients(parameters[:3], parameters[3:], batch, PLAIN, rng)
    assert entropy / 40 == pytest.approx(loss_of(parameters[:3], parameters[3:], batch, 0.0), rel=1e-5)
    for p, g in zip(parameters, gradients, strict=True):
        for place in rng.choice(p.size, min(p.size, 8), replace=False):
            index = np.unravel_index(place, p.shape)
            ends = []
            for step in (1e-5, -1e-5):
                p[index] += step
                ends.append(loss_of(parameters[:3], parameters[3:], batch, PLAIN.box_cost))
                p[index] -= step
            assert g[index] == pytest.approx((ends[0] - ends[1]) / 2e-5, abs=2e-5)


def test_it_learns_classes_and_boxes_and_shows_that_on_others():
    entropies = []
    network = fit_network(samples(), 2, PLAIN, lambda done, entropy: entropies.append(entropy))
    assert len(entropies) == PLAIN.epochs and entropies[-1] < 0.2 * entropies[0]
    other = samples(300, seed=1)
    p, _ = network.judge(other.views, np.zeros((300, 4)))
    guess = np.concatenate([p, 1.0 - p.sum(axis=1, keepdims=True)], axis=1).argmax(axis=1)
    assert (guess == other.label).mean() > 0.93
    shown = other.label < 2
    off = network.outputs(other.views)[shown, -4:] - other.offsets[shown]
    assert np.abs(off).mean() < 0.5 * np.abs(other.offsets[shown]).mean()


def test_the_same_samples_give_the_same_network_and_another_seed_another():
    few = replace(PLAIN, epochs=2, dropout=(0.1, 0.3, 0.0))
    one, same, other = (fit_network(samples(), 2, replace(few, seed=s), lambda done, loss: None) for s in (0, 0, 1))
    np.testing.assert_array_equal(one.weights[0], same.weights[0])
    assert np.abs(one.weights[0] - other.weights[0]).max() > 0.01


def test_unknown_windows_teach_nothing():
    some = samples()
    odd = WindowSamples(
        np.concatenate([some.views, np.full((50, 8), 100.0, np.float32)]),
        np.concatenate([some.label, np.full(50, UNKNOWN)]),
        np.concatenate([some.offsets, np.full((50, 4), 9.0, np.float32)]),
    )
    few = replace(PLAIN, epochs=1)
    one, same = (fit_network(these, 2, few, lambda done, loss: None) for these in (some, odd))
    np.testing.assert_array_equal(one.weights[0], same.weights[0])


def test_offsets_of_the_background_cost_nothing():
    z = np.random.default_rng(0).normal(size=(4, 7)).astype(np.float32)
    gradient, _ = _loss_gradient(z, np.array([2, 0, 2, 1]), np.zeros((4, 4), np.float32), 4.0)
    assert not gradient[[0, 2], 3:].any() and gradient[[1, 3], 3:].all()

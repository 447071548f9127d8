"""Samples of a detector whose numbers are known, for tests of the fits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import expit

from thingmap.mapper.learning.samples import Samples, Tally

CLASSES = ("cup", "bowl", "book")


def _true_mean(occlusion: np.ndarray) -> np.ndarray:
    """Own-class score of the made-up detector."""
    return 0.7 - 0.4 * occlusion


def _true_rate(visible: np.ndarray, side_px: np.ndarray) -> np.ndarray:
    """P_D of it."""
    return expit(8.0 * (visible - 0.4) + 1.5 * (np.log2(side_px) - 5.0))


def _make_samples(seed: int = 0, trials: int = 4000, parts: int = 1, scenes: int = 4, scale: float = 1.0) -> Samples:
    rng = np.random.default_rng(seed)
    class_id = rng.integers(len(CLASSES), size=trials)
    part = rng.integers(parts, size=trials)
    visible, side_px = rng.uniform(0.0, 1.0, trials), np.exp2(rng.uniform(4.0, 7.0, trials))
    found = rng.random(trials) < scale * _true_rate(visible, side_px)
    scores = np.abs(rng.normal(0.0, 0.03, (trials, len(CLASSES))))
    own = np.clip(rng.normal(_true_mean(1.0 - visible), 0.08), 0.15, 1.0)
    scores[np.arange(trials), class_id] = own
    scores[~found] = np.nan
    F = trials // 4
    false = np.abs(rng.normal(0.0, 0.03, (F, len(CLASSES))))
    false[np.arange(F), rng.integers(len(CLASSES), size=F)] = np.clip(rng.normal(0.2, 0.06, F), 0.12, 1.0)
    tally = Tally([f"scene-{k}" for k in range(scenes)], frames=100, detections=int(found.sum()) + F)
    return Samples(
        CLASSES,
        class_id,
        part,
        visible,
        side_px,
        scores,
        rng.integers(scenes, size=trials),
        np.zeros(trials, dtype=np.int64),
        rng.integers(parts, size=F),
        false,
        rng.integers(scenes, size=F),
        tally,
    )


@pytest.fixture(scope="session")
def make_samples() -> Callable[..., Samples]:
    """`make_samples(seed, trials, parts, scenes, scale)`: scores fall from 0.7 to 0.3, false ones are 0.2 +- 0.06."""
    return _make_samples


@pytest.fixture(scope="session")
def true_rate() -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """P_D of that detector, by visible share and side in pixels."""
    return _true_rate

"""Is P_D right for sequences that it was not learned from? Cross-validation by sequence.

Views of one object are alike, so a model is only tried out on sequences of which it saw nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .config import LearningConfig
from .fit_detection import fit_detection
from .samples import Samples

BINS = 10  # of the predicted P_D, of equal width


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Predicted and counted rates of held-out trials of one template.

    Attributes:
        predicted, counted: (10,) mean P_D and share found, by the predicted P_D; NaN in bins without trials.
        trials: (10,).
        ece: expected calibration error: mean |predicted - counted|, weighted by trials.
        log_loss: nats a trial; and
        base_loss: the same of a model that says the overall rate always.
    """

    predicted: np.ndarray
    counted: np.ndarray
    trials: np.ndarray
    ece: float
    log_loss: float
    base_loss: float


def cross_validate(samples: Samples, classes: np.ndarray, config: LearningConfig) -> dict[int, Calibration]:
    """By template that ever found anything; empty where there is one sequence only."""
    scenes = np.unique(samples.scene)
    if len(scenes) < 2:
        return {}
    folds = [scenes[k :: config.folds] for k in range(min(config.folds, len(scenes)))]
    probability = np.full(len(samples.part), np.nan)
    for fold in folds:
        model = fit_detection(samples.of_scenes(np.setdiff1d(scenes, fold)), classes, config)
        for part in np.unique(samples.part):
            held_out = (samples.part == part) & np.isin(samples.scene, fold)
            posterior = (samples.class_id[held_out, None] == classes).astype(np.float64)
            arguments = samples.visible[held_out], samples.side_px[held_out], int(part), posterior
            probability[held_out] = model.probability(*arguments)
    trial = samples.visible > 0.0
    parts = [int(part) for part in np.unique(samples.part) if samples.found[samples.part == part].any()]
    chosen = {part: trial & (samples.part == part) for part in parts}
    return {part: calibrate(probability[rows], samples.found[rows]) for part, rows in chosen.items() if rows.any()}


def calibrate(probability: np.ndarray, found: np.ndarray) -> Calibration:
    """Compares (T,) probabilities with (T,) outcomes."""
    bin_of = np.minimum((probability * BINS).astype(int), BINS - 1)
    trials = np.bincount(bin_of, minlength=BINS)
    with np.errstate(invalid="ignore"):
        predicted = np.bincount(bin_of, probability, BINS) / trials
        counted = np.bincount(bin_of, found.astype(np.float64), BINS) / trials
    ece = float(np.nansum(trials * np.abs(predicted - counted)) / len(found))
    return Calibration(predicted, counted, trials, ece, _loss(probability, found), _loss(found.mean(), found))


def _loss(probability: np.ndarray | float, found: np.ndarray) -> float:
    p = np.clip(probability, 1e-6, 1.0 - 1e-6)
    return float(-np.mean(np.where(found, np.log(p), np.log1p(-p))))

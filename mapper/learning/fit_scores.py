"""`ScoreModel` from samples (Meger et al., Clutter, section IV).

"We bin training data with bin width 0.1 and vote into neighboring bins with weight inverse to the distance from the
bin centre": a sample between two centres gives each the share by which it is near to it. Where there are few votes
a class is drawn to the pooled class, a bin to its neighbours, and background and confusion to the generic numbers,
each time by `pseudo_votes` votes for the latter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...factors.evidence_model import generic_evidence_model
from ...factors.learned_numbers import TEMPLATES
from ...factors.score_model import BIN_CENTRES, BINS, TRUNCATION, ScoreModel
from .config import LearningConfig
from .fit_platt import fit_platt
from .samples import Samples, best_class, best_score

LEAST_RANGE = 0.05  # of the linear potential: a detector whose objects score like its false boxes says little


@dataclass(frozen=True, slots=True, eq=False)
class FittedScores:
    """The model, and how many samples stand behind it.

    Attributes:
        model: rows are the K classes with samples, and the pooled one.
        votes: (K + 1, 5, 10) of the own-class score.
        background: (K + 1, 5) detections behind the background.
    """

    model: ScoreModel
    votes: np.ndarray
    background: np.ndarray


def fit_scores(samples: Samples, classes: np.ndarray, config: LearningConfig) -> FittedScores:
    """Fits every template; one without a detection takes the numbers of the whole template.

    Args:
        samples: at least one of them found with the whole template.
        classes: (K,) columns of the samples that become the model's classes.
        config: how far few samples are trusted.
    """
    generic = generic_evidence_model().scores
    rows = len(classes) + 1
    mean, sigma, votes = (np.zeros((rows, TEMPLATES, BINS)) for _ in range(3))
    background_mean, background_sigma, counts = (np.zeros((rows, TEMPLATES)) for _ in range(3))
    other, confusion, platt = np.zeros(TEMPLATES), np.zeros(TEMPLATES), np.zeros((TEMPLATES, 2))
    false_part, false_scores = samples.background()
    for part in range(TEMPLATES):
        own = (samples.part == part) & samples.named_right
        false = false_scores[false_part == part]
        if not own.any():
            if not part:
                raise ValueError("no detection of a whole object names its class")
            for array in (mean, sigma, background_mean, background_sigma):
                array[:, part] = array[:, 0]
            other[part], confusion[part], platt[part] = other[0], confusion[0], platt[0]
            continue
        class_id = samples.class_id[own]
        member = np.stack([*(class_id == k for k in classes), np.ones(len(class_id), dtype=bool)])
        fitted = _own_class(samples.own_score[own], soft_votes(samples.occlusion[own]), member, config)
        mean[:, part], sigma[:, part], votes[:, part] = fitted
        prior = generic.background_mean[0, part], generic.background_sigma[0, part]
        fitted = _background(best_score(false), best_class(false), classes, prior, config)
        background_mean[:, part], background_sigma[:, part], counts[:, part] = fitted
        seen = (samples.part == part) & samples.found & (samples.occlusion <= TRUNCATION)
        wrong = int((seen & ~samples.named_right).sum())
        confusion[part] = _shrunk(wrong, int(seen.sum()), generic.confusion[part], config)
        other[part] = _other_sigma(samples.scores[seen], samples.class_id[seen], generic.other_sigma[part], config)
        platt[part] = fit_platt(best_score(samples.scores[seen]), best_score(false), generic.platt_ab[part])
    low = background_mean[-1]
    linear = np.column_stack([low, np.maximum(mean[-1, :, 0], low + LEAST_RANGE)])
    names = tuple(samples.classes[k] for k in classes)
    model = ScoreModel(
        names, mean, sigma, background_mean, background_sigma, other, confusion, platt, np.clip(linear, 0.0, 1.0)
    )
    return FittedScores(model, votes, counts)


def soft_votes(occlusion: np.ndarray) -> np.ndarray:
    """(T, 10) votes of samples with occlusion (T,) for the bins; every row sums to 1, at most two are not zero."""
    place = np.clip(occlusion * BINS - 0.5, 0.0, BINS - 1.0)
    return np.maximum(1.0 - np.abs(place[:, None] - np.arange(BINS)), 0.0)


def _own_class(
    score: np.ndarray, votes: np.ndarray, member: np.ndarray, config: LearningConfig
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(K + 1, 10) mean, standard deviation and votes; `member` (K + 1, T) says which samples count for a row."""
    pooled_mean, pooled_sigma = _pooled(score, votes, config)
    N0 = config.pseudo_votes
    n = member.astype(np.float64) @ votes
    # A class scores higher or lower than the others as a whole before it does so in one bin.
    above = score - votes @ pooled_mean
    offset = (member @ above) / (member.sum(axis=1) + N0)
    offset[-1] = 0.0
    prior = pooled_mean + offset[:, None]
    mean = ((member * score) @ votes + N0 * prior) / (n + N0)
    mean[-1] = pooled_mean
    squares = np.stack([(row * (score - votes @ mean[k]) ** 2) @ votes for k, row in enumerate(member)])
    sigma = np.sqrt((squares + N0 * pooled_sigma**2) / (n + N0))
    sigma[-1] = pooled_sigma
    return np.clip(mean, 0.0, 1.0), np.maximum(sigma, config.sigma_floor), n


def _pooled(score: np.ndarray, votes: np.ndarray, config: LearningConfig) -> tuple[np.ndarray, np.ndarray]:
    """(10,) mean and standard deviation over all classes; bins with few votes are drawn to their neighbours."""
    N0, n = config.pseudo_votes, votes.sum(axis=0)
    full = n >= N0
    if not full.any():
        full = n == n.max()
    own = (score @ votes) / np.maximum(n, 1e-9)
    between = np.interp(BIN_CENTRES, BIN_CENTRES[full], own[full])
    mean = np.where(full, own, (n * own + N0 * between) / (n + N0))
    squares = ((score - votes @ mean) ** 2) @ votes
    spread = squares / np.maximum(n, 1e-9)
    between = np.interp(BIN_CENTRES, BIN_CENTRES[full], spread[full])
    return mean, np.sqrt(np.where(full, spread, (squares + N0 * between) / (n + N0)))


def _background(
    score: np.ndarray, named: np.ndarray, classes: np.ndarray, prior: tuple[float, float], config: LearningConfig
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(K + 1,) mean, standard deviation and number of (B,) top scores of detections that name (B,) classes."""
    N0 = config.pseudo_votes
    member = np.stack([*(named == k for k in classes), np.ones(len(named), dtype=bool)]).astype(np.float64)
    n = member.sum(axis=1)
    center = (score.sum() + N0 * prior[0]) / (len(score) + N0)
    mean = (member @ score + N0 * np.append(np.full(len(classes), center), prior[0])) / (n + N0)
    spread = (((score - center) ** 2).sum() + N0 * prior[1] ** 2) / (len(score) + N0)
    squares = np.array([row @ (score - mean[k]) ** 2 for k, row in enumerate(member)])
    sigma = np.sqrt((squares + N0 * spread) / (n + N0))
    sigma[-1] = np.sqrt(spread)
    return mean, np.maximum(sigma, config.sigma_floor), n


def _other_sigma(scores: np.ndarray, class_id: np.ndarray, prior: float, config: LearningConfig) -> float:
    """Half-normal scale of the scores of classes that are neither the object's nor the one that it was taken for."""
    foreign = scores.copy()
    rows = np.arange(len(scores))
    foreign[rows, class_id] = np.nan
    foreign[rows, best_class(scores)] = np.nan
    squares = foreign[~np.isnan(foreign)] ** 2
    variance = _shrunk(float(squares.sum()), len(squares), prior**2, config)
    return max(float(np.sqrt(variance)), config.other_floor)


def _shrunk(total: float, count: int, prior: float, config: LearningConfig) -> float:
    """Mean of `count` numbers with this total, drawn to the prior."""
    return (total + config.pseudo_votes * prior) / (count + config.pseudo_votes)

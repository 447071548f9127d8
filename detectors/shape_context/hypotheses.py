"""Hypotheses h = (x, s, v): local maxima of a smoothed heat map of votes, with those who voted for them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from .config import VotingConfig
from .voting import Votes

REACH = 2.0  # sigmas from a maximum within which a vote is one for it


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """H hypotheses of one class in one image.

    Attributes:
        xy: (H, 2) pixels, where the middle of an object should be.
        score: (H,) weight of the votes, each times the Gaussian of its distance.
        size: (H, 2) pixels, width and height: weighted medians of what its voters say.
        voters: for each the (n,) indices of its votes.
    """

    xy: np.ndarray
    score: np.ndarray
    size: np.ndarray
    voters: tuple[np.ndarray, ...]

    def __len__(self) -> int:
        return len(self.xy)

    @property
    def xyxy(self) -> np.ndarray:
        """(H, 4) pixels from the image's outer edges, as in `Detections`."""
        middle = self.xy + 0.5
        return np.concatenate([middle - self.size / 2.0, middle + self.size / 2.0], axis=1)


def find_hypotheses(votes: Votes, sides: np.ndarray, config: VotingConfig) -> Hypotheses:
    """Hypotheses of every group of votes by itself.

    Args:
        votes: valid ones of one class.
        sides: (N,) pixels, the size of each group's proposal, by which its heat map is smoothed.
        config: cell, smoothing, maxima and least score.
    """
    xy, score, size, voters = [], [], [], []
    for group, members in _groups(votes):
        sigma = max(config.smoothing * float(sides[group]), config.cell / 2.0)
        own = votes.select(members)
        for peak in _peaks(own, sigma, config):
            middle = np.average(own.xy, axis=0, weights=_pull(own, peak, sigma))  # the peak is that of a cell
            pull = _pull(own, middle, sigma)
            near = pull > 0.0
            weight = pull[near]
            xy.append(middle)
            score.append(float(weight.sum()))
            size.append([_weighted_median(own.size[near, k], weight) for k in range(2)])
            voters.append(members[near])
    strong = _strong_enough(np.array(score), np.array([votes.group[v[0]] for v in voters]), config.min_score)
    return Hypotheses(
        np.array(xy).reshape(-1, 2)[strong],
        np.array(score)[strong],
        np.array(size).reshape(-1, 2)[strong],
        tuple(v for v, keep in zip(voters, strong, strict=True) if keep),
    )


def _pull(votes: Votes, middle: np.ndarray, sigma: float) -> np.ndarray:
    """(V,) weight of every vote, times the Gaussian of its distance from a place; 0 beyond `REACH`."""
    away = ((votes.xy - middle) ** 2).sum(axis=1) / sigma**2
    return np.where(away <= REACH**2, votes.weight * np.exp(-0.5 * away), 0.0)


def _groups(votes: Votes) -> Iterator[tuple[int, np.ndarray]]:
    """(group, indices of its votes), by group."""
    order = np.argsort(votes.group, kind="stable")
    numbers, first = np.unique(votes.group[order], return_index=True)
    last = np.append(first, len(order))[1:]
    for number, start, stop in zip(numbers, first, last, strict=True):
        yield int(number), order[start:stop]


def _peaks(votes: Votes, sigma: float, config: VotingConfig) -> np.ndarray:
    """(P, 2) pixels, the highest local maxima of the heat map, highest first."""
    low = votes.xy.min(axis=0)
    bins = ((votes.xy - low) / config.cell).astype(np.int64)
    columns, rows = bins.max(axis=0) + 1
    heat = np.bincount(bins[:, 1] * columns + bins[:, 0], votes.weight, int(rows * columns))
    heat = heat.reshape(rows, columns).astype(np.float32)
    if min(heat.shape) > 1 or max(heat.shape) > 1:
        spread = sigma / config.cell
        heat = cv2.GaussianBlur(heat, (0, 0), spread, borderType=cv2.BORDER_CONSTANT)
    highest = cv2.dilate(heat, np.ones((3, 3), np.uint8))
    y, x = np.nonzero((heat == highest) & (heat > 0.0))
    best = np.argsort(-heat[y, x], kind="stable")[: config.maxima]
    return low + (np.stack([x, y], axis=1)[best] + 0.5) * config.cell


def _strong_enough(score: np.ndarray, group: np.ndarray, least: float) -> np.ndarray:
    """(H,) bool: at least that share of the best score of its group."""
    if len(score) == 0:
        return np.zeros(0, dtype=bool)
    best = np.zeros(int(group.max()) + 1)
    np.maximum.at(best, group, score)
    return score >= least * best[group]


def _weighted_median(values: np.ndarray, weight: np.ndarray) -> float:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order])
    return float(values[order[np.searchsorted(share, 0.5 * share[-1])]])

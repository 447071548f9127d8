"""Which pairs of boxes are worth integrating: all others have no relation worth the name."""

from __future__ import annotations

from enum import Enum

import numpy as np

from .relation_boxes import Pairs, UprightBoxes

SIGMAS = 4.5  # P(a normal variable is beyond) = 7e-6: what is farther off counts as impossible
TOUCHING_STD = 0.02  # m: more than boxes of touching things are apart (`relation_support.CONTACT_STD`)
PAIRS_AT_ONCE = 1_000_000  # looked at in one sweep: some 50 MB


class Near(Enum):
    """What a pair may be, horizontally and in height."""

    ABOVE_TOUCHING = "the first's centre over the second's footprint, its bottom at the second's top"
    ABOVE_OR_BELOW = "a centre of one over or under the other's footprint"
    WITHIN = "the first's centre over or under the second's footprint, at heights that they share"
    BESIDE = "boxes no farther apart than they are wide, at heights that they share"


def candidate_pairs(
    boxes: UprightBoxes, first: np.ndarray, second: np.ndarray, near: Near, reach: float | None = None
) -> Pairs:
    """The pairs out of `first` (F,) and `second` (S,), indices, that may be near, none with itself.

    Nothing that may be is left out: boxes are taken as circles about them, and errors as `SIGMAS` of their largest.

    Args:
        boxes: that the indices count.
        first, second: of which every pair is looked at.
        near: in which way.
        reach: metres between boxes that are `BESIDE` each other; by default as far as both are wide.
    """
    rows = max(PAIRS_AT_ONCE // max(len(second), 1), 1)
    found = [_sweep(boxes, first[start : start + rows], second, near, reach) for start in range(0, len(first), rows)]
    a, b = (np.concatenate([part[k] for part in found]) for k in (0, 1)) if found else (first, first)
    return Pairs.of(boxes, a, b)


def _sweep(
    boxes: UprightBoxes, first: np.ndarray, second: np.ndarray, near: Near, reach: float | None
) -> tuple[np.ndarray, np.ndarray]:
    spread = np.sqrt(np.trace(boxes.covariance[:, :2, :2], axis1=1, axis2=2))
    radius = np.linalg.norm(boxes.size[:, :2] + SIGMAS * boxes.size_std[:, :2], axis=1) / 2.0
    error = SIGMAS * np.hypot(spread[first][:, None], spread[second])
    a, b = boxes.centre[first], boxes.centre[second]
    distance = np.hypot(a[:, :1] - b[:, 0], a[:, 1:2] - b[:, 1])
    limit = radius[second] + error
    if near is Near.ABOVE_OR_BELOW:
        limit = np.maximum(radius[first][:, None], radius[second]) + error
    if near is Near.BESIDE:
        # the circles' radii are at least half the widths, so their sum is at least the mean width that is the default
        both = radius[first][:, None] + radius[second]
        limit = both + error + (both if reach is None else reach)
    possible = (distance <= limit) & (first[:, None] != second)
    if near is not Near.ABOVE_OR_BELOW:
        possible &= _heights_agree(boxes, first, second, near, distance)
    rows, columns = np.nonzero(possible)
    return first[rows], second[columns]


def _heights_agree(
    boxes: UprightBoxes, first: np.ndarray, second: np.ndarray, near: Near, distance: np.ndarray
) -> np.ndarray:
    height, half = boxes.centre[:, 2], boxes.size[:, 2] / 2.0
    variance = boxes.covariance[:, 2, 2] + boxes.size_std[:, 2] ** 2 / 4.0
    tilt = boxes.tilt_std * distance
    error = SIGMAS * np.sqrt(variance[first][:, None] + variance[second] + tilt**2 + TOUCHING_STD**2)
    above = (height - half)[first][:, None] - (height + half)[second]
    if near is Near.ABOVE_TOUCHING:
        return np.abs(above) <= error
    below = (height - half)[second] - (height + half)[first][:, None]
    return (above <= error) & (below <= error)

"""Which of the refined hypotheses remain: the best of those that overlap in space, if it has evidence of its own.

Meger et al., Explicit Occlusion, section 3: suppression "based on their overlap in 3D", never in the image, so that two
objects of one class, one behind the other, both remain. Clutter, algorithm 1, takes the hypotheses "by descending
likelihood": a detection that a better hypothesis explains is no evidence for a worse one any more.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..proposals.volumes import Volumes


def distinct(volumes: Volumes) -> Volumes:
    """One of those that came out alike: same class and same detections, so the same optimum; the lowest energy wins.

    Those without any detection are left out: nothing speaks for them.
    """
    if not len(volumes):
        return volumes
    flat = volumes.detection_of.reshape(len(volumes), -1)
    order = np.lexsort([np.arange(len(volumes)), volumes.energy])
    keys = np.hstack([volumes.class_id[:, None], flat])[order]
    _, first = np.unique(keys, axis=0, return_index=True)
    kept = order[np.sort(first)]
    return volumes.select(kept[np.any(flat[kept] >= 0, axis=1)])


def suppress(volumes: Volumes, R_world_upright: np.ndarray, overlap: float) -> Volumes:
    """Non-maximum suppression in space, best likelihood first; the order of what remains.

    Args:
        volumes: scored.
        R_world_upright: (3, 3) frame of the volumes.
        overlap: intersection over union of upright boxes above which the less likely one goes, of whatever class.
    """
    order = np.argsort(-volumes.log_likelihood, kind="stable")
    centres = np.ascontiguousarray(volumes.position[order] @ R_world_upright)
    half = np.ascontiguousarray(np.exp(volumes.log_size[order]))
    return volumes.select(order[_best_first(centres, half, float(overlap))])


def unexplained(volumes: Volumes) -> Volumes:
    """Of hypotheses in descending likelihood, those with a detection that no better one has.

    What remains keeps only the detections that are its own.
    """
    taken: set[int] = set()
    kept, own = [], []
    for n, volume in enumerate(volumes):
        free = np.isin(volume.detection_of, list(taken), invert=True) & (volume.detection_of >= 0)
        if not free.any():
            continue
        mine = np.where(free, volume.detection_of, -1)
        taken.update(mine[mine >= 0].tolist())
        kept.append(n)
        own.append(mine)
    left = volumes.select(np.array(kept, dtype=np.int64))
    if kept:
        left.detection_of[:] = np.array(own)
    return left


@njit(cache=True)
def _best_first(centres, half, overlap):
    """(N,) bool, True for boxes that no kept earlier one overlaps."""
    kept = np.ones(len(centres), np.bool_)
    for n in range(len(centres)):
        for m in range(n):
            if kept[m] and _intersection_over_union(centres[m], half[m], centres[n], half[n]) > overlap:
                kept[n] = False
                break
    return kept


@njit(cache=True)
def _intersection_over_union(c, a, d, b):
    """Of two boxes with centres c, d and half extents a, b along common axes."""
    inside, first, second = 1.0, 1.0, 1.0
    for i in range(3):
        inside *= max(min(c[i] + a[i], d[i] + b[i]) - max(c[i] - a[i], d[i] - b[i]), 0.0)
        first *= 2.0 * a[i]
        second *= 2.0 * b[i]
    return inside / (first + second - inside)

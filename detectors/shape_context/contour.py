"""What a contour as a whole says for a class and against everything else.

Votes look for what of a contour agrees; of many points some always do. Here all of them count: the mean, over the
described points of a proposal, of how much nearer the class's descriptors are than those of things that are none of the
classes (naive Bayes by nearest neighbours, O. Boiman et al., In Defense of Nearest-Neighbor Based Image Classification,
CVPR 2008). It is not in Georgakis et al.; on rendered tables it tells objects from clutter better than votes alone.
"""

from __future__ import annotations

import numpy as np


def contour_evidence(
    distance: np.ndarray, rival_distance: np.ndarray, owner: np.ndarray, count: int, bandwidth: float
) -> np.ndarray:
    """(N,) mean of (rival - class distance) / bandwidth over the points of each proposal; 0 without a point.

    Args:
        distance: (S, K) chi-square distances of points to their nearest descriptors of the class, infinite for a point
            without a context.
        rival_distance: (S, K2) the same to those of other things.
        owner: (S,) proposal of each point.
        count: N.
        bandwidth: chi-square distance.
    """
    usable = np.isfinite(distance).all(axis=1) & np.isfinite(rival_distance).all(axis=1)
    nearer = (rival_distance[usable].mean(axis=1) - distance[usable].mean(axis=1)) / bandwidth
    points = np.bincount(owner[usable], minlength=count)
    return np.bincount(owner[usable], nearer, count) / np.maximum(points, 1)

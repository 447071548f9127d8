"""How far apart two keyframes may be at most, quickly: relative covariances along paths of measured motions.

    Cov(T_t_b) <= sum over the path's links e of Ad(T_b_e) Sigma_e Ad(T_b_e)^T

A part of the measurements never knows more than all of them, so a path's covariance bounds that of the graph, and
candidates for loop closures that are chosen by it are too many rather than too few.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..trajectory.rigid import inverse
from .records import Link

LEVER = 2.0  # m, to what a camera sees: what weighs a path's rotation against its translation


def path_covariances(poses: np.ndarray, links: list[Link], b: int) -> np.ndarray:
    """Bounds on the covariance of keyframe `b` as seen from every other.

    Args:
        poses: (M, 4, 4) `T_world_camera`.
        links: measured motions between them; those of least uncertainty are taken.
        b: the keyframe at hand.

    Returns:
        (M, 6, 6) covariance of T_t_b in its right tangent [rad, m]; infinite on the diagonal where no path leads,
        0 for `b` itself.
    """
    ends = np.array([(link.a, link.b) for link in links], dtype=int).reshape(-1, 2)
    own = np.array([link.covariance for link in links]).reshape(-1, 6, 6)
    to_b = adjoints(inverse(poses[b]) @ poses[ends[:, 1]])
    added = to_b @ own @ np.swapaxes(to_b, 1, 2)
    spread = np.trace(added[:, 3:, 3:], axis1=1, axis2=2) + LEVER**2 * np.trace(added[:, :3, :3], axis1=1, axis2=2)
    best = _least(ends, spread)
    tree = csr_matrix((spread[best], ends[best].T), shape=(len(poses), len(poses)))
    length, before = dijkstra(tree, directed=False, indices=b, return_predecessors=True)
    link_of = {(int(ends[i, 0]), int(ends[i, 1])): i for i in best}
    result = np.zeros((len(poses), 6, 6))
    for t in np.argsort(length, kind="stable"):
        if np.isinf(length[t]):
            result[t] = np.diag(np.full(6, np.inf))
        elif t != b:
            p = before[t]
            link = link_of.get((t, p), link_of.get((p, t)))
            result[t] = result[p] + added[link]
    return result


def adjoints(T: np.ndarray) -> np.ndarray:
    """(N, 6, 6) Ad(T) for [rot, trans] tangents of (N, 4, 4) transforms: [[R, 0], [[t]x R, R]]."""
    R, t = T[:, :3, :3], T[:, :3, 3]
    cross = np.zeros_like(R)
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -t[:, 2], t[:, 1], -t[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    result = np.zeros((len(T), 6, 6))
    result[:, :3, :3] = result[:, 3:, 3:] = R
    result[:, 3:, :3] = cross @ R
    return result


def _least(ends: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Numbers of the links that are the least uncertain between their two keyframes."""
    pairs = np.sort(ends, axis=1)
    order = np.lexsort((spread, pairs[:, 1], pairs[:, 0]))
    pairs = pairs[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (pairs[1:] != pairs[:-1]).any(axis=1)
    return order[first]

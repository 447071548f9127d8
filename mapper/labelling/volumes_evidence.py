"""The volumes of the map's things as evidence: what lies in the box of a probable mug is probably a mug."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from ..map.boxes import box_axes
from ..map.object_map import ObjectMap
from ..map.thing import Thing
from .labelling_config import LabellingConfig, SourceConfig
from .sources import log_probabilities

REACH = 3.0  # standard deviations beyond its sides to which a box is looked at


def weighted_volumes(points: np.ndarray, object_map: ObjectMap, config: LabellingConfig) -> np.ndarray | None:
    """What is added to the evidence of voxels at (N, 3) mean `points`: that of the map's volumes for its classes, as
    much as `config.sources.volumes` says; None where that is nothing."""
    sources = config.sources
    if sources.volumes == 0.0:
        return None
    blur = config.voxels.voxel_size / 2.0
    return np.float32(sources.volumes) * volumes_evidence(points, object_map, object_map.classes, blur, sources)


def volumes_evidence(
    points: np.ndarray, object_map: ObjectMap, classes: Sequence[str], blur: float, config: SourceConfig
) -> np.ndarray:
    """Log probabilities of points by the things that they lie in.

        p(c | x) = max over things of   P(it exists) P(it is a c) P(x is in its box)

    Args:
        points: (N, 3) metres, map frame.
        object_map: the things.
        classes: K names of columns; what a thing may be besides counts for none of them.
        blur: metres, standard deviation of the points.
        config: for the bounds and the background (eq. 5).

    Returns:
        (N, K + 1) float32 ln p(c | x), the background's last.
    """
    p = np.zeros((len(points), len(classes)))
    for thing in object_map.things:
        rows, inside = _inside(points, thing, object_map.R_world_upright, blur)
        belief = np.array([thing.belief(name) for name in classes])
        p[rows] = np.maximum(p[rows], inside[:, None] * belief)
    return log_probabilities(p, config)


def _inside(
    points: np.ndarray, thing: Thing, R_world_upright: np.ndarray, blur: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of points near a thing, and the probabilities that they are in its box, whose sides are not exactly known.

    Along each of the box's axes a side at h is off by the centre's error, half the size's and the point's own, taken as
    independent: P = Phi((h - x) / sigma) Phi((h + x) / sigma), and the product over the axes.
    """
    axes = box_axes(thing.yaw, R_world_upright)
    variance = np.einsum("ij,ik,kj->j", axes, thing.position_covariance, axes)
    sigma = np.sqrt(variance + (thing.size_std / 2.0) ** 2 + blur**2)
    half = thing.size / 2.0
    reach = float(np.linalg.norm(half + REACH * sigma))
    rows = np.flatnonzero((np.abs(points - thing.position) <= reach).all(axis=1))
    local = (points[rows] - thing.position) @ axes
    return rows, np.prod(ndtr((half - local) / sigma) * ndtr((half + local) / sigma), axis=1)

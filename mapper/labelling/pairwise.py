"""What it costs neighbouring voxels to differ in label: equations (8) to (11) of Lai et al.

All are w_ij 1[y_i != y_j] with w_ij >= 0 that the labels do not enter: Potts terms, which graph cuts can minimise.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .mrf_config import MrfConfig, Smoothness


def pair_weights(
    edges: np.ndarray,
    voxels: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    colours: np.ndarray,
    config: MrfConfig,
) -> np.ndarray:
    """The weights of the term that `config.smoothness` names; arrays that it does not need are not looked at.

    Args:
        edges: (E, 2) int32 pairs of voxels.
        voxels, points, normals, colours: (N, 3) each, see below.
        config: which term, and its numbers; its strengths are divided by `looks`, which here stand against one look.

    Returns:
        (E,) float32 nats.
    """
    if config.smoothness is Smoothness.NORMALS:
        numbers = config.concave_share, config.normals_offset, config.normals_step, config.concave_from
        return normal_weights(edges, voxels, points, normals, config.normals_strength / config.looks, *numbers)
    if config.smoothness is Smoothness.COLOUR:
        return colour_weights(edges, colours, config.colour_strength / config.looks, config.contrast)
    return potts_weights(edges, config.potts_strength / config.looks if config.smoothness is Smoothness.POTTS else 0.0)


def potts_weights(edges: np.ndarray, strength: float) -> np.ndarray:
    """Equation (8): w = lambda, the `strength`, for every pair. (E,) float32."""
    return np.full(len(edges), strength, np.float32)


def colour_weights(
    edges: np.ndarray, colours: np.ndarray, strength: float, contrast: float | None = None
) -> np.ndarray:
    """Equation (9): w = lambda exp(-theta |x_i - x_j|^2), with x the mean colour of a voxel's points.

    Args:
        edges: (E, 2) int32.
        colours: (N, 3) in any unit; NaN where unknown: such a voxel has its neighbours' colour.
        strength: lambda, nats.
        contrast: theta, in the inverse square of the colours' unit; 1 / (2 <|x_i - x_j|^2>) if None.

    Returns:
        (E,) float32 nats.
    """
    squared = np.nan_to_num(_squared_differences(edges, np.asarray(colours, np.float32)))
    if contrast is None:
        mean = float(squared.mean(dtype=np.float64)) if len(squared) else 0.0
        contrast = 0.5 / mean if mean > 0.0 else 0.0
    return (strength * np.exp(-contrast * squared)).astype(np.float32)


def normal_weights(
    edges: np.ndarray,
    voxels: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    strength: float,
    concave_share: float,
    offset: float,
    step: float = math.inf,
    concave_from: float = 0.0,
) -> np.ndarray:
    """Equation (10): w = lambda (I(n_i, n_j) + epsilon) / d(n_i, n_j), with two exceptions of ours.

    The paper's: I is 1 where the surface is convex between the two, (n_i - n_j) . (i - j) > 0 (equation 11, i and j the
    positions of the voxels): going from one to the other, the normal turns the way one goes. Where it turns back, or
    where the two normals are the same, I is 0. d is the L2 distance of the unit normals, 0 to 2, plus the `offset`.

    Ours, since the inside of a bowl went to the table, which its floor was tied to while its wall was not:

    - Steps. Sheets one above the other look the same way and touch as voxels: a floor and the table beside it. Two
      voxels whose mean points p lie apart along their mean normal, |(n_i + n_j) / 2 . (p_i - p_j)| > `step`, are not
      on one surface: I is 0, and normals differ by 1 at least. On a plane and on an arc it is 0.
    - Hollows. A smooth one bends inwards as a crease does, but by less from voxel to voxel. Where I is 0, normals
      differ only by what they do beyond `concave_from`.

    Without the last two arguments it is the paper's.

    Args:
        edges: (E, 2) int32.
        voxels: (N, 3) positions or cells; only directions matter.
        points: (N, 3) mean positions of the voxels' points, in edges of a voxel; looked at for steps only.
        normals: (N, 3) unit normals, outwards (towards the cameras that saw them); zero or NaN where unknown: such a
            voxel has its neighbours' normal, and no step.
        strength: lambda, nats.
        concave_share: epsilon.
        offset: the small constant in d, so that equal normals cost lambda epsilon / offset.
        step: edges of a voxel; infinity for none.
        concave_from: of a difference of unit normals, 0 to 2.

    Returns:
        (E,) float32 nats.
    """
    arrays = edges, voxels, np.asarray(points, np.float64), np.asarray(normals, np.float32)
    return _normal_weights(*arrays, strength, concave_share, offset, step, concave_from)


@njit(cache=True)
def _squared_differences(edges: np.ndarray, values: np.ndarray) -> np.ndarray:
    squared = np.empty(len(edges), np.float32)
    for e in range(len(edges)):
        total = np.float32(0.0)
        for k in range(3):
            difference = values[edges[e, 0], k] - values[edges[e, 1], k]
            total += difference * difference
        squared[e] = total
    return squared


@njit(cache=True)
def _normal_weights(edges, voxels, points, normals, strength, concave_share, offset, step, concave_from) -> np.ndarray:
    weights = np.empty(len(edges), np.float32)
    for e in range(len(edges)):
        i, j = edges[e]
        length_i = length_j = squared = along = apart = 0.0
        for k in range(3):
            turn = normals[i, k] - normals[j, k]
            length_i += normals[i, k] * normals[i, k]
            length_j += normals[j, k] * normals[j, k]
            squared += turn * turn
            along += turn * (float(voxels[i, k]) - float(voxels[j, k]))
            apart += 0.5 * (normals[i, k] + normals[j, k]) * (points[i, k] - points[j, k])
        known = length_i > 0.0 and length_j > 0.0  # false for NaN too
        is_step = known and abs(apart) > step
        convex = known and along > 0.0 and not is_step
        distance = np.sqrt(squared) if known else 0.0
        if not convex:
            distance = max(0.0, distance - concave_from)
        if is_step:
            distance = max(1.0, distance)
        weights[e] = strength * ((1.0 if convex else 0.0) + concave_share) / (distance + offset)
    return weights

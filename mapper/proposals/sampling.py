"""Data-driven sampling: hypothetical objects drawn from detections (Meger et al., Explicit Occlusion, section 3).

One sample: a detection, with probability proportional to a confidence; a class, from its scores; a depth of a
surface, from the depth readings in the middle of its box; and a scale. The paper draws the scale from the class's size
prior. So it is done here, but several times, and of these draws one is kept with probability proportional to how well
the volume's projection agrees with the box (the alignment Gaussian of Clutter, III-D): sampling with importance
resampling, from prior times likelihood. The centre lies on the ray through the middle of the (implied whole) box,
behind the drawn surface by most of the volume's own radius along the ray.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from ...factors.size_prior import ClassSizePriors
from ...factors.solid import solid_kernel
from .views import PackedViews
from .volumes import Volumes

SIZE_DRAWS = 16  # sizes drawn for a sample, of which one is kept; own choice
CENTRE_VARIANCE, SCALE_VARIANCE = 0.25, 0.1  # of the alignment, as in `AssociationConfig`
KEPT_READINGS = 64  # depth readings kept of a box: quantiles of all of them


def sample_volumes(
    views: PackedViews,
    depths: Sequence[np.ndarray],
    class_shares: np.ndarray,
    confidence: np.ndarray,
    priors: ClassSizePriors,
    count: int,
    surface_offset: float,
    rng: np.random.Generator,
) -> Volumes:
    """`count` hypotheses; none where there is no detection.

    Args:
        views: V views with D detections.
        depths: of each detection, (M,) depths in metres that may be its object's surface (`box_depths`).
        class_shares: (D, K) probabilities of the classes by a detection's scores.
        confidence: (D,) not negative.
        priors: of the classes' sizes.
        count: how many.
        surface_offset: of the volume's radius along the ray, from its surface to its centre.
        rng: the source of chance.
    """
    usable = np.array([len(d) > 0 for d in depths], dtype=bool) & (confidence > 0.0)
    if count == 0 or not usable.any():
        return Volumes(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=np.int64))
    weight = np.where(usable, confidence, 0.0)
    detection = rng.choice(len(weight), size=count, p=weight / weight.sum())
    cumulative = np.cumsum(class_shares[detection], axis=1)
    class_id = (cumulative < rng.random((count, 1)) * cumulative[:, -1:]).sum(axis=1)
    z = np.array([depths[d][rng.integers(len(depths[d]))] for d in detection])
    sizes = draw_sizes(class_id, priors, SIZE_DRAWS, rng)
    position, log_size = np.empty((count, 3)), np.empty((count, 3))
    args = views.T_camera_rows, views.R_world_upright, views.camera, views.view, views.whole_xyxy
    _place_all(*args, detection, z, sizes, rng.random(count), surface_offset, position, log_size)
    return Volumes(position, log_size, class_id.astype(np.int64))


def draw_sizes(class_id: np.ndarray, priors: ClassSizePriors, draws: int, rng: np.random.Generator) -> np.ndarray:
    """(N, draws, 3) log half-axes from the size priors of N classes."""
    roots = np.linalg.cholesky(priors.covariance)
    standard = rng.standard_normal((len(class_id), draws, 3))
    return priors.mean[class_id + 1][:, None] + np.einsum("nij,nmj->nmi", roots[class_id + 1], standard)


def box_depths(depth: np.ndarray, whole_xyxy: np.ndarray, xyxy: np.ndarray, central_share: float) -> np.ndarray:
    """(M,) depths in metres in the central part of a box, at most `KEPT_READINGS` quantiles; empty without readings.

    Args:
        depth: (H, W) metres, 0 = no reading.
        whole_xyxy: (4,) pixels, the box of the whole object.
        xyxy: (4,) pixels, what was detected of it; the depth of an implied half may be an occluder's.
        central_share: of width and height of the detected box.
    """
    centre, half = (xyxy[:2] + xyxy[2:]) / 2.0, (xyxy[2:] - xyxy[:2]) * central_share / 2.0
    low = np.maximum(np.maximum(centre - half, whole_xyxy[:2]), 0.0)
    (x0, y0), (x1, y1) = np.floor(low).astype(int), np.ceil(np.maximum(centre + half, 0.0)).astype(int) + 1
    crop = depth[y0:y1, x0:x1]
    readings = crop[crop > 0.0]
    if len(readings) > KEPT_READINGS:
        readings = np.quantile(readings, (np.arange(KEPT_READINGS) + 0.5) / KEPT_READINGS)
    return readings.astype(float)


def class_shares(scores: np.ndarray) -> np.ndarray:
    """(D, K) scores, NaN where not reported, to probabilities of the classes; rows without a score are uniform."""
    known = np.nan_to_num(scores, nan=0.0)
    total = known.sum(axis=1, keepdims=True)
    uniform = np.full_like(known, 1.0 / max(known.shape[1], 1))
    return np.divide(known, total, out=uniform, where=total > 0.0)


@njit(cache=True)
def _place_all(T_rows, R, camera, view_of, whole, detection, z, sizes, chance, offset, position, log_size):
    for n in range(len(detection)):
        d = detection[n]
        T = T_rows[view_of[d]].T
        position[n], log_size[n] = place(T, R, camera, whole[d], z[n], sizes[n], chance[n], offset)


@njit(cache=True)
def place(T, R, camera, box, z, sizes, chance, offset):
    """Centre (3,) and log half-axes (3,) of one of the sizes (M, 3), drawn by how well it fits the box (4,)."""
    M = len(sizes)
    ray = np.empty(3)
    u = (0.5 * (box[0] + box[2]) - camera[2]) / camera[0]
    v = (0.5 * (box[1] + box[3]) - camera[3]) / camera[1]
    for i in range(3):
        ray[i] = T[i, 0] * u + T[i, 1] * v + T[i, 2]
    length = np.sqrt(np.sum(ray * ray))
    along, log_weight, centres = R.T @ (ray / length), np.empty(M), np.empty((M, 3))
    sides, unused = np.empty(4), np.zeros((4, 12))
    for m in range(M):
        # the ellipsoid's radius along the ray
        radius = 1.0 / np.sqrt(np.sum((along / np.exp(sizes[m])) ** 2))
        for i in range(3):
            centres[m, i] = T[i, 3] + ray[i] * (z + offset * radius / length)
        log_weight[m] = -1e3
        if solid_kernel(T, R, centres[m], sizes[m], sides, unused, False):
            for side in range(4):
                sides[side] = camera[side % 2] * sides[side] + camera[2 + side % 2]
            log_weight[m] = max(-1e3, -0.5 * _misfit(sides, box))
    weight = np.cumsum(np.exp(log_weight - np.max(log_weight)))
    drawn = min(np.searchsorted(weight, chance * weight[-1]), M - 1)
    return centres[drawn], sizes[drawn]


@njit(cache=True)
def _misfit(sides, box):
    """Squared errors of centre and of both log extents over their variances."""
    scale = np.sqrt((box[2] - box[0]) * (box[3] - box[1]))
    dx = 0.5 * (sides[0] + sides[2] - box[0] - box[2]) / scale
    dy = 0.5 * (sides[1] + sides[3] - box[1] - box[3]) / scale
    w = np.log((sides[2] - sides[0]) / (box[2] - box[0]))
    h = np.log((sides[3] - sides[1]) / (box[3] - box[1]))
    return (dx * dx + dy * dy) / CENTRE_VARIANCE + (w * w + h * h) / SCALE_VARIANCE

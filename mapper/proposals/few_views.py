"""Where one candidate is and how large, from its detections in few views.

The same proposals as in batch inference (Meger et al., Explicit Occlusion, section 3), for one object whose detections
are known: samples over likely classes and surface depths are each refined to convergence, and the likeliest remains.
With few views a class's size prior says more than the boxes do: of what is partly hidden, boxes are too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from ...datasets.frame import Intrinsics
from ...factors.size_prior import ClassSizePriors
from ..config import AssociationConfig
from ..estimation.lifting import LiftedDetection
from .alignment import optimise
from .refinement import geometry_of
from .sampling import draw_sizes, place
from .views import PackedViews, pack

CLASSES = 3  # likeliest classes that are tried
LEAST_SHARE = 0.1  # of the likeliest class's probability: rarer classes are not tried
DEPTHS = 2  # samples for each class and observation; refinement has one basin for nearly all of them
SIZE_DRAWS = 8  # sizes drawn for a sample, of which one is kept


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A place and a size for one candidate.

    Attributes:
        position: (3,) world, metres; `covariance` (3, 3) of the alignment's quadratic approximation.
        log_size: (3,) log half-axes in the upright frame; `log_size_covariance` (3, 3).
        class_id: for which this is the best; it is no classification.
        log_likelihood: nats, up to a constant of the observations.
    """

    position: np.ndarray
    covariance: np.ndarray
    log_size: np.ndarray
    log_size_covariance: np.ndarray
    class_id: int
    log_likelihood: float


def propose(
    observations: Sequence[tuple[np.ndarray, LiftedDetection]],
    intrinsics: Intrinsics,
    R_world_upright: np.ndarray,
    priors: ClassSizePriors,
    posterior: np.ndarray,
    surface_offset: float = 0.7,
    seed: int = 0,
) -> Proposal:
    """The best of several refined samples; equal arguments give equal results.

    Args:
        observations: `T_world_camera` (4, 4) and detection, of one object; several of one view are different templates.
        intrinsics: of all views.
        R_world_upright: (3, 3) frame of the volume.
        priors: of the classes' sizes.
        posterior: (K,) class probabilities so far; what they sum to does not matter.
        surface_offset: as in `LiftingConfig`.
        seed: of the samples.

    Raises:
        ValueError: no observations.
    """
    if not observations:
        raise ValueError("propose needs at least one observation")
    views, found, chosen = _pack_observations(observations, intrinsics, R_world_upright)
    rng = np.random.default_rng(seed)
    classes = _likely(posterior)
    D = len(found)
    class_id = np.tile(np.repeat(classes, DEPTHS), D)
    detection = np.repeat(np.arange(D), len(classes) * DEPTHS)
    depths = _surface_depths(found, DEPTHS, surface_offset)
    z = np.concatenate([np.tile(depths[d], len(classes)) for d in range(D)])
    sizes = draw_sizes(class_id, priors, SIZE_DRAWS, rng)
    x, energy, H = np.empty((len(z), 6)), np.empty(len(z)), np.empty((len(z), 6, 6))
    where = views.view, views.whole_xyxy, detection, z, sizes, rng.random(len(z)), surface_offset
    prior = np.ascontiguousarray(priors.mean), np.linalg.inv(priors.covariance)
    _refine_samples(geometry_of(views), where, prior, class_id, chosen, x, energy, H)
    share = posterior / posterior.sum()
    volume = np.linalg.slogdet(priors.covariance)[1]
    log_likelihood = np.log(share[class_id]) - 0.5 * volume[class_id + 1] - energy
    best = int(np.argmax(log_likelihood))
    covariance = np.linalg.inv(H[best])
    return Proposal(
        x[best, :3],
        covariance[:3, :3],
        x[best, 3:],
        covariance[3:, 3:],
        int(class_id[best]),
        float(log_likelihood[best]),
    )


def _pack_observations(
    observations: Sequence[tuple[np.ndarray, LiftedDetection]], intrinsics: Intrinsics, R_world_upright: np.ndarray
) -> tuple[PackedViews, list[LiftedDetection], np.ndarray]:
    """The views, their detections in order, and chosen (V, 5); of a template twice in one view, the last counts."""
    poses: list[np.ndarray] = []
    found: list[list[LiftedDetection]] = []
    for T, detection in observations:
        same = next((v for v, other in enumerate(poses) if np.array_equal(other, T)), None)
        if same is None:
            poses.append(T)
            found.append([detection])
        else:
            found[same].append(detection)
    classes = len(observations[0][1].scores)
    own = [np.zeros(classes)] * len(observations)
    views = pack(poses, found, own, R_world_upright, intrinsics, AssociationConfig())
    chosen = np.full((len(poses), 5), -1, dtype=np.int64)
    chosen[views.view, views.part] = np.arange(len(views.view))
    return views, [d for view in found for d in view], chosen


def _likely(posterior: np.ndarray) -> np.ndarray:
    """The likeliest classes, the likeliest first."""
    first = np.argsort(-posterior, kind="stable")[:CLASSES]
    return first[posterior[first] >= LEAST_SHARE * posterior[first[0]]]


def _surface_depths(detections: Sequence[LiftedDetection], count: int, surface_offset: float) -> np.ndarray:
    """(D, count) depths in metres before each detection's centre, half its noise apart."""
    centre = np.array([d.centre[2] - surface_offset * d.half_extents[1] for d in detections])
    noise = np.array([d.sigma_range for d in detections])
    steps = np.arange(count) - (count - 1) / 2.0
    return np.maximum(centre[:, None] + 0.5 * steps * noise[:, None], 0.1)


@njit(cache=True)
def _refine_samples(geometry, where, priors, class_id, chosen, x, energy, H):
    T_rows, R, camera = geometry[0], geometry[1], geometry[2]
    view_of, whole, detection, z, sizes, chance, offset = where
    means, informations = priors
    for n in range(len(x)):
        d, k = detection[n], class_id[n] + 1
        x[n, :3], x[n, 3:] = place(T_rows[view_of[d]].T, R, camera, whole[d], z[n], sizes[n], chance[n], offset)
        energy[n] = optimise(geometry, (means[k], informations[k]), chosen, x[n], H[n])

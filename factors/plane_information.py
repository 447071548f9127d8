"""How well a depth image fixes its pose: the point-to-plane Hessian at the final pose of a registration.

Registration by points (KISS-ICP) reports no covariance, and its own point-to-point Hessian believes that every point
holds the pose in all three directions. A point on a wall holds it along the wall's normal only:

    r_i = n_i · (T p_i - q_i),     J_i = n_i^T R [ -[p_i]_x, I ],     Lambda = sum_i J_i^T J_i / sigma^2

for the right tangent [rot, trans] of T = T_world_camera, with the plane (q_i, n_i) fitted to the map around T p_i and
sigma from the median absolute residual. The errors of neighbouring pixels are not independent: taking a few hundred
points instead of all twenty thousand keeps the covariance honest.

A fitted normal is itself uncertain: along the plane's direction v_j, where the neighbours scatter by l_j, it is off by
a variance w_j = s^2 l_j / (l_j - l_0)^2, with s^2 = l_0 / (count - 3). On a bare wall those errors alone would seem to
hold the pose along the wall to a few millimetres, so their expectation is taken out: each pair adds
J_i^T J_i - sum_j w_j J_ij^T J_ij, where J_ij is J_i with v_j for n_i.

Measured with KISS-ICP over five frames of three rendered hand-held sequences: normalised error squared per degree of
freedom 0.8, 1.5 and 1.3 (1.3, 1.7 and 2.7 without the correction and with 8 neighbours; in the last, a camera slipping
14 mm along a table-top then passed for known to 9 mm).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

SAMPLES = 300  # points of the source that count as independent
NEIGHBOURS, MIN_NEIGHBOURS = 16, 8  # map points that make a plane
RADIUS_M = 0.15  # how far from the point they may lie
_SHELLS = 3  # cells to the radius
MAX_THICKNESS = 0.1  # of a plane: smallest / middle eigenvalue of the neighbours' scatter
SIGMA_FLOOR_M = 1e-4  # keeps noise-free (rendered) depth from infinite information
MAD_TO_SIGMA = 1.4826  # of a Gaussian


@dataclass(frozen=True, slots=True, eq=False)
class PlaneInformation:
    """What the registration of one depth image against the map says about its pose.

    Attributes:
        information: (6, 6) in the right tangent [rot, trans] of T_world_camera, radians and metres; positive
            semidefinite, singular where the scene leaves a direction open. Zeros where nothing matched.
        residual_sigma_m: robust standard deviation of the point-to-plane residuals, metres; NaN where nothing matched.
        translation_eigenvalue_ratio: smallest / largest eigenvalue of the translation block; below 0.02 the scene
            leaves a direction open (bare walls and table-tops up to 0.003, rooms from 0.05). 0 where nothing matched.
        pairs: number of points matched to a plane.
    """

    information: np.ndarray
    residual_sigma_m: float
    translation_eigenvalue_ratio: float
    pairs: int

    def open_directions(self, ratio: float) -> np.ndarray:
        """(3, n) camera-frame directions of translation held by at most a ratio of what holds the best one."""
        strength, directions = np.linalg.eigh(self.information[3:, 3:])
        return directions[:, strength <= ratio * strength[-1]]

    def covariance(self, guess_sigma_rad: float = 0.1, guess_sigma_m: float = 0.2) -> np.ndarray:
        """(6, 6) covariance [rot, trans]; open directions are as uncertain as the registration's first guess was."""
        guess = np.repeat([guess_sigma_rad**-2, guess_sigma_m**-2], 3)
        return np.linalg.inv(self.information + np.diag(guess))


def point_to_plane_covariance(
    points_source: np.ndarray,
    T_world_camera: np.ndarray,
    map_points: np.ndarray,
    seed: int = 0,
    radius_m: float = RADIUS_M,
) -> PlaneInformation:
    """Information that a registered depth image carries about its pose (the module's equation).

    Args:
        points_source: (N, 3) metres, camera frame.
        T_world_camera: (4, 4) final pose of the registration.
        map_points: (M, 3) metres, world frame; the map that the image was registered against.
        seed: of the sample of the source; the same input gives the same answer.
        radius_m: how far from a point the map points of its plane may lie; larger for the sparse map of a LiDAR.
    """
    source = np.asarray(points_source, dtype=float)
    if len(source) > SAMPLES:
        source = source[np.random.default_rng(seed).choice(len(source), SAMPLES, replace=False, shuffle=False)]
    T = np.asarray(T_world_camera, dtype=float)
    points = source @ T[:3, :3].T + T[:3, 3]
    planes = _planes(points, np.ascontiguousarray(map_points, dtype=float), radius_m)
    if len(planes.index) == 0:
        return PlaneInformation(np.zeros((6, 6)), math.nan, 0.0, 0)
    residual = np.einsum("ni,ni->n", planes.axes[:, :, 0], points[planes.index] - planes.origins)
    sigma = math.hypot(MAD_TO_SIGMA * float(np.median(np.abs(residual))), SIGMA_FLOOR_M)
    axes = np.einsum("nik,ij->njk", planes.axes, T[:3, :3])  # camera frame
    J = np.concatenate([np.cross(source[planes.index][:, :, None], axes, axis=1), axes], axis=1)
    information = np.einsum("nik,nk,njk->ij", J, planes.weights, J) / sigma**2
    eigenvalues, eigenvectors = np.linalg.eigh(information)
    information = (eigenvectors * np.maximum(eigenvalues, 0.0)) @ eigenvectors.T
    translation = np.linalg.eigvalsh(information[3:, 3:])
    return PlaneInformation(information, sigma, max(float(translation[0] / translation[-1]), 0.0), len(planes.index))


class _Planes(NamedTuple):
    index: np.ndarray  # (P,) of the points that have a plane
    origins: np.ndarray  # (P, 3)
    axes: np.ndarray  # (P, 3, 3), columns: the normal, then two directions in the plane
    weights: np.ndarray  # (P, 3): 1 for the normal, minus the variance of the normal towards the others


def _planes(points: np.ndarray, map_points: np.ndarray, radius_m: float) -> _Planes:
    """Planes of the map around (N, 3) points, by least squares on the nearest map points."""
    near = _nearest(np.ascontiguousarray(points), map_points, NEIGHBOURS, radius_m)
    index = np.flatnonzero((near >= 0).sum(axis=1) >= MIN_NEIGHBOURS)
    near = near[index]
    used = (near >= 0).astype(float)
    count = used.sum(axis=1)
    neighbours = map_points[near]  # -1 reads the last one; `used` takes it out again
    origins = np.einsum("nk,nki->ni", used, neighbours) / count[:, None]
    offsets = (neighbours - origins[:, None]) * used[:, :, None]
    scatter, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))
    scatter = np.maximum(scatter, 0.0)
    flat = scatter[:, 0] < MAX_THICKNESS * scatter[:, 1]
    scatter, count = scatter[flat], count[flat]
    noise = scatter[:, :1] / (count - 3.0)[:, None]  # a plane through n points leaves n - 3 degrees of freedom
    weights = np.ones_like(scatter)
    weights[:, 1:] = -noise * scatter[:, 1:] / (scatter[:, 1:] - scatter[:, :1]) ** 2
    return _Planes(index[flat], origins[flat], axes[flat], weights)


@njit(cache=True)
def _nearest(points, map_points, neighbours, radius):
    """(N, neighbours) indices of the nearest map points within radius, nearest first, -1 where there are fewer.

    The map changes with every image, so a search tree would be built for one use; a hash of cells costs one pass over
    the map. Cells are visited in shells around the point's own until no nearer point can be left.
    """
    size, width = 1024, radius / _SHELLS
    while size < 2 * len(map_points):
        size *= 2
    head, following = np.full(size, -1, np.int32), np.empty(len(map_points), np.int32)
    for i in range(len(map_points)):
        x, y, z = _cell(map_points[i], width)
        slot = _slot(x, y, z, size)
        following[i] = head[slot]
        head[slot] = i
    found = np.full((len(points), neighbours), -1, np.int32)
    distances = np.empty(neighbours)
    for n in range(len(points)):
        distances[:] = radius * radius
        for shell in range(_SHELLS + 1):
            if distances[-1] > (max(shell - 1, 0) * width) ** 2:
                _search_shell(shell, points[n], map_points, width, head, following, distances, found[n])
    return found


@njit(cache=True)
def _search_shell(shell, point, map_points, width, head, following, distances, found):
    """Take in the points of the cells at this Chebyshev distance from the point's cell."""
    x, y, z = _cell(point, width)
    for cx in range(x - shell, x + shell + 1):
        for cy in range(y - shell, y + shell + 1):
            rim = abs(cx - x) == shell or abs(cy - y) == shell
            for cz in range(z - shell, z + shell + 1, 1 if rim or shell == 0 else 2 * shell):
                i = head[_slot(cx, cy, cz, len(head))]
                while i >= 0:
                    q = map_points[i]
                    d = (q[0] - point[0]) ** 2 + (q[1] - point[1]) ** 2 + (q[2] - point[2]) ** 2
                    # Two cells may share a slot: the cell is compared too, or the point would be found twice.
                    if d < distances[-1] and _cell(q, width) == (cx, cy, cz):
                        _insert(i, d, distances, found)
                    i = following[i]


@njit(cache=True)
def _cell(point, width):
    return math.floor(point[0] / width), math.floor(point[1] / width), math.floor(point[2] / width)


@njit(cache=True)
def _slot(x, y, z, size):
    return (x * 73856093 ^ y * 19349663 ^ z * 83492791) & (size - 1)


@njit(cache=True)
def _insert(index, distance, distances, found):
    """Insert into the sorted squared distances (K,) and their indices (K,), dropping the last."""
    k = len(distances) - 1
    while k > 0 and distances[k - 1] > distance:
        distances[k], found[k] = distances[k - 1], found[k - 1]
        k -= 1
    distances[k], found[k] = distance, index

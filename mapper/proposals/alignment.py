"""The best position and size of one volume for the detections that are taken to show it; camera poses are fixed.

What is minimised over x = (centre, log half-axes) is the negative logarithm of the appearance term's geometry and of
the size prior (Meger et al., Clutter, equation (5) and section III-B; Explicit Occlusion, equation (4)):

    E(x) = Σ_t 1/n_t Σ_i [ Σ_sides rho((A_i b_t(x) - b_ti) / sigma_ti) + rho(|c - c_ti| in the depth centre's metric) ]
           + (s - mu)^T Lambda (s - mu) / 2

with b_t(x) the sides of the projected box, A_i those of the half that template i covers, n_t the number of templates
that found it in view t (a view counts once, however many did), and rho Huber's. A side that is cut off is censored, as
in `factors/box_alignment.py`; every side is robust by itself, because an occluder that stands before one side of a
thing shifts that side only. Levenberg-Marquardt with the analytic Jacobian of `factors/volume.py`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...factors import box_alignment
from ...factors.solid import solid_kernel

HUBER = 1.345  # 95 % efficiency on Gaussian errors
STEPS = 40  # at most
SMALL_STEP = 1e-5  # m and log units; a step below it ends the descent
SMALL_GAIN = 1e-7  # relative decrease of E that ends it
MAX_DAMPING = 1e8
MIDDLE_SIDE = np.array(box_alignment.MIDDLE_SIDE)  # numba reads arrays


@njit(cache=True)
def optimise(geometry, prior, chosen, x, H):
    """Moves x (6,) to the minimum of E and returns E there; H (6, 6) becomes its Gauss-Newton Hessian.

    Args:
        geometry: (T_camera_rows, R_world_upright, camera, xyxy, sides_seen, sigma_px, centre, information) of
            `PackedViews`.
        prior: ((3,) mean, (3, 3) information) of the log half-axes.
        chosen: (V, 5) detection that shows the volume in each view with each template, -1 none.

    Infinite where the volume reaches a camera plane: then x stays.
    """
    g, trial, scaled, unused = np.zeros(6), np.empty(6), np.empty((6, 6)), np.empty((6, 6))
    cost = energy(geometry, prior, chosen, x, H, g, True)
    if not np.isfinite(cost):
        return cost
    damping = 1e-3
    for _ in range(STEPS):
        scaled[:] = H
        for i in range(6):
            scaled[i, i] += damping * H[i, i] + 1e-9
        step = np.linalg.solve(scaled, -g)
        for i in range(6):
            trial[i] = x[i] + max(min(step[i], 0.5), -0.5)
        tried = energy(geometry, prior, chosen, trial, unused, g, False)
        if tried <= cost:
            gain, small = cost - tried, np.max(np.abs(step)) < SMALL_STEP
            x[:] = trial
            cost = energy(geometry, prior, chosen, x, H, g, True)
            damping *= 0.2
            if small or gain < SMALL_GAIN * (1.0 + cost):
                break
        else:
            damping *= 10.0
            if damping > MAX_DAMPING:
                break
    return cost


@njit(cache=True)
def energy(geometry, prior, chosen, x, H, g, with_derivatives):
    """E(x); on request its gradient g (6,) and its Gauss-Newton Hessian H (6, 6)."""
    T_rows, R, camera, xyxy, seen, sigma, centre, information = geometry
    mean, weight = prior
    sides, J, row = np.empty(4), np.zeros((4, 12)), np.empty(6)
    if with_derivatives:
        H[:], g[:] = 0.0, 0.0
    total = 0.0
    for i in range(3):
        for j in range(3):
            pull = weight[i, j] * (x[3 + j] - mean[j])
            total += 0.5 * (x[3 + i] - mean[i]) * pull
            if with_derivatives:
                g[3 + i] += pull
                H[3 + i, 3 + j] += weight[i, j]
    for v in range(len(chosen)):
        count = 0
        for part in range(5):
            count += chosen[v, part] >= 0
        if count == 0:
            continue
        if not solid_kernel(T_rows[v].T, R, x[:3], x[3:], sides, J, with_derivatives):
            return np.inf
        share = 1.0 / count
        for part in range(5):
            d = chosen[v, part]
            if d < 0:
                continue
            for side in range(4):
                other, half = side, MIDDLE_SIDE[part] == side
                if half:
                    other = (side + 2) % 4
                focal = camera[side % 2]
                value = 0.5 * (sides[side] + sides[other])
                r = (focal * value + camera[2 + side % 2] - xyxy[d, side]) / sigma[d]
                if not seen[d, side] and (r <= 0.0 if side < 2 else r >= 0.0):  # at or beyond its bound
                    continue
                for i in range(6):
                    row[i] = 0.5 * (J[side, 6 + i] + J[other, 6 + i]) * focal / sigma[d]
                total += _add_residual(r, row, share, H, g, with_derivatives)
            total += _add_centre(x, centre[d], information[d], share, H, g, with_derivatives)
    return total


@njit(cache=True)
def _add_residual(r, row, share, H, g, with_derivatives):
    """share * rho(r); its derivatives are added."""
    size = abs(r)
    if with_derivatives:
        w = share * min(1.0, HUBER / max(size, 1e-12))
        for i in range(6):
            g[i] += w * r * row[i]
            for j in range(6):
                H[i, j] += w * row[i] * row[j]
    return share * (0.5 * r * r if size <= HUBER else HUBER * (size - 0.5 * HUBER))


@njit(cache=True)
def _add_centre(x, centre, information, share, H, g, with_derivatives):
    """share * rho of the distance to a depth centre in its own metric; its derivatives are added."""
    squared = 0.0
    for i in range(3):
        for j in range(3):
            squared += (x[i] - centre[i]) * information[i, j] * (x[j] - centre[j])
    size = np.sqrt(max(squared, 0.0))
    if with_derivatives:
        w = share * min(1.0, HUBER / max(size, 1e-12))
        for i in range(3):
            for j in range(3):
                g[i] += w * information[i, j] * (x[j] - centre[j])
                H[i, j] += w * information[i, j]
    return share * (0.5 * squared if size <= HUBER else HUBER * (size - 0.5 * HUBER))

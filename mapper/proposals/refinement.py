"""Position refinement: association and optimisation in turn, until the association no longer changes.

Meger et al., Explicit Occlusion, section 3 ("coordinate descent, alternating between two steps") and Clutter, section V
and algorithm 1. Every optimisation runs to convergence: "a crucial step", as it avoids oscillation between two
associations. The association is greedy: in each view, for each template, the detection that fits the projected volume
best. Competing hypotheses may share a detection; suppression sorts that out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit

from ...factors.size_prior import ClassSizePriors
from ...factors.solid import solid_kernel
from ..config import AssociationConfig
from .alignment import MIDDLE_SIDE, optimise
from .views import PackedViews
from .volumes import Volumes


def refine(
    volumes: Volumes, views: PackedViews, priors: ClassSizePriors, config: AssociationConfig, max_iterations: int
) -> Volumes:
    """N hypotheses, each at its own optimum, with the detections that show it.

    One that finds no detection stays where it was (`detection_of` all -1).

    Args:
        volumes: position, size and class of each.
        views: what to agree with.
        priors: of the classes' sizes.
        config: gates and weights of the association.
        max_iterations: rounds after which a hypothesis that still changes is left as it is.
    """
    N, V = len(volumes), len(views)
    x = np.hstack([volumes.position, volumes.log_size]).reshape(N, 6).astype(float)
    chosen = np.full((N, V, 5), -1, dtype=np.int64)
    iterations, settled, energies = np.zeros(N, np.int64), np.zeros(N, np.bool_), np.full(N, np.inf)
    hessians = np.tile(np.eye(6), (N, 1, 1))
    gates = (config.gate, config.new_cost, config.centre_variance, config.scale_variance, config.class_weight)
    _refine_all(
        geometry_of(views),
        (views.first, views.part, views.gate_information, views.own),
        (np.ascontiguousarray(priors.mean), np.linalg.inv(priors.covariance)),
        tuple(map(float, gates)),
        max_iterations,
        volumes.class_id.astype(np.int64),
        x,
        chosen,
        iterations,
        settled,
        energies,
        hessians,
    )
    # what reaches a camera has no energy there, and nothing shows it
    chosen[~np.isfinite(energies)] = -1
    covariance = np.linalg.inv(hessians)[:, :3, :3]
    refined = {"position": x[:, :3].copy(), "log_size": x[:, 3:].copy(), "detection_of": chosen}
    return replace(volumes, **refined, iterations=iterations, settled=settled, energy=energies, covariance=covariance)


def geometry_of(views: PackedViews) -> tuple[np.ndarray, ...]:
    """What `alignment.optimise` wants of the views."""
    v = views
    return v.T_camera_rows, v.R_world_upright, v.camera, v.xyxy, v.sides_seen, v.sigma_px, v.centre, v.information


@njit(cache=True)
def _refine_all(geometry, found, priors, gates, most, class_id, x, chosen, iterations, settled, energies, hessians):
    """Until the association stays, or comes back after one round: then the better one of the two that alternate.

    Clutter, section V, warns of "oscillation between two associations that suggest nearby locations".
    """
    means, informations = priors
    shape = chosen.shape[1:]
    last, other = np.empty(shape, np.int64), np.empty(shape, np.int64)
    for n in range(len(x)):
        k = class_id[n]
        prior = (means[k + 1], informations[k + 1])
        _associate(geometry, found, gates, k, x[n], chosen[n])
        other[:] = -2
        while iterations[n] < most and not settled[n]:
            last[:] = chosen[n]
            before_x, before_energy, before_H = x[n].copy(), energies[n], hessians[n].copy()
            if np.any(last >= 0):
                energies[n] = optimise(geometry, prior, last, x[n], hessians[n])
                iterations[n] += 1
            _associate(geometry, found, gates, k, x[n], chosen[n])
            settled[n] = np.all(chosen[n] == last)
            if not settled[n] and np.all(chosen[n] == other):
                settled[n] = True
                if before_energy < energies[n]:
                    last[:], x[n], energies[n], hessians[n] = other, before_x, before_energy, before_H
            other[:] = last
            if settled[n] or iterations[n] == most:
                chosen[n] = last  # under which x is the optimum


@njit(cache=True)
def _associate(geometry, found, gates, class_id, x, chosen):
    """Fill chosen (V, 5) with the cheapest detection of each view and template, -1 where none is within the gates.

    The cost is that of `estimation/association.py`: depth position, box alignment relative to the detection's scale,
    and the class as evidence, which may cost at most half of what may be spent.
    """
    T_rows, R, camera, xyxy, _, _, centre, _ = geometry
    first, part_of, gate_information, own = found
    gate, most, centre_variance, scale_variance, class_weight = gates
    sides, unused, box, best = np.empty(4), np.zeros((4, 12)), np.empty(4), np.empty(5)
    chosen[:] = -1
    for v in range(len(chosen)):
        if first[v] == first[v + 1]:
            continue
        if not solid_kernel(T_rows[v].T, R, x[:3], x[3:], sides, unused, False):
            continue
        for side in range(4):
            sides[side] = camera[side % 2] * sides[side] + camera[2 + side % 2]
        best[:] = most
        for d in range(first[v], first[v + 1]):
            part = part_of[d]
            cost = _quadratic(x, centre[d], gate_information[d])
            if cost > gate:
                continue
            _part_box(sides, part, camera, box)
            cost += _box_cost(box, xyxy[d], centre_variance, scale_variance)
            cost += min(2.0 * class_weight * (np.max(own[d]) - own[d, class_id]), 0.5 * most)
            if cost < best[part]:
                best[part], chosen[v, part] = cost, d


@njit(cache=True)
def _part_box(sides, part, camera, box):
    """Fill box (4,) with the part's half of the projected sides, clipped to the image."""
    box[:] = sides
    middle = MIDDLE_SIDE[part]
    if middle >= 0:
        box[middle] = 0.5 * (sides[middle] + sides[(middle + 2) % 4])
    for side in range(4):
        box[side] = min(max(box[side], -0.5), camera[4 + side % 2] - 0.5)


@njit(cache=True)
def _box_cost(box, detected, centre_variance, scale_variance):
    """Alignment error of two boxes: centres over the detection's scale, and log scale (Clutter, III-D)."""
    width, height = box[2] - box[0], box[3] - box[1]
    area = (detected[2] - detected[0]) * (detected[3] - detected[1])
    if not (width > 0.0 and height > 0.0 and area > 0.0):
        return np.inf
    dx = 0.5 * (box[0] + box[2] - detected[0] - detected[2])
    dy = 0.5 * (box[1] + box[3] - detected[1] - detected[3])
    ratio = 0.5 * np.log(width * height / area)
    return (dx * dx + dy * dy) / (area * centre_variance) + ratio * ratio / scale_variance


@njit(cache=True)
def _quadratic(x, centre, information):
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += (x[i] - centre[i]) * information[i, j] * (x[j] - centre[j])
    return total

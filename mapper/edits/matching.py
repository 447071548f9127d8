"""Whether a thing of a map is the one that somebody spoke of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .edit import Target

if TYPE_CHECKING:
    from ..map.thing import Thing

GATE = 14.16  # squared distance within which 99.73 % of what is one lies: chi-square of 3 degrees of freedom, 3 sigma
SHARE_OF_EXTENT = (
    0.25  # of the mean extent: the centre of what is seen from one side is off by as much (`merge_extent`)
)
CONTRADICTION = 0.05  # P(same class) below which two posteriors are of different things, as in `estimation/reunion.py`


def distance_squared(target: Target, thing: Thing) -> float:
    """Squared Mahalanobis distance of the two positions under the sum of their covariances and a share of the size.

    The two are estimates of one thing from partly the same views, so that the sum overstates how far they may differ.
    """
    extent = SHARE_OF_EXTENT * min(float(np.mean(target.size)), float(np.mean(thing.size)))
    covariance = target.position_covariance + thing.position_covariance + (extent**2 + 1e-8) * np.eye(3)
    apart = thing.position - target.position
    return float(apart @ np.linalg.solve(covariance, apart))


def agree_in_class(target: Target, thing: Thing) -> bool:
    """Whether both may be of one class: Σ_k p_k q_k is at least `CONTRADICTION`."""
    shared = target.class_posterior.keys() & thing.class_posterior.keys()
    return sum(target.class_posterior[k] * thing.class_posterior[k] for k in shared) >= CONTRADICTION


def mismatch(target: Target, thing: Thing | None) -> str | None:
    """Why the thing that has the target's id now, if any, is another one; None where it is the same."""
    if thing is None:
        return f"the map has no {target.id} any more"
    if distance_squared(target, thing) > GATE:
        apart = float(np.linalg.norm(thing.position - target.position))
        return f"{target.id} is {apart:.2f} m from where it was"
    if not agree_in_class(target, thing):
        return f"{target.id} was a {target.label}, and is a {thing.label} now"
    return None

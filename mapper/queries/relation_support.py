"""What rests on what: for every thing, how probably each thing below carries it, or something that is not in the map.

Resting is contact, and contact is a hypothesis about the scene rather than a distance: boxes fitted to noisy depth
never touch exactly. For a thing a and a support b let g = bottom(a) - top(b) be the gap that the map measured, s its
standard deviation, and t = `CONTACT_STD`. Resting on b predicts a gap of 0 ± t, seen with the error s; resting on
something that the map does not hold predicts any height of a room. Supports exclude each other, so by Bayes' rule

    w_b = E[ 1(centre of a over the footprint of b) N(g; 0, s^2 + t^2) ],    w_0 = 1 / ROOM_HEIGHT
    P(a rests on b | both exist) = w_b / (w_0 + w_b + w'_b + sum over other supports c of P(c exists) w_c)

where E runs over where a and b may be and how large b may be, and w'_b is the weight of b resting on a. Before the
heights are looked at, each support under the thing is as likely as none of them; for a thing of a class that stands on
the floor (`synonyms.yaml`) `OFF_FLOOR` times as likely: of chairs at a table detectors often see no more than the
backs, above it. What overhangs so far that its centre is not over the support would fall, so it does not rest there.
Sums over supports are at most 1. What is inside another thing c rests in there, not on what c stands on: all is times
P(a is in no other thing than b).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .relation_boxes import Pairs, UprightBoxes
from .relation_candidates import Near, candidate_pairs
from .relation_draws import draw
from .relation_places import is_inside

CONTACT_STD = 0.01  # m: how far boxes of touching things are apart; half a voxel of the map's cloud (`MapperConfig`)
OFF_FLOOR = 1e-3  # estimate: how seldom a chair or a cupboard stands on another thing of the map
ROOM_HEIGHT = 2.5  # m, floor to ceiling: a support that is not in the map may be as high as anything


@dataclass(frozen=True, slots=True, eq=False)
class Support:
    """`probability` (P,) that both things exist and `first` (P,) rests on `second` (P,), which are indices."""

    first: np.ndarray
    second: np.ndarray
    probability: np.ndarray


def supports(boxes: UprightBoxes, carried: np.ndarray) -> Support:
    """Every support that each of the `carried` (K,), indices, may have."""
    pairs = candidate_pairs(boxes, carried, np.arange(len(boxes)), Near.ABOVE_TOUCHING)
    weight = contact_weight(pairs)
    turned = contact_weight(Pairs.of(boxes, pairs.second, pairs.first))
    expected = weight * boxes.existence[pairs.second]
    rivals = np.bincount(pairs.first, weights=expected, minlength=len(boxes))[pairs.first] - expected
    floor = boxes.on_floor[pairs.first]
    others = weight + turned + np.maximum(rivals, 0.0)
    rests = (1.0 - floor) * weight / (others + 1.0 / ROOM_HEIGHT)
    rests += floor * weight / (others + 1.0 / (OFF_FLOOR * ROOM_HEIGHT))
    return Support(pairs.first, pairs.second, pairs.both_exist * rests * _not_inside_another(boxes, carried, pairs))


def _not_inside_another(boxes: UprightBoxes, carried: np.ndarray, pairs: Pairs) -> np.ndarray:
    """(P,) P(the first of a pair is in nothing but perhaps its second)."""
    within = candidate_pairs(boxes, carried, np.arange(len(boxes)), Near.WITHIN)
    inside = is_inside(within) / np.maximum(boxes.existence[within.first], 1e-12)
    outside = np.log1p(-np.minimum(inside, 1.0 - 1e-12))
    total = np.bincount(within.first, weights=outside, minlength=len(boxes))[pairs.first]
    of_pair = dict(zip(zip(within.first.tolist(), within.second.tolist(), strict=True), outside.tolist(), strict=True))
    own = [of_pair.get(pair, 0.0) for pair in zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)]
    return np.exp(np.minimum(total - np.array(own, dtype=np.float64), 0.0))


def carried_by(boxes: UprightBoxes, second: np.ndarray) -> Support:
    """Everything that may rest on one of `second` (S,), indices, with what else it may rest on."""
    pairs = candidate_pairs(boxes, np.arange(len(boxes)), second, Near.ABOVE_TOUCHING)
    return supports(boxes, np.unique(pairs.first))


def contact_weight(pairs: Pairs) -> np.ndarray:
    """(P,) w_b of every pair, 1 / metres."""
    from .relation_kernels import contact_density  # brings numba

    return contact_density(draw(pairs), CONTACT_STD)

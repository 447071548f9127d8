"""What a map claims with a probability or a covariance, beside what is true: the samples of protocol 5."""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np

from ....datasets.stamps import associate
from ....datasets.truth import TrueObject
from ....factors.odometry import pose3
from ...map.thing import Thing
from ..inputs.case import Case, PlacedThing
from ..things.errors import in_sorted_order
from ..things.matching import Matching, same_label

Pairs = Sequence[tuple[PlacedThing, TrueObject]]


def class_claims(case: Case, matching: Matching) -> tuple[np.ndarray, np.ndarray]:
    """Class posteriors of matched things, beside the classes of their objects.

    Columns are the truth's classes, then what the map says besides (some stay empty). Labels that mean the same are
    added up. What a posterior lacks to a sum of 1 is shared evenly by the classes of the map that it does not name,
    as a map leaves out only what is small (`Thing.class_posterior`).

    Returns:
        (N, K) probabilities with rows that sum to 1, and (N,) columns of the true classes.
    """
    known = [name.casefold() for name in case.truth.classes]
    posteriors = [_completed(thing.thing, case.run.object_map.classes) for thing, _ in matching.matched]
    column: dict[str, int] = {}
    for name in dict.fromkeys(name for posterior in posteriors for name in posterior):
        meant = case.to_truth_label(name)
        column[name] = len(known) + len(column) if meant is None else known.index(meant.casefold())
    rows = np.zeros((len(posteriors), len(known) + len(column)))
    for row, posterior in zip(rows, posteriors, strict=True):
        for name, probability in posterior.items():
            row[column[name]] += probability
    return rows, np.array([known.index(true.label.casefold()) for _, true in matching.matched], dtype=np.int64)


def existence_claims(matching: Matching) -> tuple[np.ndarray, np.ndarray]:
    """(N,) existence of all things, and (N,) bool whether each stands for an object."""
    stands = np.zeros(len(matching.things), dtype=bool)
    stands[matching.pairs[:, 0]] = True
    return np.array([thing.thing.existence for thing in matching.things]), stands


def position_claims(case: Case, pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) errors of positions and their (N, 3, 3) covariances, in the truth's axes, metres.

    A map is estimated relative to its first camera, and so are its covariances: the first pose is made the same, no
    other (`Case.anchored`). Objects whose own position has a tolerance are left out: it is not in the covariance.
    """
    exact = [(thing.thing, true) for thing, true in pairs if true.id not in case.truth.tolerance]
    errors = [case.anchored.apply(thing.position) - true.position for thing, true in exact]
    covariances = [case.anchored.R @ thing.position_covariance @ case.anchored.R.T for thing, _ in exact]
    return np.array(errors).reshape(-1, 3), np.array(covariances).reshape(-1, 3, 3)


def size_claims(pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) errors of extents, compared sorted (`things.errors`), and their (N, 3, 3) covariances, metres; objects of
    unknown size are left out."""
    sized = [(thing.thing, true.size) for thing, true in pairs if np.isfinite(true.size).all()]
    errors = [in_sorted_order(thing.size, thing.size) - in_sorted_order(size, size) for thing, size in sized]
    covariances = [np.diag(in_sorted_order(thing.size_std, thing.size) ** 2) for thing, _ in sized]
    return np.array(errors).reshape(-1, 3), np.array(covariances).reshape(-1, 3, 3)


def pose_claims(case: Case) -> tuple[np.ndarray, np.ndarray] | None:
    """(N, 6) errors of keyframe poses and their (N, 6, 6) covariances, [rot, trans], radians and metres.

        e_t = Log( (T_true_0^-1 T_true_t)^-1 (T_0^-1 T_t) )

    in the right tangent of the pose, with the first keyframe 0 as gauge: it has no error, and is left out. None where
    the run wrote no covariances, or the truth lacks the poses.
    """
    keyframes, truth = case.run.keyframes, case.truth
    if keyframes is None or truth.poses is None or len(truth.stamps) == 0:
        return None
    pairs = associate(keyframes.stamps, truth.stamps, case.config.max_time_difference)
    pairs = [(row, index) for row, index in pairs.tolist() if np.isfinite(truth.poses[index]).all()]
    if len(pairs) < 2 or pairs[0][0] != int(np.argmin(keyframes.stamps)):
        return None
    (first, first_true), *others = pairs
    T_first, T_true_first = pose3(keyframes.poses[first]), pose3(truth.poses[first_true])
    errors = []
    for row, index in others:
        estimate = T_first.between(pose3(keyframes.poses[row]))
        errors.append(gtsam.Pose3.Logmap(T_true_first.between(pose3(truth.poses[index])).between(estimate)))
    return np.array(errors), keyframes.covariances[[row for row, _ in others]]


def _completed(thing: Thing, classes: Sequence[str]) -> dict[str, float]:
    """The posterior with all classes of the map, summing to 1; what lacks is shared by those it does not name, or by
    all where it names them all."""
    posterior = dict(thing.class_posterior)
    absent = [name for name in classes if not any(same_label(name, other) for other in posterior)]
    missing = max(1.0 - sum(posterior.values()), 0.0)
    for name in absent or list(posterior):
        posterior[name] = posterior.get(name, 0.0) + missing / len(absent or posterior)
    total = sum(posterior.values())
    return {name: probability / total for name, probability in posterior.items()}

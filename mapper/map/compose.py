"""From landmarks of the graph to the things of a map."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..estimation.landmarks import Landmark
from .appearance import Appearance
from .thing import Evidence, Thing
from .views_file import ThingViews

MIN_LISTED = 1e-6  # class probabilities below it are left out of a thing's posterior


def compose_thing(landmark: Landmark, classes: tuple[str, ...]) -> Thing:
    """A landmark as people see it: label, probabilities, position and size with their uncertainty.

    The size is 2 exp(s); its standard deviation is size times that of s, to first order.
    """
    posterior = landmark.belief.class_posterior()
    best = int(np.argmax(posterior))
    size = 2.0 * landmark.half_axes
    return Thing(
        id=f"thing-{landmark.number:04d}",
        label=classes[best],
        probability=float(posterior[best]),
        existence=landmark.belief.existence,
        class_posterior={classes[k]: float(p) for k, p in enumerate(posterior) if p >= MIN_LISTED or k == best},
        position=landmark.position,
        position_covariance=(landmark.covariance + landmark.covariance.T) / 2.0,
        size=size,
        size_std=size * np.sqrt(np.diag(landmark.log_size_covariance)),
        yaw=0.0,
        first_seen=landmark.first_seen,
        last_seen=landmark.last_seen,
        evidence=Evidence(len(landmark.supporting), len(landmark.occluded), len(landmark.contradicting)),
        views=ThingViews(classes, tuple(landmark.log), landmark.log.left_out_by),
        appearance=_appearance(landmark),
    )


def _appearance(landmark: Landmark) -> Appearance | None:
    mean = landmark.embedding.mean()
    return None if mean is None else Appearance(mean, landmark.embedding.views)


def compose_things(landmarks: Iterable[Landmark], classes: tuple[str, ...], min_existence: float) -> tuple[Thing, ...]:
    """Things whose existence is at least `min_existence`, by number."""
    ordered = sorted(landmarks, key=lambda landmark: landmark.number)
    return tuple(compose_thing(x, classes) for x in ordered if x.belief.existence >= min_existence)

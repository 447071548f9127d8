"""Lives of things on a `Stage`: seen, taken away, or mapped twice."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from stages import Stage, Thing

CUP, BOWL, NOTHING = (0.6, 0.1, 0.02), (0.1, 0.6, 0.02), (0.12, 0.1, 0.02)  # scores
BACK = 3.0  # m, a distance from which everything looks new after 2 m


def cup(x: float = 0.0, **kwargs) -> Thing:
    """A cup, x metres to the right."""
    return Thing((x, 0.0, 0.0), **{"scores": CUP, **kwargs})


def follow(
    stage: Stage, *things: Thing, places: Iterable[float] = (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4), pull: float = 2.0
) -> Stage:
    """The stage after a keyframe from each place."""
    for x in places:
        stage.show(x, *things, pull=pull)
    return stage


def empty(stage: Stage) -> Stage:
    """The things are taken away, which the camera sees from places where it has not been."""
    return follow(stage, places=np.linspace(-1.2, 1.2, 8), pull=BACK)


def twins(gap: float) -> Stage:
    """Landmarks 1 and 2 of one thing, `gap` metres apart, each from its own keyframes; `merge` not yet asked."""
    stage = Stage()
    stage.lifecycle.merge = lambda: None  # type: ignore[method-assign]
    for x in (0.0, gap):
        for place in (-0.4, -0.2, 0.0):
            before = list(stage.scene.landmarks.values())
            stage.scene.landmarks.clear()  # what is not in the scene is not associated
            stage.show(place + x, cup(x))
            for landmark in before:
                stage.scene.landmarks[landmark.number] = landmark
    del stage.lifecycle.merge
    assert sorted(stage.scene.landmarks) == [1, 2]
    return stage

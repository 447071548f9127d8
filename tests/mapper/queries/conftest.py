"""Things as boxes in a map whose up is z, for questions about where they are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.thing import Thing
from thingmap.mapper.map.up_direction import UpDirection


@pytest.fixture(scope="session")
def box(make_thing) -> Callable[..., Thing]:
    """`box(number, label, position, size, std, **changes)`: surely there and a `label`; errors of `std` metres."""

    def make(number: int, label: str, position: object, size: object, std: float = 0.005, **changes: object) -> Thing:
        values = {
            **{"position": position, "size": size, "position_covariance": std**2 * np.eye(3)},
            **{"size_std": [std] * 3, "yaw": 0.0, "existence": 1.0, "class_posterior": {label: 1.0}},
        }
        values |= changes
        return make_thing(number, label, values.pop("probability", 1.0), **values)

    return make


@pytest.fixture(scope="session")
def room() -> Callable[..., ObjectMap]:
    """`room(*things, up=..., std=...)`: a map of them; its classes are theirs."""

    def make(*things: Thing, up: object = (0.0, 0.0, 1.0), std: float = 0.0) -> ObjectMap:
        classes = tuple(dict.fromkeys(label for thing in things for label in thing.class_posterior))
        return ObjectMap(things, classes, "room", MapFrame.DATASET, UpDirection(np.array(up), std, "planes"))

    return make

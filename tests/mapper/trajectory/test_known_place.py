"""A place is lost by a step nothing measured, and found by loops that agree."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from thingmap.mapper.config import LoopConfig
from thingmap.mapper.estimation.records import Loop
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.trajectory.known_place import KnownPlace

SURE, UNMEASURED = 1e-4 * np.eye(6), 9.0 * np.eye(6)


class Walk:
    """What `KnownPlace` asks of a smoother: keyframes a decimetre apart, and loops."""

    def __init__(self) -> None:
        self.found: dict[int, Loop] = {}

    def poses(self) -> np.ndarray:
        poses = np.tile(np.eye(4), (100, 1, 1))
        poses[:, 0, 3] = 0.1 * np.arange(100)
        return poses

    def loops(self) -> dict[int, Loop]:
        return self.found

    def add_loop(self, a: int, b: int, off: float = 0.0) -> None:
        T = np.eye(4)
        T[0, 3] = 0.1 * (b - a) + off
        self.found[len(self.found)] = Loop(a, b, T, SURE)


@pytest.fixture
def walk() -> Walk:
    return Walk()


@pytest.fixture
def place(walk: Walk) -> KnownPlace:
    """Lost by the step from keyframe 3 to 4."""
    place = KnownPlace(replace(LoopConfig(), patience=10))
    place.follow(cast(Smoother, walk))
    for keyframe in range(1, 4):
        place.step(keyframe, SURE)
    assert place.is_known
    place.step(4, UNMEASURED)
    return place


def test_an_unmeasured_step_loses_the_place_and_measured_ones_do_not_find_it(place):
    for keyframe in range(5, 10):
        place.step(keyframe, SURE)
        assert not place.is_known
    assert (place.lost, place.found, place.given_up) == (1, 0, 0)


def test_two_keyframes_that_agree_find_it(place, walk):
    walk.add_loop(1, 4)
    place.step(5, SURE)
    assert not place.is_known  # one may be of a place that only looks the same
    walk.add_loop(2, 4)
    place.step(6, SURE)
    assert not place.is_known  # the same view twice is no second witness
    walk.add_loop(2, 5)
    place.step(7, SURE)
    assert place.is_known and place.found == 1


def test_a_loop_that_does_not_fit_is_no_witness(place, walk):
    walk.add_loop(1, 4)
    walk.add_loop(2, 5, off=0.5)
    place.step(6, SURE)
    assert not place.is_known


def test_loops_among_keyframes_since_it_was_lost_do_not_count(place, walk):
    walk.add_loop(4, 7)
    walk.add_loop(5, 8)
    place.step(9, SURE)
    assert not place.is_known


def test_the_place_is_not_found_by_loops_from_before_another_unmeasured_step(place, walk):
    walk.add_loop(1, 4)
    walk.add_loop(2, 5)
    place.step(6, UNMEASURED)
    assert not place.is_known
    place.step(7, SURE)
    assert not place.is_known and place.lost == 1
    walk.add_loop(1, 6)
    walk.add_loop(1, 7)
    place.step(8, SURE)
    assert place.is_known


def test_in_unknown_land_mapping_goes_on_after_a_while_of_measured_steps(place):
    place.step(9, UNMEASURED)  # patience counts from here
    for keyframe in range(10, 19):
        place.step(keyframe, SURE)
        assert not place.is_known
    place.step(19, SURE)
    assert place.is_known and place.given_up == 1


def test_it_can_be_lost_again(place, walk):
    walk.add_loop(1, 4)
    walk.add_loop(2, 5)
    place.step(6, SURE)
    place.step(7, UNMEASURED)
    assert not place.is_known and place.lost == 2


def test_without_loops_no_place_is_ever_lost():
    place = KnownPlace(LoopConfig())
    place.step(1, UNMEASURED)
    assert place.is_known and place.lost == 0

"""Which landmarks hold measurements of two things, and how measurements leave the graph and come back."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.mapper.config import LifecycleConfig
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.mix_ups import MixUp, disobeys, find_mix_ups
from thingmap.mapper.estimation.pose_graph import PoseGraph, solve_poses
from thingmap.mapper.estimation.records import DepthCentre, Loop
from thingmap.mapper.estimation.smoother import Smoother

TIGHT, LOOSE = 1e-5 * np.eye(6), np.diag(np.repeat([0.2**2, 0.4**2], 3))
CONFIG = LifecycleConfig()
CAMERAS = 8  # the later half drifts


class Table:
    """Cameras before object 1 and, beside it, a thing that the later ones take for it."""

    def __init__(self, tools, beside: float = 0.0, first: int = 4, covariance: np.ndarray = LOOSE) -> None:
        self.room = room = tools.Room()
        self.smoother: Smoother = room.smoother
        for t in range(CAMERAS):
            jumps = t == first
            error = np.array([0.0, 0.0, 0.0, beside, 0.0, 0.0]) if jumps else None
            room.add_camera(tools.look_at((2.0, 0.1 * t, 0.3)), error, covariance if jumps else TIGHT)
        room.add_object(1, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
        for t in range(CAMERAS):
            room.objects[1] = np.array([0.0, beside if t >= first else 0.0, 0.0]), np.log([0.1, 0.1, 0.1])
            room.see(t, 1)
        self.smoother.update()

    def poses(self) -> np.ndarray:
        return solve_poses(PoseGraph.of(self.smoother.ledger), self.smoother.poses())

    def found(self, tools) -> list[MixUp]:
        belief = tools.Stage().lifecycle.new_belief()
        position, log_size = self.smoother.position(1), self.smoother.log_size(1)
        return find_mix_ups([_landmark(belief, position, log_size)], self.smoother, self.poses(), CONFIG)

    def close(self) -> Loop:
        a, b = 0, CAMERAS - 1
        loop = Loop(a, b, np.linalg.inv(self.room.cameras[a]) @ self.room.cameras[b], TIGHT)
        self.smoother.add(loop)
        self.smoother.update()
        return loop


def _landmark(belief: Belief, position: np.ndarray, log_size: np.ndarray) -> Landmark:
    return Landmark(1, belief, position, log_size, 0.0, 0.0)


@pytest.mark.parametrize(("first", "parts"), [(4, [{0, 1, 2, 3}, {4, 5, 6, 7}]), (7, [set(range(7)), {7}])])
def test_measurements_of_two_things_are_told_apart_once_the_loop_is_closed(tools, first, parts):
    table = Table(tools, 0.5, first)
    table.close()
    assert [list(map(set, mix_up.keyframes)) for mix_up in table.found(tools)] == [parts]


def test_a_single_outlier_in_front_does_not_keep_the_number(tools):
    table = Table(tools, 0.5, 1)
    table.close()
    (mix_up,) = table.found(tools)
    assert mix_up.keyframes == (frozenset(range(1, 8)), frozenset({0}))


def test_one_thing_is_one(tools):
    table = Table(tools)
    table.close()
    assert table.found(tools) == []


def test_what_drift_explains_is_not_told_apart(tools):
    """Without a loop the later cameras may be anywhere within half a metre."""
    table = Table(tools, 0.5)
    assert table.found(tools) == []


def test_a_loop_is_obeyed_within_its_covariance(tools):
    table = Table(tools)
    loop = table.close()
    poses = table.smoother.poses().copy()
    assert not disobeys(loop, poses)
    poses[loop.b, 0, 3] += 0.1
    assert disobeys(loop, poses)


def test_keyframes_that_measured_nothing_go_with_their_neighbours():
    mix_up = MixUp(1, (frozenset({0, 2}), frozenset({8, 9})))
    assert mix_up.seen_in({1, 2, 3, 7, 20}, 0) == {1, 2, 3} and mix_up.seen_in({1, 2, 3, 7, 20}, 1) == {7, 20}


def test_dropped_measurements_count_no_more(tools, two_views):
    smoother = two_views().smoother
    wrong = smoother.add(DepthCentre(0, 1, np.array([0.3, 0.0, 2.0]), 0.001, 0.001, 1.0))
    smoother.update()
    assert np.linalg.norm(smoother.position(1)) > 0.02
    smoother.drop_measurements([wrong])
    smoother.drop_measurements([wrong])  # once is enough
    smoother.update()
    assert smoother.is_dropped(wrong) and wrong not in smoother.measurements(1)
    np.testing.assert_allclose(smoother.position(1), 0.0, atol=1e-3)
    again = Smoother.from_ledger(smoother.ledger, tools.exact, smoother.intrinsics)
    np.testing.assert_allclose(again.position(1), smoother.position(1), atol=1e-3)
    with pytest.raises(ValueError, match="is a Gauge, not a measurement"):
        smoother.drop_measurements([0])


@pytest.mark.parametrize("solved", [True, False])
def test_a_revived_landmark_is_where_it_was(tools, two_views, solved):
    smoother = two_views().smoother
    position, log_size, site = smoother.position(1), smoother.log_size(1), smoother.sites[1]
    measurements = smoother.measurements(1)
    smoother.retire(1)
    if solved:
        smoother.update()
    smoother.revive(1, position + 0.05, log_size, site)
    smoother.update()
    assert smoother.measurements(1) == measurements and smoother.rebuilds == 0
    np.testing.assert_allclose(smoother.position(1), position, atol=5e-3)  # a step from 5 cm off
    again = Smoother.from_ledger(smoother.ledger, tools.exact, smoother.intrinsics)
    np.testing.assert_allclose(again.position(1), position, atol=1e-3)

"""When poses count as corrected, and what is in no graph follows them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.config import TrackConfig
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.corrections import REUNIONS, CorrectionConfig, Followers, PoseWatch
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.records import Loop
from thingmap.mapper.estimation.scene import Scene

CONFIG = CorrectionConfig(translation=0.01, rotation=0.005)


def motion(x: float = 0.0, angle: float = 0.0) -> np.ndarray:
    """(4, 4) along x, and about z by an angle in rad."""
    T = np.eye(4)
    T[:3, :3], T[0, 3] = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix(), x
    return T


def path(length: int) -> np.ndarray:
    return np.array([motion(0.2 * t, 0.1 * t) for t in range(length)])


def watched(poses: np.ndarray) -> PoseWatch:
    watch = PoseWatch(CONFIG)
    assert not watch.moved(poses)  # nothing was known of them
    return watch


@pytest.mark.parametrize(
    ("x", "angle", "moved"), [(0.009, 0.0, False), (0.011, 0.0, True), (0, 0.004, False), (0, 0.006, True)]
)
def test_one_keyframe_beyond_the_tolerance_is_a_correction(x, angle, moved):
    watch, poses = watched(path(5)), path(5)
    poses[3] = poses[3] @ motion(x, angle)
    assert watch.moved(poses) is moved


def test_creeping_adds_up_until_it_is_a_correction():
    watch, poses = watched(path(5)), path(5)
    for step in range(1, 6):
        poses[:, 1, 3] += 0.003
        assert watch.moved(poses) is (step > 3)
    watch.remember(poses)
    assert not watch.moved(poses)


def test_new_keyframes_are_no_correction_but_may_be_corrected_later():
    watch = watched(path(3))
    assert not watch.moved(path(6)) and len(watch) == 6
    poses = path(6)
    poses[5, 2, 3] = 0.5
    assert watch.moved(poses)


def test_corrections_take_what_was_seen_to_where_it_belongs():
    watch, now = watched(path(4)), np.array([motion(0.3, 0.17) @ T for T in path(4)])
    watch.moved(now)
    np.testing.assert_allclose(watch.corrections(now), np.tile(motion(0.3, 0.17), (4, 1, 1)), atol=1e-12)
    watch.remember(now)
    np.testing.assert_allclose(watch.corrections(now), np.tile(np.eye(4), (4, 1, 1)), atol=1e-12)


class Graph:
    """Poses, as from a smoother."""

    def __init__(self, poses: np.ndarray) -> None:
        self.now = poses

        self.closed: dict[int, Loop] = {}

    def poses(self) -> np.ndarray:
        return self.now

    def loops(self) -> dict[int, Loop]:
        return self.closed


class Registrar:
    """Counts calls; finds something to unite this many times."""

    def __init__(self, unions: int = 0) -> None:
        self.unions, self.brought, self.reunited = unions, 0, 0
        self.separated, self.mixed = 0, False

    def bring_up_to_date(self) -> None:
        self.brought += 1

    def separate(self) -> bool:
        self.separated += 1
        return self.mixed

    def reunite(self) -> bool:
        self.reunited += 1
        return self.reunited <= self.unions


def make(unions: int = 0) -> tuple[Followers, Graph, Scene, Registrar]:
    graph, scene, registrar = Graph(path(6)), Scene(), Registrar(unions)
    followers = Followers(scene, graph, registrar, TrackConfig(), CONFIG)  # type: ignore[arg-type]
    assert not followers.follow() and not registrar.brought
    return followers, graph, scene, registrar


def retired(supporting: set[int]) -> Landmark:
    belief = Belief(2, generic_evidence_model())
    landmark = Landmark(1, belief, np.array([1.0, 2.0, 3.0]), np.zeros(3), 0.0, 0.0, np.diag([1.0, 4.0, 9.0]))
    landmark.supporting = supporting
    return landmark


def test_what_is_retired_moves_with_the_keyframes_that_saw_it():
    followers, graph, scene, _ = make()
    moved, stays = scene.retired[1], scene.retired[2] = retired({3, 4, 5}), retired({0, 1})
    moved.belief.look(np.array([2.0, 0.0, 0.0]), hits=1.0, keyframe=4)
    T = motion(0.3, np.radians(10.0))
    graph.now = np.concatenate([path(6)[:3], T @ path(6)[3:]])
    assert followers.follow() and not followers.follow()
    np.testing.assert_allclose(moved.position, T[:3, :3] @ [1.0, 2.0, 3.0] + T[:3, 3])
    np.testing.assert_allclose(moved.covariance, T[:3, :3] @ np.diag([1.0, 4.0, 9.0]) @ T[:3, :3].T)
    np.testing.assert_allclose(stays.position, [1.0, 2.0, 3.0])
    # the look from keyframe 4 is one from where that is now
    assert moved.belief.weight(graph.now[4, :3, 3] - moved.position) < 0.2


def test_a_thing_seen_from_poses_that_moved_differently_moves_by_their_mean():
    followers, graph, scene, _ = make()
    scene.retired[1] = retired({0, 5})
    graph.now = path(6)
    graph.now[5, :3, 3] += [0.0, 0.2, 0.0]
    assert followers.follow()
    np.testing.assert_allclose(scene.retired[1].position, [1.0, 2.1, 3.0])


@pytest.mark.parametrize("unions", [0, 1, 3, 100])
def test_everything_is_brought_along_again_after_each_reunion(unions):
    followers, graph, _, registrar = make(unions)
    graph.now = motion(1.0) @ path(6)
    assert followers.follow()
    assert registrar.reunited == min(unions + 1, REUNIONS)
    assert registrar.brought == min(unions, REUNIONS) + 1


@pytest.mark.parametrize(
    ("gap", "shift", "mixed", "separated", "followed"),
    [
        (0.0, 0.0, True, 0, False),  # obeyed, and nothing moved
        (0.3, 0.0, True, 1, True),  # landmarks hold the poses against it
        (0.3, 0.0, False, 1, False),  # something else does
        (0.0, 1.0, False, 1, True),
    ],
)
def test_landmarks_are_separated_where_a_new_loop_moves_poses_or_is_not_obeyed(gap, shift, mixed, separated, followed):
    followers, graph, _, registrar = make()
    graph.now, registrar.mixed = motion(shift) @ path(6), mixed
    T_0_5 = np.linalg.inv(path(6)[0]) @ path(6)[5] @ motion(gap)
    graph.closed = {7: Loop(0, 5, T_0_5, 1e-4 * np.eye(6))}
    assert followers.follow() is followed and registrar.separated == separated
    assert not followers.follow() and registrar.separated == separated  # once for each loop


def test_without_a_loop_nothing_is_separated():
    followers, graph, _, registrar = make()
    graph.now = motion(1.0) @ path(6)
    assert followers.follow() and not registrar.separated

"""The switches that turn one kind of evidence off, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.mapper.config import MapperConfig
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.smoother import Smoother

DEFAULT = MapperConfig()
CUP = (0.6, 0.1, 0.02)


def staged(tools, config: MapperConfig, half_axes: tuple[float, float, float] = (0.1, 0.1, 0.1)):
    """A cup that became landmark 1 in three keyframes."""
    stage = tools.Stage(config)
    for x in (-0.8, -0.6, -0.4):
        stage.show(x, tools.Thing((0.0, 0.0, 0.0), half_axes, CUP))
    return stage


def test_without_occlusion_a_hidden_object_is_missed(tools):
    wall, unseen = tools.Thing((0.0, -0.8, 0.0), (0.5, 0.05, 0.5)), tools.Thing((0.0, 0.0, 0.0))
    aware = staged(tools, DEFAULT)
    blind = staged(tools, replace(DEFAULT, evidence=replace(DEFAULT.evidence, occlusion=False)))
    for stage in (aware, blind):
        stage.show(0.0, unseen, wall)
    assert aware.outcomes[Outcome.FULLY_OCCLUDED] == 1 and aware.scene.landmarks[1].belief.misses == 0.0
    assert blind.outcomes[Outcome.MISSED] == 1 and blind.scene.landmarks[1].belief.misses > 0.8


def test_without_occlusion_depth_says_nothing_of_existence(tools):
    stage = staged(tools, replace(DEFAULT, evidence=replace(DEFAULT.evidence, occlusion=False)))
    for x in (-0.2, 0.0, 0.2, 0.4):
        stage.show(x)  # it is gone
    assert stage.scene.landmarks[1].belief.free == 0.0
    assert stage.outcomes[Outcome.SEEN_THROUGH] == 0 and stage.outcomes[Outcome.MISSED] == 4


def test_without_misses_what_is_not_found_says_nothing(tools):
    stage = staged(tools, replace(DEFAULT, evidence=replace(DEFAULT.evidence, misses=False)))
    before = stage.scene.landmarks[1].belief.existence
    for x in (-0.2, 0.0, 0.2):
        stage.show(x, tools.Thing((0.0, 0.0, 0.0)))  # there, and never detected
    landmark = stage.scene.landmarks[1]
    assert landmark.belief.misses == 0.0 and landmark.belief.existence > before - 0.02
    still_there, free = landmark.belief.existence, landmark.belief.free
    for x in (0.4, 0.6, 0.8):
        stage.show(x)  # gone: depth still speaks
    assert landmark.belief.free < free - 2.0 and landmark.belief.existence < still_there - 0.02


def test_without_coupling_sizes_and_classes_are_strangers(tools):
    """A monitor of the size of a cup, and a cup of its own size: the scores are the same."""
    posterior, spread = {}, {}
    for coupled in (True, False):
        config = replace(DEFAULT, beliefs=replace(DEFAULT.beliefs, size_coupling=coupled))
        for size in (0.05, 0.25):
            landmark = staged(tools, config, (size, size, size)).scene.landmarks[1]
            posterior[coupled, size] = landmark.belief.class_posterior()
            spread[coupled, size] = np.trace(landmark.log_size_covariance)
    assert posterior[True, 0.05][0] > posterior[True, 0.25][0] + 0.05
    np.testing.assert_allclose(posterior[False, 0.05], posterior[False, 0.25], atol=0.01)
    assert spread[False, 0.05] > spread[True, 0.05]


def see_askew(tools, joint: bool):
    """Two cameras, of which the second one's odometry is 3 cm off, and four objects that would put it right."""
    room = tools.Room(replace(tools.exact, joint=joint))
    room.add_camera(tools.look_at((2.0, 0.0, 0.3)))
    room.add_camera(tools.look_at((1.5, 1.3, 0.3)), np.array([0.0, 0.0, 0.0, 0.03, 0.0, 0.0]))
    places = ((0.0, 0.0, 0.0), (0.3, 0.2, 0.1), (-0.2, 0.3, -0.1), (0.1, -0.3, 0.2))
    for number, place in enumerate(places, 1):
        room.add_object(number, place, (0.1, 0.15, 0.2))
        for keyframe in range(2):
            room.see(keyframe, number)
    room.smoother.update()
    return room


def test_without_the_joint_graph_objects_do_not_move_cameras(tools):
    error = {}
    for joint in (True, False):
        room = see_askew(tools, joint)
        error[joint] = np.linalg.norm(room.smoother.pose(1)[:3, 3] - room.cameras[1][:3, 3])
    assert error[True] < 0.026  # four objects measured to 5 cm against odometry of 1 cm
    assert error[False] == pytest.approx(0.03, abs=1e-3)


def test_without_the_joint_graph_objects_are_still_found_and_survive_a_rebuild(tools):
    room = see_askew(tools, joint=False)
    before = {j: room.smoother.position(j) for j in room.objects}
    for j, (place, _) in room.objects.items():
        assert np.linalg.norm(before[j] - place) < 0.04
    room.smoother._rebuild()
    for j in room.objects:
        np.testing.assert_allclose(room.smoother.position(j), before[j], atol=0.01)  # a rebuild goes on to convergence


def test_without_the_joint_graph_a_ledger_still_makes_the_graph_again(tools):
    room = tools.Room(replace(tools.exact, joint=False))
    for keyframe, place in enumerate([(2.0, 0.0, 0.3), (1.8, 0.7, 0.3), (1.5, 1.3, 0.3)]):
        room.add_camera(tools.look_at(place))
        if keyframe == 0:
            room.add_object(1, (0.0, 0.0, 0.0), (0.1, 0.15, 0.2))
        room.see(keyframe, 1)
    room.smoother.update()
    again = Smoother.from_ledger(room.smoother.ledger, replace(tools.exact, joint=False), tools.kinect)
    np.testing.assert_allclose(again.position(1), room.smoother.position(1), atol=0.01)
    np.testing.assert_allclose(again.poses(), room.smoother.poses(), atol=1e-6)
    for t, T in enumerate(room.smoother.poses()):  # beside the fixed copies, which are poses as well
        np.testing.assert_allclose(T, room.smoother.pose(t), atol=1e-12)

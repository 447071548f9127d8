"""Frames registered to a model of voxels: the pose, how much fits, walls, and what the model takes in and forgets."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from thingmap.mapper.config import GicpConfig
from thingmap.mapper.trajectory.depth_points import DepthPoints
from thingmap.mapper.trajectory.odometry.gaussian_model import GaussianModel

CONFIG = GicpConfig()
WALL = [((0.0, 0.0, 1.0), 1.5)]
CORNER = [((0.0, 0.0, 1.0), 1.8), ((1.0, 0.0, 0.0), 0.8), ((0.0, 1.0, 0.0), 0.7)]
MOVED = gtsam.Pose3.Expmap(np.array([0.01, 0.03, 0.0, 0.04, -0.02, 0.03])).matrix()


def points(frame) -> np.ndarray:
    return DepthPoints(1, 0.3, 3.5)(frame)


def model_of(frame, config: GicpConfig = CONFIG) -> GaussianModel:
    model = GaussianModel(config)
    assert model.empty and model.take_in(model.prepare(points(frame)), np.eye(4)) and not model.empty
    return model


def test_a_frame_finds_its_place_in_the_model(plane_frame):
    model = model_of(plane_frame(CORNER))
    fit = model.align(model.prepare(points(plane_frame(CORNER, MOVED, 1))), np.eye(4))
    gap = gtsam.Pose3.Logmap(gtsam.Pose3(fit.T).between(gtsam.Pose3(MOVED)))
    assert np.linalg.norm(gap[:3]) < 0.004 and np.linalg.norm(gap[3:]) < 0.01
    assert fit.share > 0.9
    np.testing.assert_allclose(fit.T[:3, :3] @ fit.T[:3, :3].T, np.eye(3), atol=1e-12)


def test_what_is_not_in_the_model_has_no_share_in_it(plane_frame):
    model = model_of(plane_frame(CORNER))
    away = gtsam.Pose3(gtsam.Rot3.Ry(np.pi), np.zeros(3)).matrix()
    assert model.align(model.prepare(points(plane_frame(CORNER))), away).share < 0.1


def test_a_wall_s_translation_is_open_and_a_corner_s_is_not(plane_frame):
    ratios = {}
    for name, planes in (("wall", WALL), ("corner", CORNER)):
        model = model_of(plane_frame(planes))
        ratios[name] = model.align(model.prepare(points(plane_frame(planes, index=1))), np.eye(4)).translation_ratio
    assert ratios["wall"] < CONFIG.degenerate_ratio < ratios["corner"] <= 1.0


def test_the_model_grows_only_where_the_camera_has_moved(plane_frame):
    frame = plane_frame(CORNER)
    model = model_of(frame)
    cloud = model.prepare(points(frame))
    turn, move = CONFIG.step
    for twist, grows in (
        ([0.0, 0.9 * turn, 0.0, 0.0, 0.0, 0.9 * move], False),
        ([0.0, 1.1 * turn, 0.0, 0.0, 0.0, 0.0], True),
        ([0.0, 1.1 * turn, 0.0, 0.0, 0.0, 0.5 * move], False),  # from the last one taken in, not the first
        ([0.0, 1.1 * turn, 0.0, 0.0, 0.0, 1.1 * move], True),
    ):
        T = gtsam.Pose3(gtsam.Rot3.Expmap(np.array(twist[:3])), np.array(twist[3:])).matrix()
        assert model.take_in(cloud, T) is grows


def test_clearing_forgets_everything(plane_frame):
    model = model_of(plane_frame(CORNER))
    model.clear()
    assert model.empty
    cloud = model.prepare(points(plane_frame(CORNER)))
    assert model.take_in(cloud, np.eye(4))  # from the place of the last one, which is forgotten too


def test_what_was_not_seen_for_long_is_forgotten(plane_frame):
    config = replace(CONFIG, horizon=10, step=(-1.0, -1.0))
    frame = plane_frame(CORNER)
    for horizon, forgotten in ((10, True), (1000, False)):
        model = model_of(frame, replace(config, horizon=horizon))
        cloud = model.prepare(points(frame))
        away = gtsam.Pose3(gtsam.Rot3(), np.array([0.0, 0.0, 20.0])).matrix()
        for _ in range(40):
            model.take_in(cloud, away)
        share = model.align(cloud, np.eye(4)).share
        assert share == pytest.approx(0.0 if forgotten else 1.0, abs=0.05)


def test_two_runs_agree_to_the_last_bit(plane_frame):
    fits = []
    for _ in range(2):
        model = model_of(plane_frame(CORNER))
        fits.append(model.align(model.prepare(points(plane_frame(CORNER, MOVED, 1))), np.eye(4)))
    np.testing.assert_array_equal(fits[0].T, fits[1].T)
    assert (fits[0].share, fits[0].translation_ratio) == (fits[1].share, fits[1].translation_ratio)

"""What of the scene's members a keyframe should show."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.factors.visibility import VolumePart
from thingmap.mapper.estimation.scene import Scene

CUP = (0.6, 0.1, 0.02)


@pytest.fixture
def stage(tools):
    """A cup at the origin, a landmark by now, and a candidate half a metre to its right."""
    stage = tools.Stage()
    cup, bowl = tools.Thing((0.0, 0.0, 0.0), scores=CUP), tools.Thing((0.5, 0.0, 0.0), scores=CUP)
    for x in (-0.4, -0.2, 0.0):
        stage.show(x, cup)
    stage.show(0.0, cup, bowl)
    return stage


def predict(stage, tools, x: float, *things, **kwargs):
    return stage.scene.predict(stage.view(x, *things, **kwargs), stage.config.association)


def test_an_empty_scene_shows_nothing(tools):
    stage = tools.Stage()
    targets, visibility = predict(stage, tools, 0.0)
    assert len(targets) == 0 and targets.side_px.shape == (0,)
    assert targets.positions.shape == (0, 3) and targets.covariances.shape == (0, 3, 3)
    assert visibility.free.shape == (0, 5)
    assert Scene().members() == []


def test_landmarks_come_first_then_candidates(stage, tools):
    landmark, track = stage.scene.members()
    assert landmark is stage.scene.landmarks[1] and track is stage.scene.tracks[0]
    targets, visibility = predict(stage, tools, 0.0, tools.Thing((0.0, 0.0, 0.0)), tools.Thing((0.5, 0.0, 0.0)))
    np.testing.assert_array_equal(targets.positions, [landmark.position, track.position])
    np.testing.assert_array_equal(targets.log_sizes, [landmark.log_size, track.log_size])
    assert len(targets) == 2 and len(visibility.occluded) == 2


def test_both_are_seen_where_they_are(stage, tools):
    cup, bowl = tools.Thing((0.0, 0.0, 0.0)), tools.Thing((0.5, 0.0, 0.0))
    targets, visibility = predict(stage, tools, 0.1, cup, bowl)
    np.testing.assert_allclose(targets.visible, 1.0, atol=0.05)
    assert (visibility.agreeing[:, VolumePart.WHOLE] > 0.8).all()
    centre = (targets.xyxy[:, :2] + targets.xyxy[:, 2:]) / 2.0
    expected = tools.kinect.fx * np.array([-0.1, 0.4]) / 2.0 + tools.kinect.cx
    np.testing.assert_allclose(centre[:, 0], expected, atol=6.0)


def test_positions_are_held_for_less_sure_than_they_are(stage, tools):
    """The landmark's own covariance and the pose error between views."""
    targets, _ = predict(stage, tools, 0.0)
    floor = stage.config.association.position_floor**2 * np.eye(3)
    np.testing.assert_allclose(targets.covariances[0], stage.scene.landmarks[1].covariance + floor)


def test_what_stands_before_it_hides_it(stage, tools):
    targets, visibility = predict(stage, tools, 0.0, tools.Thing((0.0, -0.8, 0.0), (0.15, 0.05, 0.15)))
    assert targets.visible[0] < 0.05 and targets.visible[1] > 0.9
    assert visibility.occluded[0, VolumePart.WHOLE] > 0.95


def test_what_is_gone_is_seen_through(stage, tools):
    targets, visibility = predict(stage, tools, 0.0)
    assert (visibility.free[:, VolumePart.WHOLE] > 0.9).all()
    np.testing.assert_allclose(targets.visible, 1.0, atol=0.05)


def test_what_is_out_of_the_image_is_out_of_view(stage, tools):
    targets, visibility = predict(stage, tools, 2.5)
    assert targets.visible[0] == 0.0 and visibility.in_image[0, VolumePart.WHOLE] == 0.0
    assert targets.side_px[0] == 0.0


def test_boxes_are_clipped_to_the_image(stage, tools):
    targets, visibility = predict(stage, tools, 1.2)
    assert targets.xyxy[0, 0] == -0.5 < targets.xyxy[0, 2]
    assert 0.2 < visibility.in_image[0, VolumePart.WHOLE] < 0.8
    assert targets.visible[0] == pytest.approx(visibility.in_image[0, VolumePart.WHOLE], abs=0.05)


def test_what_is_behind_the_camera_is_not_there(stage, tools):
    targets, _ = predict(stage, tools, 0.0, pull=-1.0)
    assert np.isnan(targets.xyxy).all() and (targets.visible == 0.0).all()
    assert (targets.side_px == 0.0).all()

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.mapper.map.boxes import EDGES, inside_box
from thingmap.mapper.map.upright import upright_rotation

components = st.floats(-1.0, 1.0, allow_subnormal=False)
directions = st.tuples(components, components, components).filter(lambda v: np.linalg.norm(v) > 1e-3).map(np.array)


@given(directions)
def test_upright_rotation_is_a_rotation_whose_z_is_up(up):
    R = upright_rotation(up)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, 2], up / np.linalg.norm(up), atol=1e-12)


def test_a_gravity_aligned_map_has_the_identity():
    np.testing.assert_array_equal(upright_rotation(np.array([0.0, 0.0, 1.0])), np.eye(3))


def test_first_camera_has_x_to_the_right_and_y_forward():
    R = upright_rotation(np.array([0.0, -1.0, 0.0]))
    np.testing.assert_allclose(R, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)


def test_x_nearly_vertical_falls_back_to_y():
    R = upright_rotation(np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(R[:, 0], [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize("up", [[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [0.0, 1.0]])
def test_no_direction_is_refused(up):
    with pytest.raises(ValueError, match="up must be"):
        upright_rotation(np.array(up))


def test_corners_of_a_turned_box(make_thing):
    thing = make_thing(position=[1.0, 2.0, 3.0], size=[0.4, 0.2, 0.6], yaw=np.pi / 2)
    corners = thing.corners(np.eye(3))
    np.testing.assert_allclose(corners.min(axis=0), [0.9, 1.8, 2.7])  # x and y have changed places
    np.testing.assert_allclose(corners.max(axis=0), [1.1, 2.2, 3.3])
    np.testing.assert_allclose(corners[0], [1.1, 1.8, 2.7])  # local (-, -, -)


@given(directions, st.floats(-np.pi, np.pi), st.tuples(*[st.floats(0.01, 2.0)] * 3))
def test_edges_have_the_box_sizes_and_height_is_along_up(make_thing, up, yaw, size):
    R = upright_rotation(up)
    corners = make_thing(size=size, yaw=yaw).corners(R)
    lengths = np.linalg.norm(corners[EDGES[:, 0]] - corners[EDGES[:, 1]], axis=1)
    np.testing.assert_allclose(lengths, [size[0], size[1]] * 4 + [size[2]] * 4, rtol=1e-9)
    np.testing.assert_allclose((corners[4:] - corners[:4]) @ R[:, 2], size[2], rtol=1e-9)


def test_inside_box_agrees_with_the_corners(make_thing):
    thing = make_thing(size=[0.4, 0.2, 0.6], yaw=0.7)
    R = upright_rotation(np.array([0.2, -1.0, 0.1]))
    corners = thing.corners(R)
    shrunk, grown = (thing.position + factor * (corners - thing.position) for factor in (0.999, 1.001))
    assert inside_box(shrunk, thing.position, thing.size, thing.yaw, R).all()
    assert not inside_box(grown, thing.position, thing.size, thing.yaw, R).any()

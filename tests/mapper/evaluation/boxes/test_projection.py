"""Things drawn as cylinders: against points sampled on their surface, and against solids of the same extents."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.evaluation.boxes.matching import box_ious
from thingmap.mapper.evaluation.boxes.projection import project_cylinders, projected_boxes
from thingmap.mapper.evaluation.inputs.case import PlacedThing
from thingmap.mapper.map.boxes import box_axes, box_corners

UP = np.array([0.0, 0.0, 1.0])
CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)


def looking_at(target: np.ndarray, azimuth: float, elevation: float, distance: float) -> np.ndarray:
    """`T_world_camera` of a camera that sees the target in the middle; z is up."""
    back = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    T = np.eye(4)
    T[:3, :3] = np.column_stack([right, np.cross(-back, right), -back])
    T[:3, 3] = target + distance * back
    return T


def bounds(points: np.ndarray, T: np.ndarray) -> np.ndarray:
    uv = CAMERA.project((points - T[:3, 3]) @ T[:3, :3])
    return np.concatenate([uv.min(axis=0), uv.max(axis=0)])


def unit_circle(count: int = 3600) -> np.ndarray:
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)


def unit_sphere() -> np.ndarray:
    height = np.linspace(-1.0, 1.0, 201)[:, None, None]
    points = unit_circle(360)[None] * np.sqrt(1.0 - height**2)
    points[..., 2] = height[..., 0]
    return points.reshape(-1, 3)


def test_a_cylinder_is_bounded_by_its_rims(make_thing):
    rng = np.random.default_rng(1)
    for _ in range(20):
        things = [
            make_thing(k, position=rng.normal(0.0, 0.1, 3), size=rng.uniform(0.03, 0.3, 3), yaw=rng.uniform(-3.0, 3.0))
            for k in range(3)
        ]
        T = looking_at(np.zeros(3), rng.uniform(0.0, 6.0), rng.uniform(0.0, 1.5), 1.2)
        boxes = project_cylinders(things, T, np.eye(3), CAMERA)
        for thing, box in zip(things, boxes, strict=True):
            rims = np.concatenate([unit_circle() + UP, unit_circle() - UP])
            world = (rims * thing.size / 2.0) @ box_axes(thing.yaw, np.eye(3)).T + thing.position
            np.testing.assert_allclose(box, bounds(world, T), atol=0.01)


def test_right_sized_things_are_found_whatever_their_shape(make_thing):
    """The reason for cylinders: ball and brick of the thing's extents both reach an IoU of one half, from anywhere."""
    worst = 1.0
    for size, yaw, elevation in product(
        [(0.1, 0.1, 0.1), (0.06, 0.2, 0.3), (0.16, 0.16, 0.06)], [0.0, 0.4, 0.785], [0.0, 0.3, 0.785, 1.2]
    ):
        thing = make_thing(1, position=np.zeros(3), size=size, yaw=yaw)
        T = looking_at(np.zeros(3), 0.0, elevation, 1.5)
        cylinder = project_cylinders([thing], T, np.eye(3), CAMERA)
        brick = bounds(box_corners(thing.position, thing.size, yaw, np.eye(3)), T)
        ball = bounds((unit_sphere() * thing.size / 2.0) @ box_axes(yaw, np.eye(3)).T, T)
        worst = min(worst, float(box_ious(cylinder, np.stack([brick, ball])).min()))
    assert 0.5 <= worst < 0.6  # it is near the bound: the test does look at the hard cases


def test_a_thing_at_or_behind_the_camera_is_in_no_image(make_thing):
    T = looking_at(np.zeros(3), 0.0, 0.5, 1.0)
    behind = T[:3, 3] - 0.5 * T[:3, 2]
    things = [make_thing(1, position=np.zeros(3)), make_thing(2, position=behind), make_thing(3, position=T[:3, 3])]
    boxes = project_cylinders(things, T, np.eye(3), CAMERA)
    assert np.isfinite(boxes[0]).all()
    assert np.isnan(boxes[1:]).all()
    assert project_cylinders([], T, np.eye(3), CAMERA).shape == (0, 4)


def test_a_thing_without_extent_is_a_point(make_thing):
    T = looking_at(np.zeros(3), 0.0, 0.5, 1.0)
    box = project_cylinders([make_thing(1, position=np.zeros(3), size=np.zeros(3))], T, np.eye(3), CAMERA)[0]
    np.testing.assert_allclose(box, [319.5, 239.5, 319.5, 239.5], atol=0.01)


def test_claims_are_clipped_and_know_how_much_of_them_is_inside(make_thing, make_map):
    T = np.eye(4)  # at the origin, looking along z; up is -y
    middle = make_thing(1, position=[0.0, 0.0, 1.0], size=[0.1, 0.1, 0.1], yaw=0.0)
    half_out = make_thing(2, position=[-319.5 / 525.0 - 0.5 / 525.0, 0.0, 1.0], size=[0.1, 0.1, 0.1], yaw=0.0)
    outside = make_thing(3, position=[-1.5, 0.0, 1.0], size=[0.1, 0.1, 0.1])
    placed = [PlacedThing(thing, "cup", thing.position, 0.0) for thing in (outside, half_out, middle)]
    found = projected_boxes(placed, make_map(middle), T, ("bowl", "cup"), CAMERA)
    assert found.source.tolist() == [1, 2]
    assert found.class_id.tolist() == [1, 1]
    assert found.xyxy[0, 0] == -0.5
    assert found.inside == pytest.approx([0.5, 1.0], abs=0.02)  # perspective enlarges the outer half
    assert found.score == pytest.approx([0.95 * 0.9, 0.95 * 0.9])

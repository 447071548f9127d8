"""The labelled cloud of hand-made scenes whose surfaces are known."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.mesh import box, face
from thingmap.datasets.synthetic.motion.orbit import look_at
from thingmap.datasets.synthetic.rendering import labelled_cloud as module
from thingmap.datasets.synthetic.rendering.labelled_cloud import VOXEL, labelled_cloud
from thingmap.datasets.synthetic.rendering.render import Renderer
from thingmap.datasets.synthetic.rendering.surfaces import assemble
from thingmap.datasets.synthetic.things.objects import Part
from thingmap.datasets.truth import NO_OBJECT, PointTruth, TrueObject

CAMERA = Intrinsics(320, 240, 262.5, 262.5, 159.5, 119.5)
GREY = np.full((4, 4, 3), 180, np.uint8)
ANGLES = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
EYES = np.stack([0.9 * np.cos(ANGLES), 0.9 * np.sin(ANGLES), np.full(24, 0.8)], axis=1)
ORBIT = look_at(EYES, np.tile([0.0, 0.0, 0.1], (24, 1)), np.zeros(24))
EVERYWHERE = (0.0, np.inf)

# A floor, a cup-sized box, a larger one, and clutter; walls lie off the borders of voxels
FLOOR = face((2.0, 2.0, 0.0), "+z").moved((0.0, 0.0, 0.005))
PARTS = [
    (Part(FLOOR, GREY), -1),
    (Part(box((0.11, 0.11, 0.10)).moved((0.05, -0.2, 0.005)), GREY), 3),
    (Part(box((0.21, 0.07, 0.20)).moved((-0.2, 0.1, 0.005)), GREY), 7),
    (Part(box((0.09, 0.09, 0.30)).moved((0.2, 0.2, 0.005)), GREY), 8),
]
OBJECTS = (
    TrueObject(3, "cup", np.array([0.05, -0.2, 0.055]), np.array([0.11, 0.11, 0.10]), 0.0),
    TrueObject(7, "box", np.array([-0.2, 0.1, 0.105]), np.array([0.21, 0.07, 0.20]), 0.0),
)
CLUTTER = TrueObject(8, "book", np.array([0.2, 0.2, 0.155]), np.array([0.09, 0.09, 0.30]), 0.0)
CLASSES = ("can", "box", "cup")


def fused(poses: np.ndarray = ORBIT, reach: tuple[float, float] = EVERYWHERE) -> PointTruth:
    surfaces = assemble(PARTS)
    return labelled_cloud(Renderer(surfaces), surfaces, CAMERA, poses, OBJECTS, CLASSES, reach)


@pytest.fixture(scope="module")
def cloud() -> PointTruth:
    return fused()


def to_faces(points: np.ndarray, thing: TrueObject) -> np.ndarray:
    """(N,) metres from the surface of an upright box, yaw 0."""
    beyond = np.abs(points - thing.position) - thing.size / 2
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside - np.minimum(beyond.max(axis=1), 0.0)


def test_points_carry_the_thing_on_whose_surface_they_lie(cloud):
    assert cloud.points.dtype == np.float32 and cloud.points.shape == (len(cloud.class_id), 3)
    for thing in OBJECTS:
        own = cloud.object_id == thing.id
        assert (cloud.class_id[own] == CLASSES.index(thing.label)).all()
        # a point is the mean of a voxel, which may reach round an edge
        distance = to_faces(cloud.points[own], thing)
        assert np.median(distance) < 1e-4 and distance.max() < VOXEL
    assert set(np.unique(cloud.object_id)) == {NO_OBJECT, 3, 7}
    np.testing.assert_array_equal(cloud.class_id == NO_OBJECT, cloud.object_id == NO_OBJECT)


def test_clutter_and_room_belong_to_no_object(cloud):
    book = to_faces(cloud.points, CLUTTER) < 1e-4
    inside = np.all(np.abs(cloud.points[:, :2] - CLUTTER.position[:2]) < 0.05, axis=1) & (cloud.points[:, 2] > 0.05)
    assert (book & inside).sum() > 500
    assert (cloud.object_id[book & inside] == NO_OBJECT).all()
    floor = (cloud.points[:, 2] < 0.0051) & (np.abs(cloud.points[:, :2]).max(axis=1) > 0.4)
    assert floor.sum() > 5000 and (cloud.object_id[floor] == NO_OBJECT).all()


def test_a_voxel_has_one_point_and_surfaces_have_no_holes(cloud):
    # float32 may round a point onto the border of its voxel
    middle = np.floor(np.where(np.abs(cloud.points / VOXEL % 1.0) < 1e-3, cloud.points + 1e-5, cloud.points) / VOXEL)
    assert len(np.unique(middle, axis=0)) > 0.999 * len(middle)
    for thing in OBJECTS:
        x, y, z = thing.size
        area = x * y + 2 * z * (x + y)  # all but the bottom
        count = (cloud.object_id == thing.id).sum()
        assert area / VOXEL**2 == pytest.approx(count, rel=0.25)
    # every true surface point of the large box has a point near it
    rng = np.random.default_rng(0)
    side = OBJECTS[1].position + OBJECTS[1].size / 2 * np.stack(
        [rng.uniform(-1, 1, 300), np.ones(300), rng.uniform(-0.9, 1, 300)], axis=1
    )
    own = cloud.points[cloud.object_id == 7]
    assert np.linalg.norm(side[:, None] - own, axis=2).min(axis=1).max() < 1.5 * VOXEL


def test_only_what_comes_within_reach_is_there():
    near = fused(ORBIT[:1], (0.3, 1.0))
    depth = (near.points - EYES[0]) @ ORBIT[0][:3, 2]
    assert depth.min() > 0.3 and depth.max() < 1.0 + VOXEL
    assert len(fused(ORBIT[:1], (50.0, 60.0)).points) == 0


def test_merging_early_and_late_is_the_same(monkeypatch: pytest.MonkeyPatch, cloud):
    monkeypatch.setattr(module, "PENDING", 3000)
    often = fused()
    np.testing.assert_array_equal(often.object_id, cloud.object_id)
    np.testing.assert_allclose(often.points, cloud.points, atol=1e-6)


def test_a_long_sequence_is_thinned_out(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "VIEWS", 5)
    every_fifth = fused()
    monkeypatch.setattr(module, "VIEWS", 200)
    np.testing.assert_array_equal(every_fifth.points, fused(ORBIT[::5]).points)


def test_a_voxel_goes_to_the_thing_with_most_points(monkeypatch: pytest.MonkeyPatch):
    """Two tiles share the voxels under their border; the wider share wins."""
    tiles = [
        (Part(face((0.107, 0.2, 0.0), "+z").moved((-0.0535, 0.0, 0.0)), GREY), 0),  # x from -0.107 to 0
        (Part(face((0.107, 0.2, 0.0), "+z").moved((0.0535, 0.0, 0.0)), GREY), 1),
    ]
    shifted = [(Part(part.mesh.moved((0.003, 0.0, 0.005)), GREY), owner) for part, owner in tiles]  # border at x = 3 mm
    objects = tuple(TrueObject(k, "cup", np.zeros(3), np.ones(3), 0.0) for k in range(2))
    above = look_at(np.array([[0.0, 0.01, 0.6]]), np.zeros((1, 3)), np.zeros(1))
    surfaces = assemble(shifted)
    cloud = labelled_cloud(Renderer(surfaces), surfaces, CAMERA, above, objects, CLASSES, EVERYWHERE)
    shared = (cloud.points[:, 0] > 0.0) & (cloud.points[:, 0] < VOXEL)
    assert shared.sum() >= 19 and (cloud.object_id[shared] == 1).all()
    assert (cloud.object_id[cloud.points[:, 0] < 0.0] == 0).all()

"""Filmed scenes: a hand-made one whose pictures can be computed, and those of the presets, rendered small."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.synthetic.config import Preset, SyntheticConfig
from thingmap.datasets.synthetic.mesh import box, face
from thingmap.datasets.synthetic.motion.orbit import look_at
from thingmap.datasets.synthetic.rendering.camera import ColorCamera
from thingmap.datasets.synthetic.rendering.render import Lights
from thingmap.datasets.synthetic.rendering.sensor import IDEAL
from thingmap.datasets.synthetic.rendering.surfaces import assemble
from thingmap.datasets.synthetic.scene import Scene
from thingmap.datasets.synthetic.sequence import RenderedSequence, SyntheticSequence
from thingmap.datasets.synthetic.things.objects import Part
from thingmap.datasets.truth import NO_OBJECT, HasClutter, HasInstances, HasPointTruth, HasTruth, TrueObject

SMALL = SyntheticConfig(width=160, frames=30, objects=6)
GREY = np.full((4, 4, 3), 180, np.uint8)
BLACK = np.zeros((4, 4, 3), np.uint8)
CLEAN = ColorCamera(gain=1.0, blur=0.0, noise=0.0, chroma_noise=0.0, drift=0.0, white_drift=0.0)
AMBIENT = Lights(sky=(1.0, 1.0, 1.0), powers=((0, 0, 0),) * 2)


def sideways(blur: int, shutter: float = 0.02, speed: float = 1.0) -> RenderedSequence:
    """A black wall 1 m away with a grey patch 40 pixels wide on it; the camera moves right, 1 m/s is 131 pixels/s."""
    patch = box((40 / 131.25, 0.002, 0.6)).moved((0.02, 1.0, -0.3))
    parts = [(Part(face((6.0, 0.0, 6.0), "-y").moved((0.0, 1.001, -3.0)), BLACK), -1), (Part(patch, GREY), 0)]
    thing = TrueObject(0, "patch", np.array([0.02, 1.0, 0.0]), np.array([40 / 131.25, 0.002, 0.6]), 0.0)
    stamps = np.arange(4) / 30.0
    eyes = np.stack([speed * stamps, np.zeros(4), np.zeros(4)], axis=1)
    return RenderedSequence(
        name="sideways",
        scene=Scene((thing,), (), ("patch",), assemble(parts), AMBIENT),
        width=160,
        stamps=stamps,
        poses=look_at(eyes, eyes + np.array([0.0, 1.0, 0.0]), np.zeros(4)),
        frames=3,
        seed=0,
        sensor=IDEAL,
        camera=replace(CLEAN, shutter=shutter),
        blur=blur,
    )


@pytest.fixture(scope="module")
def tabletop() -> SyntheticSequence:
    return SyntheticSequence(SMALL)


def light_along_the_middle(sequence: RenderedSequence, index: int) -> np.ndarray:
    """(W,) linear light in the image's middle row; ambient light on a wall is 0.725 of that on the floor."""
    return (sequence[index].color[60, :, 1] / 180.0) ** 2 / 0.725


@pytest.mark.parametrize("index", [0, 1, 2])
def test_a_moving_camera_smears_edges_over_its_way(index):
    sharp, smeared = (light_along_the_middle(sideways(blur), index) for blur in (0, 16))
    assert set(np.unique(np.round(sharp, 2))) == {0.0, 1.0}
    way = 0.02 * 131.25  # pixels during the exposure: the edge becomes a ramp as long as that
    between = (smeared > 0.03) & (smeared < 0.97)
    assert between.sum() == pytest.approx(2 * way, abs=2.0)
    centre = np.sum(smeared * np.arange(160)) / smeared.sum()
    patch = 79.5 + 131.25 * (0.02 - index / 30.0)
    assert centre == pytest.approx(patch, abs=0.15), "the exposure is centred on the frame"
    assert smeared.sum() == pytest.approx(sharp.sum(), rel=0.02), "no light is lost"


def test_depth_and_truth_have_no_motion_blur():
    sharp, smeared = sideways(0), sideways(5)
    np.testing.assert_array_equal(smeared[1].depth, sharp[1].depth)
    np.testing.assert_array_equal(smeared.truth(1).xyxy_visible, sharp.truth(1).xyxy_visible)
    np.testing.assert_array_equal(smeared.instances(1), sharp.instances(1))


def test_a_still_camera_or_a_fast_shutter_does_not_smear():
    sharp = sideways(0)[1].color
    np.testing.assert_array_equal(sideways(1)[1].color, sharp)
    np.testing.assert_array_equal(sideways(4, shutter=1e-6)[1].color, sharp)
    still, averaged = sideways(0, speed=0.0)[1].color, sideways(4, speed=0.0)[1].color
    np.testing.assert_array_equal(averaged, still)


def test_it_is_a_sequence_with_all_that_is_true(tabletop):
    for protocol in (Sequence, HasTruth, HasClutter, HasInstances, HasPointTruth):
        assert isinstance(tabletop, protocol), protocol
    assert tabletop.name == "synth:tabletop?objects=6&frames=30&width=160"
    assert len(tabletop) == 30 and tabletop.poses.shape == (30, 4, 4) and tabletop.gravity is None
    assert len(tabletop.objects) == 6 and {thing.label for thing in tabletop.objects} <= set(tabletop.classes)
    assert not {thing.label for thing in tabletop.clutter} & set(tabletop.classes)
    ids = [thing.id for thing in (*tabletop.objects, *tabletop.clutter)]
    assert ids == list(range(len(ids)))
    frame = tabletop[-1]
    assert frame.color.shape == (120, 160, 3) and frame.color.dtype == np.uint8 and 30 < frame.color.mean() < 220
    assert frame.depth.shape == (120, 160) and frame.depth.dtype == np.float32 and (frame.depth > 0).mean() > 0.4
    assert (frame.index, frame.name, frame.stamp) == (29, tabletop.names[29], tabletop.stamps[29])
    np.testing.assert_array_equal(frame.T_world_camera, tabletop.poses[29])
    with pytest.raises(IndexError, match="has 30 frames, asked for 30"):
        tabletop[30]


def test_frames_depend_on_the_configuration_and_the_index_only(tabletop):
    other = pickle.loads(pickle.dumps(tabletop))
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(other.__getitem__, (29, 3, 11, 3)))
    for frame in together:
        np.testing.assert_array_equal(frame.color, tabletop[frame.index].color)
        np.testing.assert_array_equal(frame.depth, tabletop[frame.index].depth)
    reseeded = SyntheticSequence(replace(SMALL, seed=1))[3]
    assert np.abs(reseeded.color.astype(int) - tabletop[3].color).mean() > 10


@pytest.mark.parametrize("preset", Preset)
def test_a_longer_sequence_begins_with_the_same_frames(preset):
    short, longer = (
        SyntheticSequence(
            SyntheticConfig(
                preset,
                objects=None if preset is Preset.WALL else 3,
                width=64,
                frames=frames,
                blur=2 * (preset is not Preset.SURVEY),
                pace=1.0 if preset is Preset.SURVEY else 1.7,
            )
        )
        for frames in (4, 9)
    )
    for index in (0, 3):
        np.testing.assert_allclose(longer.poses[index], short.poses[index], atol=1e-12)
        np.testing.assert_array_equal(longer[index].color, short[index].color)
        np.testing.assert_array_equal(longer[index].depth, short[index].depth)


def test_a_camera_that_stands_still_blurs_nothing():
    with pytest.raises(UserError, match="stands still, found blur 2"):
        SyntheticConfig(Preset.SURVEY, blur=2)
    with pytest.raises(UserError, match="stands still, found pace 3"):
        SyntheticConfig(Preset.SURVEY, pace=3)


def test_at_a_pace_the_same_scene_is_filmed_from_farther_on():
    usual, fast = (SyntheticSequence(replace(SMALL, pace=pace, sensor=IDEAL)) for pace in (1.0, 3.0))
    assert fast.scene is usual.scene
    np.testing.assert_array_equal(fast.stamps, usual.stamps)
    np.testing.assert_allclose(fast[5].depth, usual[15].depth, atol=1e-4)
    np.testing.assert_array_equal(fast[0].color, usual[0].color)
    assert np.abs(fast[5].depth - usual[5].depth).mean() > 0.01


def test_the_wall_is_one_plane_with_pictures_on_it():
    wall = SyntheticSequence(SyntheticConfig(Preset.WALL, width=160, frames=190))
    assert wall.objects == wall.clutter == () and (wall.instances(3) == NO_OBJECT).all()
    assert len(wall.truth(3).object_id) == 0
    for index in (0, 90, 189):
        frame = wall[index]
        uv = np.stack(np.meshgrid(np.arange(160.0), np.arange(120.0)), axis=-1).reshape(-1, 2)
        camera = wall.intrinsics.back_project(uv, wall.true_depth(index).ravel().astype(float))
        world = camera @ frame.T_world_camera[:3, :3].T + frame.T_world_camera[:3, 3]
        np.testing.assert_allclose(world[..., 1], 1.2, atol=1e-5)
        assert (frame.depth > 0).mean() > 0.95 and 1.0 < np.median(frame.depth) < 1.4
        assert 60 < frame.color.mean() < 210 and np.mean(frame.color >= 250) < 0.1
    cloud = wall.point_truth()
    assert (cloud.object_id == NO_OBJECT).all() and np.ptp(cloud.points[:, 1]) < 1e-4


@pytest.mark.parametrize("seed", [0, 3])
def test_the_wall_s_prints_have_features_all_the_way(seed):
    wall = SyntheticSequence(SyntheticConfig(Preset.WALL, seed=seed, frames=400))
    counts = [len(cv2.ORB.create(1000).detect(wall[index].color)) for index in (0, 100, 200, 300, 399)]
    assert min(counts) > 250, counts


def test_nothing_is_put_before_the_wall(tmp_path):
    assert SyntheticConfig(Preset.WALL, objects=0).object_count == 0
    for wish in ({"objects": 3}, {"meshes": tmp_path}):
        with pytest.raises(UserError, match=f"synth:wall: nothing stands before its wall, found {next(iter(wish))} "):
            SyntheticConfig(Preset.WALL, **wish)


def test_truth_agrees_with_instances_and_points(tabletop):
    seen: set[int] = set()
    for index in range(0, 30, 5):
        truth, owner = tabletop.truth(index), tabletop.instances(index)
        assert owner.shape == (120, 160) and owner.dtype == np.int32 and owner.min() >= NO_OBJECT
        for k, number in enumerate(truth.object_id):
            rows, columns = np.nonzero(owner == number)
            assert (truth.visibility[k] > 0) == (len(rows) > 0)
            if len(rows):
                mask_box = [columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5]
                np.testing.assert_array_equal(truth.xyxy_visible[k], mask_box)
            assert truth.part_visibility[k].min() >= 0.0 and truth.part_visibility[k].max() <= 1.0
        seen |= set(truth.object_id[truth.visibility > 0.3].tolist())
    cloud = tabletop.point_truth()
    assert cloud is tabletop.point_truth(), "computed once"
    assert seen <= set(cloud.object_id.tolist()) <= {NO_OBJECT, *range(6)}
    for thing in tabletop.objects:
        own = cloud.points[cloud.object_id == thing.id]
        assert np.all(np.linalg.norm(own - thing.position, axis=1) < np.linalg.norm(thing.size) / 2 + 0.01)
        assert (cloud.class_id[cloud.object_id == thing.id] == tabletop.classes.index(thing.label)).all()


def test_without_the_sensors_effects_depth_is_exact(tabletop):
    ideal = SyntheticSequence(replace(SMALL, sensor=IDEAL))
    np.testing.assert_array_equal(ideal[4].depth, tabletop.true_depth(4))
    assert (tabletop[4].depth != ideal[4].depth).mean() > 0.9

"""Where cameras go: through free space, past everything, no faster than somebody who films."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.config import Preset
from thingmap.datasets.synthetic.motion.along_wall import to_and_fro
from thingmap.datasets.synthetic.motion.arcs import ArcConfig
from thingmap.datasets.synthetic.motion.camera_paths import camera_path
from thingmap.datasets.synthetic.motion.walk import WalkConfig, loop
from thingmap.datasets.synthetic.rendering.casting import MISS
from thingmap.datasets.synthetic.rendering.render import Renderer
from thingmap.datasets.synthetic.rendering.surfaces import assemble
from thingmap.datasets.synthetic.rooms.layout import Layout
from thingmap.datasets.synthetic.rooms.layouts import build_layout
from thingmap.datasets.synthetic.rooms.wall_room import ROOM

CAMERA = Intrinsics(160, 120, 131.25, 131.25, 79.5, 59.5)
FRAMES = {Preset.TABLETOP: 300, Preset.SURVEY: 37, Preset.KITCHEN: 900, Preset.LAPS: 3600, Preset.WALL: 1800}
NEAR, FAR = 0.4, 4.5  # metres, what depth cameras see
FURNISHED = tuple(preset for preset in Preset if preset is not Preset.WALL)  # things stand there
WALKS = (Preset.KITCHEN, Preset.LAPS)


@cache
def scene(preset: Preset) -> tuple[Layout, Renderer]:
    layout = build_layout(preset, np.random.default_rng(0))
    return layout, Renderer(assemble([(part, -1) for part in layout.parts]), layout.lights)


def depths(preset: Preset, T_world_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) depths and (N, 3) world points of an image of the empty scene."""
    renderer = scene(preset)[1]
    cast = renderer.cast(CAMERA, T_world_camera)
    assert not np.any(cast.triangle == MISS), "rooms are closed"
    depth = renderer.render(CAMERA, T_world_camera, cast).depth.ravel()
    return depth, T_world_camera[:3, 3] + depth[:, None] * cast.directions


def clear(preset: Preset, points: np.ndarray, directions: np.ndarray, reach: float) -> np.ndarray:
    """(N, M) bool: nothing lies within `reach` of each point in each direction."""
    renderer = scene(preset)[1]
    origins = np.repeat(points, len(directions), axis=0).astype(np.float32)
    rays = np.tile(directions, (len(points), 1)).astype(np.float32)
    blocked = renderer._caster.blocked(origins, rays, np.full(len(rays), reach, np.float32))
    return ~blocked.reshape(len(points), len(directions))


def all_round(count: int = 400) -> np.ndarray:
    """(count, 3) unit vectors spread over the sphere."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def turned(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between rotations, degrees."""
    trace = np.einsum("nij,nij->n", a[:, :3, :3], b[:, :3, :3])
    return np.degrees(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))


@pytest.mark.parametrize("preset", Preset)
def test_paths_are_rigid_repeatable_and_grow_at_their_end(preset):
    stamps, poses = camera_path(preset, 150, 4)
    assert stamps.shape == (150,) and poses.shape == (150, 4, 4)
    np.testing.assert_allclose(np.diff(stamps), 1.0 if preset is Preset.SURVEY else 1.0 / 30.0)
    R = poses[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (150, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    assert R[:, 2, 1].max() < -0.6, "image rows run down"
    few_stamps, few = camera_path(preset, 40, 4)
    np.testing.assert_array_equal(few, poses[:40])
    np.testing.assert_array_equal(few_stamps, stamps[:40])
    assert np.abs(camera_path(preset, 40, 5)[1] - few).max() > 0.01


@pytest.mark.parametrize("preset", Preset)
@pytest.mark.parametrize("seed", [0, 11])
def test_cameras_stay_in_free_space(preset, seed):
    frames = 3 * FRAMES[preset] if preset is Preset.SURVEY else FRAMES[preset]
    poses = camera_path(preset, frames, seed)[1]
    where = poses[:: 1 if preset is Preset.SURVEY else 9, :3, 3]
    reach = 0.22 if preset is Preset.TABLETOP else 0.32  # the orbit passes over the back of a chair
    free = clear(preset, where, all_round(), reach)
    assert free.all(), where[~free.all(axis=1)]


@pytest.mark.parametrize("preset", WALKS)
def test_walkers_do_not_brush_against_furniture(preset):
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    level = np.stack([np.cos(angle), np.sin(angle), np.zeros(48)], axis=1)
    where = camera_path(preset, FRAMES[preset], 1)[1][::15, :3, 3].copy()
    for height in (0.1, 0.45, 0.8, 1.2):
        where[:, 2] = height
        assert clear(preset, where, level, 0.25).all(), height


@pytest.mark.parametrize("preset", Preset)
def test_most_of_every_image_is_within_the_sensor_s_range(preset):
    poses = camera_path(preset, FRAMES[preset], 0)[1]
    for k in np.linspace(0, len(poses) - 1, 37).astype(int):
        depth, _ = depths(preset, poses[k])
        assert np.mean((depth > NEAR) & (depth < FAR)) >= 0.6, k
        assert np.percentile(depth, 1.0) > 0.35, k


@pytest.mark.parametrize("preset", FURNISHED)
def test_every_support_is_seen(preset):
    """From near enough: several images show a good part of it, and a walk comes within 2.8 m."""
    layout = scene(preset)[0]
    poses = camera_path(preset, FRAMES[preset], 0)[1]
    poses = poses[:: 1 if preset is Preset.SURVEY else FRAMES[preset] // 100]
    seen, nearest = np.zeros(len(layout.supports)), np.full(len(layout.supports), np.inf)
    for T in poses:
        _, points = depths(preset, T)
        for k, support in enumerate(layout.supports):
            c, s = np.cos(support.yaw), np.sin(support.yaw)
            local = (points[:, :2] - support.centre) @ np.array([[c, -s], [s, c]])
            on = np.all(np.abs(local) < np.array(support.size) / 2, axis=1) & (
                np.abs(points[:, 2] - support.height) < 0.01
            )
            if on.sum() > 60:
                seen[k] += 1
                nearest[k] = min(nearest[k], np.median(np.linalg.norm(points[on] - T[:3, 3], axis=1)))
    assert seen.min() >= 3, seen
    if preset in WALKS:
        assert nearest.max() < 2.8 and nearest.min() > 0.8


@pytest.mark.parametrize("seed", range(3))
def test_walks_are_of_a_filming_person_s_speed(seed):
    poses = camera_path(Preset.LAPS, 3600, seed)[1]
    speed = 30.0 * np.linalg.norm(np.diff(poses[::10, :2, 3], axis=0), axis=1) / 10.0
    assert np.percentile(speed, 1) > 0.38 and np.percentile(speed, 99) < 0.62
    turning = 3.0 * turned(poses[10::10], poses[:-10:10])
    assert np.percentile(turning, 99) < 47.0 and np.median(turning) < 25.0
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert steps.max() < 0.03, "smooth from frame to frame"


def test_laps_come_back_but_never_quite_the_same():
    poses = camera_path(Preset.LAPS, 3600, 0)[1]
    x = poses[:, 0, 3]
    doorway = np.flatnonzero((x[:-1] > 0.0) & (x[1:] <= 0.0))
    assert len(doorway) >= 3, "the doorway is passed from the living room once a lap"
    places = poses[doorway]
    apart = np.linalg.norm(places[1:, :3, 3] - places[:-1, :3, 3], axis=1)
    assert apart.max() < 0.4 and apart.min() > 0.005
    assert turned(places[1:], places[:-1]).max() < 15.0


def test_the_loop_is_closed_smooth_and_fits_into_a_kitchen_sequence():
    way = loop(WalkConfig().height)
    assert way.length / WalkConfig().speed < 30.0 - 0.5, "900 frames see all of it"
    distance = np.linspace(0.0, 2.0 * way.length, 4001)
    rows = way(distance)
    # Compared one whole turn apart, away from the interpolation table's ends.
    np.testing.assert_allclose(way(distance[1:2000] + way.length), rows[1:2000], atol=1e-9)
    covered = np.linalg.norm(np.diff(rows[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(covered, distance[1], rtol=5e-3)
    rate = np.degrees(np.abs(np.diff(rows[:, 2])) / distance[1]) * WalkConfig().speed
    assert rate.max() < 45.0


def test_surveys_step_five_degrees_along_arcs():
    config = ArcConfig()
    stamps, poses = camera_path(Preset.SURVEY, 3 * 37, 0)
    assert stamps[36] == 36.0
    arm = poses[:, :2, 3] - config.centre
    azimuth = np.degrees(np.unwrap(np.arctan2(arm[:, 1], arm[:, 0])))
    steps = np.diff(azimuth[:37])
    assert np.mean(steps) == pytest.approx(5.0, abs=0.1) and np.abs(steps - 5.0).max() < 4.0
    assert azimuth[36] - azimuth[0] == pytest.approx(180.0, abs=3.0)
    assert np.mean(np.diff(azimuth[37:74])) == pytest.approx(-5.0, abs=0.1), "the second arc goes back"
    for k in range(3):
        radius = np.linalg.norm(arm[37 * k : 37 * k + 37], axis=1)
        assert np.median(radius) == pytest.approx(config.radii[k], abs=0.02) and 0.01 < radius.std() < 0.04
    ahead = np.array(config.gaze) - poses[:, :3, 3]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    off = np.degrees(np.arccos(np.einsum("ni,ni->n", ahead, poses[:, :3, 2])))
    assert 0.3 < np.median(off) < 2.0 and off.max() < 5.0


@pytest.mark.parametrize("preset", [preset for preset in Preset if preset is not Preset.SURVEY])
def test_at_a_pace_the_same_way_is_gone_sooner(preset):
    usual_stamps, usual = camera_path(preset, 91, 4)
    stamps, poses = camera_path(preset, 31, 4, 3.0)
    np.testing.assert_array_equal(stamps, usual_stamps[:31])
    np.testing.assert_allclose(poses, usual[::3], atol=1e-9)
    np.testing.assert_array_equal(camera_path(preset, 10, 4, 3.0)[1], poses[:10])


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_a_fast_hand_goes_round_the_table_in_free_space(seed):
    """Ten seconds at pace 3 are more than a turn; at the usual pace it is less than half of one."""
    poses = camera_path(Preset.TABLETOP, 300, seed, 3.0)[1]
    azimuth = np.unwrap(np.arctan2(poses[:, 1, 3], poses[:, 0, 3]))
    assert azimuth[-1] - azimuth[0] > 2.2 * np.pi
    assert clear(Preset.TABLETOP, poses[::3, :3, 3], all_round(), 0.22).all()
    depth = np.concatenate([depths(Preset.TABLETOP, T)[0] for T in poses[::25]])
    assert np.mean((depth > NEAR) & (depth < FAR)) > 0.8
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert 0.025 < np.median(steps) < 0.045 and steps.max() < 0.06
    assert turned(poses[1:], poses[:-1]).max() < 4.0


@pytest.mark.parametrize("seed", range(4))
def test_along_the_wall_nothing_but_the_wall_is_seen(seed):
    """The corners of a slightly larger image, there and back again, at twice the default's length and more."""
    _, poses = camera_path(Preset.WALL, 1800, seed)
    wall = ROOM.y[1]
    for u, v in ((-3.0, -3.0), (163.0, -3.0), (163.0, 123.0), (-3.0, 123.0)):
        ray = np.array([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, 1.0])
        ahead = poses[:, :3, :3] @ ray
        at = poses[:, :3, 3] + ((wall - poses[:, 1, 3]) / ahead[:, 1])[:, None] * ahead
        assert ahead[:, 1].min() > 0.5
        assert ROOM.x[0] + 0.3 < at[:, 0].min() and at[:, 0].max() < ROOM.x[1] - 0.3
        assert at[:, 2].min() > 0.3 and at[:, 2].max() < ROOM.height - 0.2


@pytest.mark.parametrize("seed", range(4))
def test_the_wall_is_passed_at_arm_s_length_there_and_back(seed):
    _, poses = camera_path(Preset.WALL, 1800, seed)
    x, y, z = poses[:, :3, 3].T
    assert np.abs(ROOM.y[1] - y - 1.2).max() < 0.1
    speed = 30.0 * np.diff(x)
    assert speed[:199].min() > 0.2 and np.median(speed[:199]) == pytest.approx(0.3, abs=0.05), "one way by default"
    turns = np.flatnonzero(np.diff(np.sign(speed[::10])))
    assert len(turns) == 3 and np.abs(x).max() < 2.3, "back and forth within a minute"
    assert np.abs(30.0 * np.diff(speed)).max() < 1.5, "without a jerk"
    assert 0.004 < np.std(z) < 0.03, "a gentle bob"


def test_to_and_fro_is_even_between_its_turns():
    walked = np.linspace(0.0, 20.0, 4001)
    x = to_and_fro(walked, -1.6, 2.2, 0.98)
    rate = np.diff(x) / np.diff(walked)
    assert x[0] == pytest.approx(-1.6) and np.abs(x).max() == pytest.approx(2.2, abs=1e-4)
    assert np.abs(rate).max() == pytest.approx(1.0, abs=1e-3)
    assert np.abs(rate[np.abs(x[1:]) < 1.7]).min() > 0.9
    pendulum = to_and_fro(walked, 0.0, 2.0, 1e-6)
    np.testing.assert_allclose(pendulum, 2.0 * np.sin(walked / 2.0), atol=1e-6)

"""The camera in the graph: which world, which poses, which way is up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import BrokenFrame, Frame
from thingmap.mapper.config import MapperConfig, OdometryConfig, OdometrySource, UpConfig
from thingmap.mapper.estimation.records import Motion, Up, UpPrior, Visual
from thingmap.mapper.map.object_map import MapFrame
from thingmap.mapper.trajectory.camera import CameraGraph

GIVEN_POSES = MapperConfig(odometry=OdometryConfig(source=OdometrySource.POSES))
WORLD_UP = np.array([0.0, 0.0, 1.0])  # of the rendered sample
G = 9.81
TABLE = [((0.0, 0.0, 1.0), 0.0)]  # a floor at z = 0


def feed(graph: CameraGraph, frames) -> list[int]:
    """Processes frames; returns which became keyframes."""
    keyframes = []
    for frame in frames:
        if graph.track(frame):
            graph.add_keyframe(frame)
            graph.smoother.update()
            keyframes.append(frame.index)
    return keyframes


def records(graph: CameraGraph, kind: type) -> list:
    return [record for record in graph.smoother.ledger if isinstance(record, kind)]


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b, -1.0, 1.0))))


def up_in(frame: Frame) -> np.ndarray:
    assert frame.T_world_camera is not None
    return frame.T_world_camera[:3, :3].T @ WORLD_UP


def looking_down(x: float, turned: float = 0.0, pitch: float = 0.5) -> np.ndarray:
    """`T_world_camera` one metre above the floor, looking down by `pitch`, rad."""
    T = np.eye(4)
    forward = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # level, along world y
    T[:3, :3] = Rotation.from_rotvec([0.0, 0.0, turned]).as_matrix() @ forward
    T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec([-pitch, 0.0, 0.0]).as_matrix()
    T[:3, 3] = [x, 0.0, 1.0]
    return T


@pytest.fixture
def walk(plane_frame) -> list[Frame]:
    """Eight frames over a floor, given poses 40 mm apart."""
    return [plane_frame(TABLE, looking_down(0.04 * i, 0.02 * i), i) for i in range(8)]


@pytest.fixture(scope="module")
def mapped(tabletop) -> CameraGraph:
    graph = CameraGraph(MapperConfig(), None)
    feed(graph, tabletop)
    return graph


def test_the_world_is_the_first_camera_and_the_path_is_the_true_one(tabletop, mapped):
    stamps, poses = mapped.trajectory()
    assert mapped.map_frame is MapFrame.FIRST_CAMERA
    np.testing.assert_allclose(stamps, [f.stamp for f in tabletop])
    np.testing.assert_allclose(poses[0], np.eye(4), atol=2e-3)
    np.testing.assert_allclose(mapped.pose(), poses[-1], atol=1e-12)
    truth = np.linalg.inv(tabletop[0].T_world_camera) @ tabletop[-1].T_world_camera
    error = np.linalg.inv(truth) @ poses[-1]
    assert np.linalg.norm(truth[:3, 3]) > 0.25
    assert np.linalg.norm(error[:3, 3]) < 0.03
    assert np.degrees(Rotation.from_matrix(error[:3, :3]).magnitude()) < 1.5


def test_odometry_and_features_tie_neighbouring_keyframes(mapped):
    neighbours = [(t, t + 1) for t in range(mapped.smoother.keyframes - 1)]
    assert len(neighbours) >= 3
    assert [(m.a, m.b) for m in records(mapped, Motion)] == neighbours
    assert [(v.a, v.b) for v in records(mapped, Visual)] == neighbours


def test_up_is_found_from_planes_and_surer_than_before(tabletop, mapped):
    up = mapped.up()
    assert up.source == "planes"
    assert angle(up.direction, up_in(tabletop[0])) < 2.0
    assert up.std_rad < 0.5 * UpConfig().prior_sigma
    assert len(records(mapped, Up)) == (mapped.smoother.keyframes + 1) // 2  # every second keyframe


def test_features_can_be_left_out(tabletop):
    config = MapperConfig()
    graph = CameraGraph(replace(config, visual=replace(config.visual, enabled=False)), None)
    feed(graph, tabletop[:12])
    assert graph.smoother.keyframes > 1 and not records(graph, Visual)


def test_with_an_accelerometer_the_world_is_upright(tabletop):
    graph = CameraGraph(MapperConfig(), None)
    feed(graph, [replace(f, specific_force=G * up_in(f)) for f in tabletop[:10]])
    assert graph.map_frame is MapFrame.GRAVITY_ALIGNED
    _, poses = graph.trajectory()
    assert angle(poses[0][:3, :3] @ up_in(tabletop[0]), WORLD_UP) < 1.0
    assert angle(graph.up().direction, WORLD_UP) < 1.5
    assert graph.up().std_rad <= UpConfig().accelerometer_sigma
    np.testing.assert_allclose(poses[0][:3, 3], 0.0, atol=2e-3)


@pytest.mark.parametrize("force", [13.0, 5.0])
def test_a_shaken_accelerometer_does_not_make_the_world(tabletop, force):
    graph = CameraGraph(MapperConfig(), None)
    feed(graph, [replace(tabletop[0], specific_force=force * up_in(tabletop[0]))])
    assert graph.map_frame is MapFrame.FIRST_CAMERA
    assert graph.up().source != "accelerometer"


def test_an_accelerometer_that_wakes_up_later_is_heard(tabletop):
    graph = CameraGraph(replace(MapperConfig(), up=replace(UpConfig(), every=1000)), None)
    feed(graph, [tabletop[0], *(replace(f, specific_force=G * up_in(f)) for f in tabletop[1:12])])
    assert graph.map_frame is MapFrame.FIRST_CAMERA
    assert any(r.sigma == UpConfig().accelerometer_sigma for r in records(graph, Up))
    assert angle(graph.up().direction, up_in(tabletop[0])) < 5.0


def test_with_given_poses_the_world_is_the_dataset_s(walk):
    graph = CameraGraph(GIVEN_POSES, None)
    keyframes = feed(graph, walk)
    assert graph.map_frame is MapFrame.DATASET
    assert 1 < len(keyframes) < len(walk)
    _, poses = graph.trajectory()
    np.testing.assert_allclose(poses, [f.T_world_camera for f in walk], atol=5e-3)
    up = graph.up()
    assert up.source == "planes"
    assert angle(up.direction, WORLD_UP) < 3.0  # the camera looks down by 29 degrees: that was the first guess


def test_the_last_pose_is_known_after_every_frame(walk):
    graph = CameraGraph(GIVEN_POSES, None)
    for frame in walk:
        feed(graph, [frame])
        np.testing.assert_allclose(graph.pose(), frame.T_world_camera, atol=5e-3)
        np.testing.assert_allclose(graph.pose(), graph.trajectory()[1][-1], atol=1e-12)


def test_given_poses_need_no_features(tabletop):
    graph = CameraGraph(GIVEN_POSES, None)
    feed(graph, tabletop[::7])
    assert graph.smoother.keyframes > 2 and not records(graph, Visual)


def test_a_gravity_file_settles_up_where_poses_are_given(walk):
    graph = CameraGraph(GIVEN_POSES, np.array([0.0, 0.0, -1.0]))
    feed(graph, walk)
    up = graph.up()
    assert (up.source, len(records(graph, Up))) == ("gravity file", 0)
    assert angle(up.direction, WORLD_UP) < 1e-6
    assert up.std_rad == pytest.approx(UpConfig().gravity_sigma)
    # down in the dataset's world means nothing in another one
    other = CameraGraph(MapperConfig(odometry=OdometryConfig(pixel_step=1)), np.array([0.0, 0.0, -1.0]))
    feed(other, walk[:1])
    assert other.map_frame is MapFrame.FIRST_CAMERA
    np.testing.assert_allclose(records(other, UpPrior)[0].direction, [0.0, -1.0, 0.0])


def test_without_planes_or_readings_up_is_how_cameras_are_held(plane_frame):
    T = np.eye(4)
    T[:3, :3] = looking_down(0.0, 0.0, 0.0)[:3, :3]
    wall = plane_frame([((0.0, 1.0, 0.0), 1.5)], T)
    graph = CameraGraph(GIVEN_POSES, None)
    feed(graph, [wall])
    up = graph.up()
    assert up.source == "camera prior"
    assert angle(up.direction, WORLD_UP) < 1e-6  # the level camera's own up, in the dataset's world
    assert up.std_rad == pytest.approx(UpConfig().prior_sigma, rel=0.01)


def test_a_broken_frame_changes_nothing(walk):
    calm, disturbed = CameraGraph(GIVEN_POSES, None), CameraGraph(GIVEN_POSES, None)
    with pytest.raises(BrokenFrame):
        disturbed.track(replace(walk[0], T_world_camera=None))
    assert not disturbed.started
    for frame in walk:
        assert feed(calm, [frame]) == feed(disturbed, [frame])
        with pytest.raises(BrokenFrame):
            disturbed.track(replace(frame, T_world_camera=None))
        np.testing.assert_array_equal(calm.pose(), disturbed.pose())
    for one, two in zip(calm.trajectory(), disturbed.trajectory(), strict=True):
        np.testing.assert_array_equal(one, two)
    assert len(calm.smoother.ledger) == len(disturbed.smoother.ledger)


def test_before_the_first_frame_nothing_is_known():
    graph = CameraGraph(MapperConfig(), None)
    assert not graph.started
    with pytest.raises(RuntimeError, match="no frame"):
        _ = graph.smoother
    stamps, poses = graph.trajectory()
    assert stamps.shape == (0,) and poses.shape == (0, 4, 4)
    up = graph.up()
    assert (up.source, up.std_rad) == ("camera prior", UpConfig().prior_sigma)


def test_a_keyframe_is_seen_from_where_it_was_predicted(walk):
    graph = CameraGraph(GIVEN_POSES, None)
    for frame in walk:
        if graph.track(frame):
            view = graph.add_keyframe(frame)
            graph.smoother.update()
            assert view.keyframe == graph.smoother.keyframes - 1 and view.frame is frame
            np.testing.assert_allclose(view.T_world_camera, frame.T_world_camera, atol=5e-3)
            np.testing.assert_allclose(view.to_world(np.zeros(3)), view.T_world_camera[:3, 3])
    assert graph.smoother.keyframes > 2

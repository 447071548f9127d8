import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.mapper.labelling.pixel_evidence import pixel_grid
from thingmap.mapper.labelling.surface import REACH, surface_of
from thingmap.mapper.labelling.voxel_config import VoxelConfig
from thingmap.mapper.labelling.voxels import VoxelEvidence

CAMERA = Intrinsics(80, 60, 300.0, 310.0, 39.0, 30.5)
HERE = np.eye(4)[None]


def frame_of(depth: np.ndarray) -> Frame:
    color = np.random.default_rng(0).integers(0, 256, (*depth.shape, 3), dtype=np.uint8)
    return Frame(0, "a", 0.0, color, depth.astype(np.float32), CAMERA)


def plane_depth(normal: np.ndarray, distance: float) -> np.ndarray:
    """(60, 80) depth of the plane n . x = distance."""
    u, v = np.meshgrid(np.arange(80), np.arange(60))
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, float)], axis=-1)
    return distance / (rays @ normal)


def sphere_depth() -> np.ndarray:
    """A ball of 8 cm, 1 m away, before nothing."""
    u, v = np.meshgrid(np.arange(80), np.arange(60))
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, float)], axis=-1)
    a, b, c = (rays**2).sum(axis=-1), rays[..., 2], 1.0 - 0.08**2
    root = b**2 - a * c
    return np.where(root > 0.0, (b - np.sqrt(np.maximum(root, 0.0))) / a, 0.0)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, tilt=st.floats(0.0, 0.7), step=st.integers(1, 4))
def test_a_plane_has_its_points_normal_and_colours(seed: int, tilt: float, step: int) -> None:
    angle = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    normal = np.array([np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), np.cos(tilt)])
    frame = frame_of(plane_depth(normal, 1.2))
    uv = pixel_grid(frame, step, 0.1, 100.0)
    surface = surface_of(frame, uv)
    z = frame.depth[uv[:, 1], uv[:, 0]]
    np.testing.assert_allclose(surface.points, CAMERA.back_project(uv, z), rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(surface.colours, frame.color[uv[:, 1], uv[:, 0]])
    np.testing.assert_allclose(surface.normals, np.tile(-normal, (len(uv), 1)), atol=2e-4)


def test_normals_of_a_ball_point_outwards_and_to_the_camera() -> None:
    frame = frame_of(sphere_depth())
    uv = pixel_grid(frame, 1, 0.1, 4.0)
    surface = surface_of(frame, uv)
    known = ~np.isnan(surface.normals[:, 0])
    assert known.mean() > 0.7
    assert ((surface.normals * surface.points).sum(axis=1)[known] < 0.0).all()
    outwards = (surface.points - [0.0, 0.0, 1.0]) / 0.08
    middle = known & (np.hypot(*(uv - [CAMERA.cx, CAMERA.cy]).T) < 10)
    assert ((surface.normals * outwards).sum(axis=1)[middle] > 0.98).all()


def test_normals_end_where_depth_jumps_and_are_of_one_side_beside_it() -> None:
    depth = np.full((60, 80), 2.0)
    depth[:, 40:] = 1.0
    depth[20:40, 10] = 0.0
    uv = np.array([[39, 30], [40, 30], [10 + REACH, 30], [0, 0], [79, 59]])
    np.testing.assert_allclose(surface_of(frame_of(depth), uv).normals, np.tile([0, 0, -1.0], (5, 1)), atol=1e-6)
    pole = np.full((60, 80), 2.0)
    pole[:, 38:42] = 1.0
    assert np.isnan(surface_of(frame_of(pole), np.array([[40, 30]])).normals).all()


def test_two_cameras_on_both_sides_of_a_thin_board_see_normals_of_their_own() -> None:
    """Through to the world: each side's voxels have the normal of who saw them."""
    frame = frame_of(np.full((60, 80), 1.002))
    uv = pixel_grid(frame, 2, 0.1, 4.0)
    s = surface_of(frame, uv)
    behind = np.diag([-1.0, 1.0, -1.0, 1.0])
    behind[2, 3] = 2.03
    evidence = VoxelEvidence(("cup",), VoxelConfig())
    log_p = np.full((len(uv), 2), -1.0, np.float32)
    for T in (np.eye(4), behind):
        evidence.add(0, T, s.points, s.normals, s.colours, log_p)
    voxels = evidence.assemble(HERE)
    front = voxels.points[:, 2] < 1.015
    assert front.any() and (~front).any()
    np.testing.assert_allclose(voxels.normals[front], np.tile([0, 0, -1.0], (front.sum(), 1)), atol=1e-6)
    np.testing.assert_allclose(voxels.normals[~front], np.tile([0, 0, 1.0], ((~front).sum(), 1)), atol=1e-6)


def test_pixels_without_depth_or_outside_are_refused() -> None:
    depth = np.full((60, 80), 1.0)
    depth[5, 7] = 0.0
    with pytest.raises(ValueError, match="1 of 2 have none"):
        surface_of(frame_of(depth), np.array([[7, 5], [8, 5]]))
    for outside in ([80, 5], [5, 60], [-1, 5], [5, -1]):
        with pytest.raises(ValueError, match="80 x 60"):
            surface_of(frame_of(depth), np.array([outside]))
    assert surface_of(frame_of(depth), np.empty((0, 2), np.int32)).points.shape == (0, 3)

"""Visibility in scenes whose answer is known: spheres before, behind and inside planes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import Intrinsics
from thingmap.detectors.detections import Part
from thingmap.factors.depth_likelihood import DepthLikelihood
from thingmap.factors.visibility import Visibility, VolumePart, measure_visibility
from thingmap.factors.volume import project_volumes

INTRINSICS = Intrinsics(320, 240, 260.0, 265.0, 159.5, 119.5)
CENTER, RADIUS = np.array([0.05, -0.1, 2.0]), 0.25
WHOLE, TOP, BOTTOM, LEFT, RIGHT = VolumePart


def rays() -> np.ndarray:
    """(H, W, 3) camera rays of unit depth."""
    u, v = np.meshgrid(np.arange(320), np.arange(240))
    return np.stack([(u - 159.5) / 260.0, (v - 119.5) / 265.0, np.ones(u.shape)], axis=-1)


def sphere_depth(center=CENTER, radius=RADIUS) -> np.ndarray:
    """(H, W) depth of a sphere's near side; infinite beside it."""
    d = rays()
    a, b, c = (d * d).sum(axis=-1), d @ center, center @ center - radius**2
    inside = b * b - a * c
    return np.where(inside > 0.0, (b - np.sqrt(np.maximum(inside, 0.0))) / a, np.inf)


def measure(depth, center=CENTER, half_axes=(RADIUS,) * 3, **options) -> Visibility:
    center, size = np.atleast_2d(center), np.log(np.atleast_2d(half_axes))
    return measure_visibility(depth.astype(np.float32), INTRINSICS, np.eye(4), np.eye(3), center, size, **options)


def wall(z: float) -> np.ndarray:
    return np.full((240, 320), z)


def test_parts_are_numbered_as_the_detectors_number_them():
    assert [part.name for part in VolumePart] == [part.name for part in Part]
    assert [int(part) for part in VolumePart] == [int(part) for part in Part]


@pytest.mark.parametrize("step", [1, 2, 4])
def test_a_sphere_before_a_wall_agrees_everywhere(step):
    seen = measure(np.minimum(sphere_depth(), wall(3.0)), step=step)
    np.testing.assert_array_equal(seen.agreeing, np.ones((1, 5)))
    np.testing.assert_array_equal(seen.visible, np.ones((1, 5)))
    assert not seen.occluded.any() and not seen.free.any() and not seen.missing.any()


def test_a_wall_far_behind_is_free_and_one_before_occludes():
    np.testing.assert_array_equal(measure(wall(3.0)).free, np.ones((1, 5)))
    np.testing.assert_array_equal(measure(wall(3.0)).visible, np.ones((1, 5)))
    np.testing.assert_array_equal(measure(wall(1.0)).occluded, np.ones((1, 5)))
    np.testing.assert_array_equal(measure(wall(1.0)).visible, np.zeros((1, 5)))


def middle() -> tuple[int, int]:
    """First column and row right of and below the middle of the sphere's box."""
    box, _ = project_volumes(np.eye(4), np.eye(3), CENTER[None], np.log([[RADIUS] * 3]), INTRINSICS)
    u, v = np.ceil((box[0, :2] + box[0, 2:]) / 2).astype(int)
    return u, v


@pytest.mark.parametrize(("hidden", "shown"), [(LEFT, RIGHT), (TOP, BOTTOM)], ids=["left", "top"])
def test_a_hidden_half_is_that_half(hidden, shown):
    u, v = middle()
    region = np.s_[:, :u] if hidden == LEFT else np.s_[:v, :]
    depth = np.minimum(sphere_depth(), wall(3.0))
    depth[region] = 1.0
    seen = measure(depth, step=1)
    assert seen.occluded[0, hidden] == 1.0 and seen.occluded[0, shown] == 0.0
    across = [part for part in (TOP, BOTTOM, LEFT, RIGHT) if part not in (hidden, shown)]
    np.testing.assert_allclose(seen.occluded[0, [WHOLE, *across]], 0.5, atol=0.01)
    np.testing.assert_allclose(seen.occluded + seen.agreeing + seen.free, 1.0)


def test_share_of_free_pixels_of_a_plane_through_a_distant_sphere():
    """Seen from afar, a plane h behind the centre is beyond the far side where sqrt(r^2 - rho^2) < h: h^2 / r^2."""
    center, radius = np.array([0.0, 0.0, 400.0]), 40.0
    for h in (0.3 * radius, 0.7 * radius):
        seen = measure(wall(400.0 + h), center, (radius,) * 3, step=1, tolerance_m=0.0, tolerance_per_m=0.0)
        free = seen.free[0, WHOLE]
        assert free == pytest.approx(exact_free_share(center, radius, 400.0 + h), abs=0.02)
        assert free == pytest.approx((h / radius) ** 2, abs=0.12)


def exact_free_share(center: np.ndarray, radius: float, z: float) -> float:
    """Share of the sphere's pixels whose far intersection lies before depth z."""
    d = rays()
    a, b, c = (d * d).sum(axis=-1), d @ center, center @ center - radius**2
    inside = b * b - a * c > 0.0
    leaves = (b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
    return float((leaves < z)[inside].mean())


def test_an_occluder_counts_from_the_bounding_box_on():
    """Between the box and the ellipsoid a surface may be the object's own corner; before the box it is not."""
    inside_box = measure(wall(CENTER[2] - RADIUS + 0.02), step=1)
    assert inside_box.occluded[0, WHOLE] == 0.0 and inside_box.agreeing[0, WHOLE] == 1.0
    before_box = measure(wall(CENTER[2] - RADIUS - 0.05), step=1)
    assert before_box.occluded[0, WHOLE] == 1.0


def test_the_tolerance_grows_with_the_square_of_depth():
    near_side, far_side = CENTER[2] - RADIUS, CENTER[2] + RADIUS
    for gap, tolerance, occluded in [(0.05, 0.04, 1.0), (0.05, 0.06, 0.0)]:
        for options in (
            {"tolerance_m": tolerance, "tolerance_per_m": 0.0},
            {"tolerance_m": 0.0, "tolerance_per_m": tolerance / (near_side - gap) ** 2},
        ):
            assert measure(wall(near_side - gap), **options).occluded[0, WHOLE] == occluded
    assert measure(wall(far_side + 0.05), tolerance_m=0.04, tolerance_per_m=0.0).free[0, WHOLE] == 1.0
    assert measure(wall(far_side + 0.05), tolerance_m=0.3, tolerance_per_m=0.0).free[0, WHOLE] < 0.5


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf, -1.0])
def test_pixels_without_a_reading_say_nothing(nothing):
    depth = np.minimum(sphere_depth(), wall(3.0))
    u, v = middle()
    depth[:, :u] = nothing
    depth[:v, u:] = 1.0
    seen = measure(depth, step=1)
    assert seen.missing[0, LEFT] == 1.0 and seen.missing[0, RIGHT] == 0.0
    assert seen.missing[0, WHOLE] == pytest.approx(0.5, abs=0.02)
    assert seen.occluded[0, WHOLE] == pytest.approx(0.5, abs=0.02)
    blind = measure(wall(nothing))
    np.testing.assert_array_equal(blind.missing, np.ones((1, 5)))
    assert not blind.occluded.any() and not blind.agreeing.any() and not blind.free.any()


def test_behind_beside_and_at_the_camera_there_is_nothing():
    centers = np.array([[0.0, 0.0, -2.0], [9.0, 0.0, 2.0], [0.0, 6.0, 2.0], [0.0, 0.0, 0.2]])
    seen = measure(wall(1.5), centers, np.full((4, 3), RADIUS))
    for name in ("occluded", "agreeing", "free", "missing", "in_image", "visible"):
        assert not getattr(seen, name).any(), name
    assert not seen.pixels.any()
    empty = measure(wall(1.5), np.empty((0, 3)), np.empty((0, 3)))
    assert empty.occluded.shape == (0, 5) and empty.pixels.shape == (0,)


def test_half_out_of_the_image():
    """A sphere on the image's left border: about half of it, and of its top and bottom, is inside."""
    center = np.array([(-0.5 - 159.5) / 260.0, 0.0, 1.0]) * 4.0
    seen = measure(wall(3.0), center, (0.05, 0.3, 0.05))
    np.testing.assert_allclose(seen.in_image[0], [0.5, 0.5, 0.5, 0.0, 1.0], atol=0.03)
    np.testing.assert_allclose(seen.visible, (1.0 - seen.occluded) * seen.in_image)


def test_something_between_the_pixels_is_unknown():
    between_four_pixels = np.array([0.0, 0.0, 5.0])
    seen = measure(wall(3.0), between_four_pixels, (0.002,) * 3)
    np.testing.assert_array_equal(seen.in_image, np.ones((1, 5)))
    np.testing.assert_array_equal(seen.missing, np.ones((1, 5)))
    assert seen.pixels[0] == 0


@settings(deadline=None, derandomize=True, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_silhouette_against_every_pixel_tested(seed):
    """Pixels as found by testing each, and shares inside the image by a fine grid over the whole silhouette."""
    rng = np.random.default_rng(seed)
    half_axes, z = rng.uniform(0.1, 0.4, 3), rng.uniform(1.2, 3.0)
    center = np.array([rng.uniform(-0.8, 0.8) * z, rng.uniform(-0.6, 0.6) * z, z])
    seen = measure(wall(5.0), center, half_axes)

    def silhouette(u, v):
        q = np.stack([(u - 159.5) / 260.0, (v - 119.5) / 265.0, np.ones(u.shape)], axis=-1) / half_axes
        p = -center / half_axes
        return (q @ p) ** 2 - (q * q).sum(axis=-1) * (p @ p - 1.0) > 0.0

    assert seen.pixels[0] == silhouette(*np.meshgrid(np.arange(320), np.arange(240))).sum()
    box, _ = project_volumes(np.eye(4), np.eye(3), center[None], np.log(half_axes)[None], INTRINSICS)
    u, v = np.meshgrid(np.linspace(box[0, 0], box[0, 2], 400), np.linspace(box[0, 1], box[0, 3], 400))
    there, inside = silhouette(u, v), (u > -0.5) & (u < 319.5) & (v > -0.5) & (v < 239.5)
    top, left = np.arange(400)[:, None] < 200, np.arange(400)[None, :] < 200
    parts = [there, there & top, there & ~top, there & left, there & ~left]
    np.testing.assert_allclose(seen.in_image[0], [(part & inside).sum() / part.sum() for part in parts], atol=0.02)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_every_pixel_of_turned_volumes_against_plain_geometry(seed):
    """Each ray is cut with the six faces of the box and with the ellipsoid in the volume's own frame."""
    rng = np.random.default_rng(seed)
    R_upright, R_camera = Rotation.random(2, rng).as_matrix()
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R_camera, rng.normal(size=3)
    in_camera = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), rng.uniform(1.3, 2.5)])
    center = R_camera @ in_camera + T[:3, 3]
    half_axes = rng.uniform(0.05, 0.4, 3)
    depth = rng.uniform(0.8, 3.0, (240, 320)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = 0.0

    origin = R_upright.T @ (T[:3, 3] - center)
    d = (rays().reshape(-1, 3) @ R_camera.T) @ R_upright
    faces = (np.stack([-half_axes, half_axes])[:, None] - origin) / d
    entry = faces.min(axis=0).max(axis=1)
    p, q = origin / half_axes, d / half_axes
    a, b, c = (q * q).sum(axis=1), q @ p, p @ p - 1.0
    hit = b * b - a * c > 0.0
    leaves = (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
    z = depth.ravel().astype(float)
    tolerance = 0.01 + 0.003 * z * z
    read = hit & (z > 0.0)
    occluded, free = z < entry - tolerance, z > leaves + tolerance
    expected = [occluded[read].mean(), (~occluded & ~free)[read].mean(), free[read].mean(), 1 - read.sum() / hit.sum()]

    size, likelihood = np.log(half_axes)[None], DepthLikelihood(surface=0.6, sensor_noise=0.01, outlier=0.1)
    seen = measure_visibility(depth, INTRINSICS, T, R_upright, center[None], size, 1, 0.01, 0.003, likelihood)
    found = [seen.occluded[0, WHOLE], seen.agreeing[0, WHOLE], seen.free[0, WHOLE], seen.missing[0, WHOLE]]
    assert seen.pixels[0] == pytest.approx(hit.sum(), abs=1)
    np.testing.assert_allclose(found, expected, atol=2.0 / hit.sum())

    through_center = R_upright.T @ R_camera @ (in_camera / in_camera[2])
    half_depth = 1.0 / np.linalg.norm(through_center / half_axes)
    told = read & ~occluded
    at_center = 0.01 + 0.003 * in_camera[2] ** 2
    nats = likelihood.log_ratio((z - entry)[told], half_depth, in_camera[2], at_center)
    assert seen.readings[0, WHOLE] == pytest.approx(told.sum(), abs=2)
    assert seen.depth_log_ratio[0, WHOLE] == pytest.approx(nats.mean(), abs=10.0 / told.sum())
    box, _ = project_volumes(T, R_upright, center[None], size, INTRINSICS)
    u, v = np.meshgrid(np.arange(320), np.arange(240))
    left, top = u.ravel()[told] < box[0, [0, 2]].mean(), v.ravel()[told] < box[0, [1, 3]].mean()
    for part, half in zip((TOP, BOTTOM, LEFT, RIGHT), (top, ~top, left, ~left), strict=True):
        if half.sum() > 50:
            assert seen.readings[0, part] == pytest.approx(half.sum(), abs=2)
            assert seen.depth_log_ratio[0, part] == pytest.approx(nats[half].mean(), abs=10.0 / half.sum())


def test_depth_speaks_for_a_surface_where_it_is_expected_and_against_an_empty_volume():
    o = DepthLikelihood().outlier
    there = measure(np.minimum(sphere_depth(), wall(3.0)))
    assert (there.depth_log_ratio > 0.8).all()
    np.testing.assert_allclose(measure(wall(5.0)).depth_log_ratio, np.log(o), atol=1e-6)
    hidden = measure(wall(1.0))
    assert not hidden.depth_log_ratio.any() and not hidden.readings.any()


def test_hidden_pixels_say_nothing_of_depth():
    """Covering the left half leaves the right half's evidence alone, and the whole is that of the right half."""
    u, _ = middle()
    depth = np.minimum(sphere_depth(), wall(3.0))
    open_view = measure(depth, step=1)
    depth[:, :u] = 1.0
    seen = measure(depth, step=1)
    assert seen.depth_log_ratio[0, RIGHT] == open_view.depth_log_ratio[0, RIGHT]
    assert seen.depth_log_ratio[0, WHOLE] == pytest.approx(seen.depth_log_ratio[0, RIGHT], abs=1e-9)
    assert seen.readings[0, LEFT] == 0 and seen.depth_log_ratio[0, LEFT] == 0.0
    assert seen.readings[0, WHOLE] == seen.readings[0, RIGHT] == open_view.readings[0, RIGHT]


@pytest.mark.parametrize("step", [1, 2, 4])
def test_readings_count_at_full_resolution(step):
    seen = measure(np.minimum(sphere_depth(), wall(3.0)), step=step)
    assert seen.readings[0, WHOLE] == pytest.approx(seen.pixels[0], rel=0.05)
    np.testing.assert_allclose(seen.readings[0, TOP:].sum(), 2.0 * seen.readings[0, WHOLE])


def test_without_a_likelihood_nothing_is_said_of_depth_and_the_ratios_stay():
    depth = np.minimum(sphere_depth(), wall(2.2))
    depth[::3] = 1.0
    with_it, without = measure(depth), measure(depth, likelihood=None)
    assert with_it.depth_log_ratio.any() and not without.depth_log_ratio.any()
    for name in ("occluded", "agreeing", "free", "missing", "in_image", "pixels", "readings"):
        np.testing.assert_array_equal(getattr(with_it, name), getattr(without, name))


def test_six_fields_make_a_visibility_whose_depth_says_nothing():
    ratios = {name: np.zeros((3, 5)) for name in ("occluded", "agreeing", "free", "missing", "in_image")}
    made = Visibility(**ratios, pixels=np.zeros(3))
    assert made.depth_log_ratio.shape == made.readings.shape == (3, 5)
    assert not made.depth_log_ratio.any() and not made.readings.any()


def test_a_camera_between_two_faces_of_a_box_enters_by_the_others():
    """The camera is level with the volume on two axes: only the near face is before it."""
    seen = measure(wall(CENTER[2] - RADIUS - 0.05), np.array([0.0, 0.0, 2.0]), (0.5, 0.5, RADIUS), step=1)
    assert seen.occluded[0, WHOLE] == 1.0
    seen = measure(wall(CENTER[2] - RADIUS + 0.05), np.array([0.0, 0.0, 2.0]), (0.5, 0.5, RADIUS), step=1)
    assert seen.agreeing[0, WHOLE] == 1.0


def test_every_second_pixel_is_enough():
    rng = np.random.default_rng(1)
    depth = np.repeat(np.repeat(rng.uniform(1.5, 3.0, (30, 40)), 8, axis=0), 8, axis=1)
    centers = np.c_[rng.uniform(-0.6, 0.6, 30), rng.uniform(-0.4, 0.4, 30), rng.uniform(1.8, 2.5, 30)]
    fine, coarse = (measure(depth, centers, np.full((30, 3), 0.2), step=step) for step in (1, 2))
    np.testing.assert_array_equal(fine.pixels, coarse.pixels)
    assert np.abs(fine.occluded - coarse.occluded).mean() < 0.02
    assert np.abs(fine.free - coarse.free).mean() < 0.02
    assert np.abs(fine.depth_log_ratio - coarse.depth_log_ratio).mean() < 0.1


def test_a_depth_image_of_another_size_is_refused():
    with pytest.raises(ValueError, match="240 x 320"):
        measure(np.ones((100, 100)))


@pytest.mark.parametrize("folder", ["003_cracker_box", "006_mustard_bottle", "024_bowl", "025_mug"])
def test_scanned_objects_never_occlude_themselves(real_data: Path, folder: str):
    """Turned on their own with nothing before them: no pixel is occluded, and few are seen through."""
    rtcore, construction = pytest.importorskip("embreex.rtcore_scene"), pytest.importorskip("embreex.mesh_construction")
    lines = next((real_data / "ycb" / folder).rglob("*.obj")).read_text().splitlines()
    vertices = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=float)
    faces = np.array(
        [[int(corner.split("/")[0]) - 1 for corner in line.split()[1:4]] for line in lines if line[:2] == "f "]
    )
    tilt = np.radians(35.0)  # the camera looks down on it from 0.8 m
    R = np.array([[1, 0, 0], [0, -np.sin(tilt), -np.cos(tilt)], [0, np.cos(tilt), -np.sin(tilt)]]).T
    for yaw in np.radians([0.0, 35.0, 70.0]):
        c, s = np.cos(yaw), np.sin(yaw)
        turned = vertices @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
        low, high = turned.min(axis=0), turned.max(axis=0)
        center, half_axes = R.T @ np.zeros(3) + [0, 0, 0.8], (high - low) / 2
        in_camera = (turned - (low + high) / 2) @ R + [0, 0, 0.8]
        scene = rtcore.EmbreeScene()
        construction.TriangleMesh(scene, in_camera[faces].astype(np.float32))
        d = rays().reshape(-1, 3).astype(np.float32)
        hit = scene.run(np.zeros_like(d), d, output=1)
        depth = np.where(hit["primID"] >= 0, hit["tfar"], 1.6).reshape(240, 320).astype(np.float32)
        seen = measure_visibility(depth, INTRINSICS, np.eye(4), R.T, center[None], np.log(half_axes)[None])
        assert not seen.occluded.any()
        assert seen.agreeing[0, WHOLE] > 0.7

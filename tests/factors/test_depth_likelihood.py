"""The mixture of depth readings: its densities by scipy, its bounds, and whether it tells things from empty places."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import truncnorm

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.depth_likelihood import DepthLikelihood
from thingmap.factors.visibility import VolumePart, measure_visibility

MODEL = DepthLikelihood()
half_depths, depths, tolerances = st.floats(0.01, 1.0), st.floats(0.4, 6.0), st.floats(0.0, 0.1)


def cut_gaussian(beyond: np.ndarray, half_depth: float, sigma: float, tolerance: float) -> np.ndarray:
    """Density of metres beyond the entry: about the expected surface, from the tolerance before the entry on."""
    offset = MODEL.surface * half_depth
    return truncnorm.pdf(beyond, (-tolerance - offset) / sigma, np.inf, loc=offset, scale=sigma)


@settings(deadline=None, derandomize=True)
@given(half_depths, depths, tolerances)
def test_the_ratio_is_that_of_the_two_densities(half_depth, depth, tolerance):
    narrow = np.hypot(MODEL.misfit * half_depth, MODEL.sensor_noise * depth**2)
    wide = np.hypot(narrow, MODEL.wide_sigma)
    beyond = np.linspace(-tolerance, 4.0, 50)
    none = cut_gaussian(beyond, half_depth, wide, tolerance)
    there = (1.0 - MODEL.outlier) * cut_gaussian(beyond, half_depth, narrow, tolerance)
    there += MODEL.outlier * none
    found = MODEL.log_ratio(beyond, half_depth, depth, tolerance)
    told = none > 1e-200
    np.testing.assert_allclose(found[told], np.log(there[told] / none[told]), atol=1e-9)


@settings(deadline=None, derandomize=True)
@given(half_depths, depths, st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_it_falls_from_the_expected_surface_to_the_outliers(half_depth, depth, one, other):
    near, far = sorted([one, other])
    surface = MODEL.surface * half_depth
    top, at_near, at_far = MODEL.log_ratio(surface + np.array([0.0, near, far]), half_depth, depth, 0.02)
    assert top >= at_near >= at_far >= np.log(MODEL.outlier)
    assert MODEL.log_ratio(np.array([50.0]), half_depth, depth, 0.02)[0] == pytest.approx(np.log(MODEL.outlier))


def test_far_and_large_things_are_expected_less_exactly():
    """The same error says less of a far thing, whose depth is noisy, and of a deep one, whose shape is."""
    beyond = MODEL.surface * 0.02 + np.array([0.0, 0.03])
    near, far = (MODEL.log_ratio(beyond, 0.02, depth, 0.02) for depth in (0.7, 3.0))
    assert near[0] > far[0] and near[1] < far[1]
    small, large = (MODEL.log_ratio(np.array([0.1]) + MODEL.surface * half, half, 1.0, 0.02) for half in (0.03, 0.3))
    assert small[0] < 0.0 < large[0]


@pytest.mark.parametrize("wrong", [{"outlier": 0.0}, {"outlier": 1.0}, {"misfit": 0.0}, {"wide_sigma": -1.0}])
def test_numbers_that_make_no_mixture_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        DepthLikelihood(**wrong)


def test_whole_numbers_are_numbers():
    whole = DepthLikelihood(surface=1, misfit=1, wide_sigma=1)
    exact = DepthLikelihood(surface=1.0, misfit=1.0, wide_sigma=1.0)
    assert whole.log_ratio(np.array([0.1]), 1, 2, 0) == exact.log_ratio(np.array([0.1]), 1.0, 2.0, 0.0)


def table_with_a_can() -> tuple[np.ndarray, Intrinsics, np.ndarray, np.ndarray, np.ndarray]:
    """Noisy depth of a cylinder on a table seen from above at a slant, and the cylinder's centre and half-axes.

    World: z up, the table at z = 0; the camera 1.3 m away looks down by 35 degrees.
    """
    k, tilt = Intrinsics(320, 240, 260.0, 260.0, 159.5, 119.5), np.radians(35.0)
    forward = np.array([0.0, np.cos(tilt), -np.sin(tilt)])
    down = np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack([np.cross(down, forward), down, forward]), -1.3 * forward
    u, v = np.meshgrid(np.arange(k.width), np.arange(k.height))
    d = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones(u.shape)], axis=-1) @ T[:3, :3].T
    o, radius, height = T[:3, 3], 0.05, 0.14
    with np.errstate(divide="ignore", invalid="ignore"):
        table = np.where(d[..., 2] < 0.0, -o[2] / d[..., 2], 4.0).clip(max=4.0)
        a, b, c = (d[..., :2] ** 2).sum(-1), d[..., :2] @ o[:2], o[:2] @ o[:2] - radius**2
        side = (-b - np.sqrt(b * b - a * c)) / a
        side = np.where(np.abs(o[2] + side * d[..., 2] - height / 2) <= height / 2, side, np.inf)
        top = (height - o[2]) / d[..., 2]
        top = np.where(((o + top[..., None] * d)[..., :2] ** 2).sum(-1) <= radius**2, top, np.inf)
    z = np.fmin(np.fmin(side, top), table)
    z = z + MODEL.sensor_noise / 2.0 * z * z * np.random.default_rng(0).normal(size=z.shape)
    return z.astype(np.float32), k, T, np.array([0.0, 0.0, height / 2]), np.array([radius, radius, height / 2])


def test_a_can_is_told_from_its_own_volume_at_wrong_places():
    depth, k, T, center, half_axes = table_with_a_can()
    to_camera = (T[:3, 3] - center) / np.linalg.norm(T[:3, 3] - center)
    rng = np.random.default_rng(1)
    right = center + rng.normal(scale=0.008, size=(20, 3))
    nearer = center + rng.uniform(0.1, 0.3, (10, 1)) * to_camera
    aside = center + np.c_[rng.uniform(0.15, 0.4, 10) * rng.choice([-1, 1], 10), np.zeros(10), np.zeros(10)]
    above = center + np.c_[np.zeros(10), np.zeros(10), rng.uniform(0.2, 0.4, 10)]
    centers = np.concatenate([right, nearer, aside, above])
    seen = measure_visibility(depth, k, T, np.eye(3), centers, np.log(np.tile(half_axes, (len(centers), 1))))
    ratio = seen.depth_log_ratio[:, VolumePart.WHOLE]
    assert (seen.readings[:, VolumePart.WHOLE] > 100).all()
    assert ratio[:20].min() > 0.5
    assert ratio[20:].max() < -0.5

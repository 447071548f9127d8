"""Pyramids of features, and windows that match them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.config import PyramidConfig
from thingmap.detectors.hog.features import hog_cells
from thingmap.detectors.hog.pyramid import REFERENCE_FOCAL, build_pyramid, window_features

SHAPE = (131, 178)
FOCAL = 140.0


@pytest.fixture(scope="module")
def image() -> tuple[np.ndarray, np.ndarray]:
    """Smooth colours, and two depths with holes."""
    rng = np.random.default_rng(7)
    color = cv2.resize(rng.integers(0, 256, (26, 35, 3), dtype=np.uint8), SHAPE[::-1], interpolation=cv2.INTER_CUBIC)
    depth = np.full(SHAPE, 2.0, np.float32) + np.linspace(0, 1, SHAPE[1], dtype=np.float32)
    depth[30:90, 40:110] = 1.0
    depth[rng.random(SHAPE) < 0.1] = 0.0
    depth[60:80, 100:120] = np.nan
    return color, depth


@pytest.mark.parametrize("channels", list(Channels))
def test_a_window_has_what_the_pyramid_has_there(image, channels: Channels) -> None:
    color, depth = image
    config = PyramidConfig(levels_per_octave=3, max_scale=1.7, min_cells=4, border=3)
    pyramid = build_pyramid(color, depth, FOCAL, channels, config)
    assert pyramid.levels[0].scale > 1.0 > pyramid.levels[-1].scale
    for level in pyramid.levels:
        inside = level.features[3:-3, 3:-3]
        rows, columns = inside.shape[:2]
        for i, j, h, w in ((0, 0, rows, columns), (rows // 3, columns // 3, rows // 2, columns // 2)):
            xyxy = np.array([j, i, j + w, i + h]) * 8 / level.scale
            features, scale = window_features(color, depth, FOCAL, xyxy, (h, w), channels)
            assert scale == pytest.approx(level.scale)
            assert features.dtype == np.float32
            np.testing.assert_allclose(features, inside[i : i + h, j : j + w], atol=1e-4)


def test_a_level_is_hog_of_the_smaller_image(image) -> None:
    color, _ = image
    config = PyramidConfig(levels_per_octave=1, max_scale=1.0, min_cells=4, border=0)
    first, half, _ = build_pyramid(color, None, 0.0, Channels.RGB, config).levels
    np.testing.assert_allclose(first.features, hog_cells(color), atol=1e-5)
    means = color[:130].reshape(65, 2, 89, 2, 3).mean(axis=(1, 3))
    inside = slice(2, -2)  # at the edge what goes on is the image's last pixel, not the mean of the last two
    np.testing.assert_allclose(half.features[inside, inside], hog_cells(means)[inside, inside], atol=1e-5)


def test_channels_are_parts_of_the_whole(image) -> None:
    whole = build_pyramid(*image, FOCAL, Channels.RGBD)
    for channels in (Channels.RGB, Channels.DEPTH):
        part = build_pyramid(*image, FOCAL, channels)
        for a, b in zip(part.levels, whole.levels, strict=True):
            assert a.features.shape[2] == channels.count
            np.testing.assert_array_equal(a.features, b.features[..., channels.columns])


def test_the_border_is_zeros_and_the_image_is_not(image) -> None:
    for level in build_pyramid(*image, FOCAL, Channels.RGBD, PyramidConfig(border=2)).levels:
        inside = level.features[2:-2, 2:-2]
        assert np.count_nonzero(level.features) == np.count_nonzero(inside) > 0


def test_things_of_one_size_have_one_normalised_depth() -> None:
    color = np.zeros((*SHAPE, 3), np.uint8)
    near = np.full(SHAPE, 0.9, np.float32)  # in a window of 64 pixels
    expected = int(0.9 * REFERENCE_FOCAL / FOCAL / 0.3)
    for factor in (1.0, 1.5, 2.0):  # so much farther, in a window so much smaller
        window = np.array([8.0, 8.0, 8.0 + 64 / factor, 8.0 + 64 / factor])
        features, scale = window_features(color, near * factor, FOCAL, window, (8, 8), Channels.DEPTH)
        assert scale == pytest.approx(factor)
        np.testing.assert_allclose(features[..., 31 + expected], 1.0, atol=1e-5)
    _, other_camera = (window_features(color, near, f, window, (8, 8), Channels.DEPTH)[0] for f in (FOCAL, 2 * FOCAL))
    assert np.argmax(other_camera[0, 0, 31:]) < expected


def test_scales_end_where_the_image_becomes_too_small() -> None:
    config = PyramidConfig(levels_per_octave=2, max_scale=2.0, min_scale=0.1, min_cells=4)
    scales = config.scales(640, 480)
    np.testing.assert_allclose(scales[:4], [2.0, 2**0.5, 1.0, 0.5**0.5])
    assert scales[-1] >= 0.1 > scales[-1] / 2**0.5
    assert config.scales(640, 64)[-1] == pytest.approx(0.5)
    assert config.scales(5, 5) == (2.0,)  # one cell
    assert config.scales(3, 640) == ()


@pytest.mark.parametrize("shape", [(1, 1), (4, 300), (6, 6), (20, 9)])
def test_tiny_images(shape: tuple[int, int]) -> None:
    color, depth = np.full((*shape, 3), 90, np.uint8), np.ones(shape, np.float32)
    config = PyramidConfig(max_scale=2**0.5)
    pyramid = build_pyramid(color, depth, FOCAL, Channels.RGBD, config)
    assert (pyramid.width, pyramid.height) == shape[::-1]
    assert len(pyramid.levels) == (1 if min(shape) >= 6 else 0)
    features, _ = window_features(color, depth, FOCAL, np.array([-3.0, -3.0, 29.0, 29.0]), (4, 4), Channels.RGBD)
    assert np.isfinite(features).all()


def test_depth_of_nothing_but_holes(image) -> None:
    color, _ = image
    for nothing in (0.0, np.nan):
        pyramid = build_pyramid(color, np.full(SHAPE, nothing, np.float32), FOCAL, Channels.RGBD)
        for level in pyramid.levels:
            assert not level.features[..., 31:].any()
            assert level.features[..., :31].any()


def test_absurd_depths_do_no_harm(image) -> None:
    color, depth = image
    absurd = depth.copy()
    absurd[::7] = 1e-42
    absurd[::11] = 1e35
    for level in build_pyramid(color, absurd, FOCAL, Channels.RGBD).levels:
        assert np.isfinite(level.features).all()


def test_a_window_beyond_the_edge_sees_the_edge_go_on(image) -> None:
    color, depth = image
    padded = np.pad(color, ((32, 32), (32, 32), (0, 0)), mode="edge")
    padded_depth = np.pad(depth, 32, mode="edge")
    window = np.array([-16.0, 90.0, 48.0, 154.0])
    over, _ = window_features(color, depth, FOCAL, window, (8, 8), Channels.RGB)
    inside, _ = window_features(padded, padded_depth, FOCAL, window + 32.0, (8, 8), Channels.RGB)
    np.testing.assert_allclose(over, inside, atol=1e-5)


def test_what_cannot_be_done_is_said(image) -> None:
    color, depth = image
    for bad in (None, depth[:-1]):
        with pytest.raises(ValueError, match="depth"):
            build_pyramid(color, bad, FOCAL, Channels.RGBD)
    with pytest.raises(ValueError, match="focal"):
        build_pyramid(color, depth, 0.0, Channels.DEPTH)
    with pytest.raises(ValueError, match="area"):
        window_features(color, depth, FOCAL, np.array([5.0, 5.0, 5.0, 9.0]), (4, 4), Channels.RGB)
    wrong_numbers = {"levels_per_octave": (0, 33), "max_scale": (2.5,), "min_scale": (0.0,), "min_cells": (0,)}
    for name, values in (wrong_numbers | {"border": (-1,)}).items():
        for value in values:
            with pytest.raises(ValueError):
                PyramidConfig(**{name: value})

"""Cells of oriented gradients against a slow reference, and depth histograms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.hog.features import BIN, depth_histograms, hog_cells

ANGLES = np.arange(18) * np.pi / 9  # of the orientations


def slow_hog(image: np.ndarray, noise_floor: float) -> np.ndarray:
    """Felzenszwalb's 31 features pixel by pixel and cell by cell, of an image of which the edge goes on."""
    image = np.atleast_3d(image).astype(np.float64)
    rows, columns = image.shape[0] // 8, image.shape[1] // 8
    height, width = image.shape[:2]

    def pixel(y: int, x: int) -> np.ndarray:
        return image[min(max(y, 0), height - 1), min(max(x, 0), width - 1)]

    votes = np.zeros((rows + 2, columns + 2, 18))  # one more on every side; cell (1, 1) is the image's first
    for y in range(-12, rows * 8 + 12):
        for x in range(-12, columns * 8 + 12):
            dx, dy = pixel(y, x + 1) - pixel(y, x - 1), pixel(y + 1, x) - pixel(y - 1, x)
            size = np.hypot(dx, dy)
            strongest = int(np.argmax(size))
            along = np.cos(ANGLES) * dx[strongest] + np.sin(ANGLES) * dy[strongest]
            orientation = int(np.argmax(np.round(along, 9)))  # the first of two as near: a level edge's are 80 and 100
            v, u = (y + 0.5) / 8 + 0.5, (x + 0.5) / 8 + 0.5  # in cells, whole numbers at their middles
            for j in (int(np.floor(v)), int(np.floor(v)) + 1):
                for i in (int(np.floor(u)), int(np.floor(u)) + 1):
                    if 0 <= j < rows + 2 and 0 <= i < columns + 2:
                        votes[j, i, orientation] += (1 - abs(v - j)) * (1 - abs(u - i)) * size[strongest]
    unsigned = votes[..., :9] + votes[..., 9:]
    energy = (unsigned**2).sum(axis=-1)
    floor = 4 * 9 * (64 * noise_floor / 9) ** 2  # four cells of 64 such pixels each, spread over nine orientations
    out = np.zeros((rows, columns, 31))
    for j in range(rows):
        for i in range(columns):
            both = np.concatenate([votes[j + 1, i + 1], unsigned[j + 1, i + 1]])  # 27
            blocks = []
            for top in (j, j + 1):
                for left in (i, i + 1):
                    total = energy[top : top + 2, left : left + 2].sum() + floor
                    blocks.append(np.minimum(both / np.sqrt(total), 0.2))
            all_108 = np.array(blocks)
            out[j, i, :27] = all_108.sum(axis=0) / 2
            out[j, i, 27:] = all_108[:, :18].sum(axis=1) * 0.2357
    return out


@pytest.mark.parametrize("shape", [(24, 32), (24, 40, 3), (29, 23, 3), (8, 8), (15, 17, 2)])
@pytest.mark.parametrize("noise_floor", [0.01, 3.0, 20.0])
def test_hog_is_that_of_the_paper(shape: tuple[int, ...], noise_floor: float) -> None:
    rng = np.random.default_rng(1)
    image = rng.uniform(0, 255, shape).astype(np.float32)
    image[4:12, 5:] *= 0.2  # an edge as well
    found = hog_cells(image, noise_floor)
    assert found.dtype == np.float32 and found.shape == (shape[0] // 8, shape[1] // 8, 31)
    np.testing.assert_allclose(found, slow_hog(image, noise_floor), atol=2e-5)


def test_bytes_are_as_good_as_floats() -> None:
    image = np.random.default_rng(2).integers(0, 256, (40, 48, 3), dtype=np.uint8)
    np.testing.assert_array_equal(hog_cells(image), hog_cells(image.astype(np.float32)))


def test_light_does_not_matter() -> None:
    image = np.random.default_rng(3).uniform(0, 80, (32, 32)).astype(np.float32)
    np.testing.assert_allclose(hog_cells(2.5 * image + 30.0, 2.5), hog_cells(image, 1.0), atol=1e-5)


@pytest.mark.parametrize("degrees", range(0, 360, 20))
def test_an_edge_votes_for_its_direction(degrees: int) -> None:
    y, x = np.mgrid[:24, :24]
    ramp = 5.0 * (np.cos(np.radians(degrees)) * x + np.sin(np.radians(degrees)) * y)
    cell = hog_cells(ramp.astype(np.float32))[1, 1]
    assert np.argmax(cell[:18]) == degrees // 20
    assert np.argmax(cell[18:27]) == degrees // 20 % 9
    assert cell[:18].sum() == pytest.approx(cell[degrees // 20], rel=1e-3)


def test_noise_on_an_even_surface_stays_small() -> None:
    noise = np.random.default_rng(4).normal(100.0, 0.5, (64, 64)).astype(np.float32)  # grey levels
    as_texture = hog_cells(noise, 1e-3)  # divided by its own energy alone
    assert as_texture.max() > 0.39
    assert hog_cells(noise).mean() < 0.35 * as_texture.mean()
    edge = noise.copy()
    edge[:, 30:] += 60.0
    assert hog_cells(edge)[:, 3].max() > 0.35
    assert not hog_cells(np.full((16, 16), 7.0), 0.0).any()


@pytest.mark.parametrize("shape", [(7, 50), (50, 7), (1, 1)])
def test_an_image_without_a_whole_cell_has_none(shape: tuple[int, int]) -> None:
    expected = shape[0] // 8, shape[1] // 8
    assert hog_cells(np.ones(shape, np.uint8)).shape == (*expected, 31)
    assert depth_histograms(np.ones(shape, np.float32)).shape == (*expected, 20)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.floats(0.1, 9.0))
@settings(max_examples=40, deadline=None)
def test_depth_histograms_count_readings(seed: int, missing: float, farthest: float) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.0, farthest, (21, 30)).astype(np.float32)
    depth[rng.random(depth.shape) < missing] = rng.choice([0.0, np.nan, np.inf, -1.0])
    found = depth_histograms(depth)
    for j in range(2):
        for i in range(3):
            cell = depth[8 * j : 8 * j + 8, 8 * i : 8 * i + 8]
            cell = cell[np.isfinite(cell) & (cell > 0)]
            bins = np.minimum((cell * np.float32(1 / BIN)).astype(int), 19)
            np.testing.assert_allclose(found[j, i], np.bincount(bins, minlength=20) / 64, atol=1e-6)


def test_the_last_bin_takes_all_beyond() -> None:
    cell = depth_histograms(np.full((8, 8), 1e9, np.float32))[0, 0]
    assert cell[19] == pytest.approx(1.0) and not cell[:19].any()

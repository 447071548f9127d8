"""Scores of windows against a plain sum over their cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.hog.pyramid import Level, Pyramid
from thingmap.detectors.hog.scoring import Scorer, part_boxes


@dataclass(frozen=True, eq=False)
class Template:
    """What scoring looks at of a template."""

    weights: np.ndarray
    scale_weight: float = 0.0
    bias: float = 0.0
    box: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


def random_pyramid(rng: np.random.Generator, sizes, channels: int) -> Pyramid:
    features = [rng.normal(size=(*size, channels)).astype(np.float32) for size in sizes]
    return Pyramid(tuple(Level(1.3 * 0.8**k, f, 1) for k, f in enumerate(features)), 640, 480)


def slow_scores(template: Template, level: Level) -> np.ndarray:
    height, width = level.features.shape[:2]
    rows, columns = template.weights.shape[:2]
    out = np.full((height, width), -np.inf)
    for i in range(height - rows + 1):
        for j in range(width - columns + 1):
            window = level.features[i : i + rows, j : j + columns].astype(np.float64)
            out[i, j] = (window * template.weights).sum()
    return out + template.scale_weight * np.log2(level.scale) + template.bias


@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.tuples(st.integers(1, 9), st.integers(1, 9)), min_size=1, max_size=7),
    st.lists(st.tuples(st.integers(1, 23), st.integers(1, 31)), max_size=3),
    st.sampled_from([1, 31, 82]),
)
@settings(max_examples=40, deadline=None)
def test_scores_are_sums_over_cells(seed: int, shapes, sizes, channels: int) -> None:
    rng = np.random.default_rng(seed)
    templates = [Template(rng.normal(size=(*s, channels)).astype(np.float32), *rng.normal(size=2)) for s in shapes]
    pyramid = random_pyramid(rng, sizes, channels)
    found = Scorer(templates).scores(pyramid)
    assert len(found) == len(pyramid.levels)
    for level, scores in zip(pyramid.levels, found, strict=True):
        assert scores.dtype == np.float32 and scores.shape == (len(templates), *level.features.shape[:2])
        for template, score in zip(templates, scores, strict=True):
            expected = slow_scores(template, level)
            np.testing.assert_array_equal(np.isneginf(score), np.isneginf(expected))
            fits = np.isfinite(expected)
            np.testing.assert_allclose(score[fits], expected[fits], atol=2e-3)


def test_many_templates_of_many_sizes() -> None:
    rng = np.random.default_rng(8)
    shapes = [(8, 8), (4, 8), (8, 4), (5, 11), (10, 3)] * 6
    templates = [Template(rng.normal(size=(*s, 51)).astype(np.float32)) for s in shapes]
    pyramid = random_pyramid(rng, [(33, 41)], 51)
    (found,) = Scorer(templates).scores(pyramid)
    for t in (0, 3, 13, 29):
        expected = slow_scores(templates[t], pyramid.levels[0])
        fits = np.isfinite(expected)
        np.testing.assert_allclose(found[t][fits], expected[fits], atol=2e-3)


def test_a_template_is_found_where_it_was_put() -> None:
    rng = np.random.default_rng(9)
    pattern = rng.normal(size=(6, 4, 31)).astype(np.float32)
    features = np.zeros((20, 30, 31), np.float32)
    features[7:13, 21:25] = pattern
    pyramid = Pyramid((Level(0.5, features, 2),), 416, 256)
    template = Template(pattern, box=(0.25, 0.0, 0.75, 0.5))
    (scores,) = Scorer([template]).scores(pyramid)
    best = np.unravel_index(np.argmax(scores[0]), scores[0].shape)
    assert best == (7, 21)
    box = part_boxes(template, pyramid.levels[0], np.array([best, (2, 2)]))
    # the first cell of the image is (2, 2), and a cell is 16 pixels
    np.testing.assert_allclose(box, [[320, 80, 352, 128], [16, 0, 48, 48]])
    assert part_boxes(template, pyramid.levels[0], np.zeros((0, 2))).shape == (0, 4)


def test_a_template_larger_than_every_level_fits_nowhere() -> None:
    rng = np.random.default_rng(10)
    templates = [Template(np.ones((9, 3, 31), np.float32)), Template(np.ones((2, 2, 31), np.float32))]
    large, small = Scorer(templates).scores(random_pyramid(rng, [(8, 8)], 31))[0]
    assert np.isneginf(large).all()
    assert np.isfinite(small[:7, :7]).all()
    assert Scorer(templates).scores(Pyramid((), 3, 3)) == ()


def test_what_cannot_be_scored_is_said() -> None:
    with pytest.raises(ValueError, match="templates"):
        Scorer([])
    with pytest.raises(ValueError, match="one C"):
        Scorer([Template(np.ones((2, 2, 31))), Template(np.ones((2, 2, 82)))])
    with pytest.raises(ValueError, match="31 channels, but got 82"):
        Scorer([Template(np.ones((2, 2, 31)))]).scores(random_pyramid(np.random.default_rng(0), [(4, 4)], 82))

from dataclasses import replace

import numpy as np

from thingmap.detectors.hog.training.positives import examples_of, jittered, mirrored, window_scale
from thingmap.detectors.hog.training.windows import window_shape


def test_mirrored_twice_is_the_same(make_views):
    view = next(iter(make_views(1)))
    once, twice = mirrored(view), mirrored(mirrored(view))
    np.testing.assert_array_equal(twice.color, view.color)
    np.testing.assert_array_equal(twice.depth, view.depth)
    np.testing.assert_allclose(twice.xyxy, view.xyxy)
    x0, y0, x1, y1 = once.xyxy.astype(int)
    u0, v0, u1, v1 = view.xyxy.astype(int)
    np.testing.assert_array_equal(once.color[y0:y1, x0:x1], view.color[v0:v1, u0:u1][:, ::-1])


def test_a_mirrored_example_has_left_and_right_exchanged(make_views, small):
    view = next(iter(make_views(1)))
    half = view.color.copy()
    x0, _, x1, _ = view.xyxy.astype(int)
    half[:, : (x0 + x1) // 2] = half[:, : (x0 + x1) // 2].mean(axis=(0, 1))  # nothing to see left of the middle
    config = replace(small, shift=0.0, zoom=0.0)
    shape = window_shape(view.xyxy[None], 16, 0.1, 0.9)
    plain, swapped = examples_of(replace(view, color=half), shape, config, np.random.default_rng(0))
    energy = [np.square(one.features[0, ..., :27]).sum(axis=(0, 2)) for one in (plain, swapped)]
    assert energy[0][: shape.columns // 2].sum() < 0.7 * energy[0][shape.columns // 2 :].sum()
    np.testing.assert_allclose(energy[0], energy[1][::-1], rtol=0.05, atol=0.05)


def test_jitter_stays_within_its_limits(small):
    window = np.array([10.0, 20.0, 50.0, 100.0])
    rng = np.random.default_rng(0)
    many = np.array([jittered(window, small, rng) for _ in range(500)])
    center = (0.5 * (many[:, :2] + many[:, 2:]) - [30.0, 60.0]) / [40.0, 80.0]
    zoom = np.log2((many[:, 2] - many[:, 0]) / 40.0)
    assert 0.9 * small.shift < np.abs(center).max() <= small.shift
    assert 0.9 * small.zoom < np.abs(zoom).max() <= small.zoom + 1e-9


def test_an_object_too_small_for_the_pyramid_is_no_example(make_views, small):
    view = next(iter(make_views(1)))
    shape = window_shape(view.xyxy[None], 16, 0.1, 0.9)
    rng = np.random.default_rng(0)
    tiny = replace(view, xyxy=view.xyxy[[0, 1, 0, 1]] + [0, 0, 6, 6])
    assert window_scale(shape.around(tiny.xyxy), shape) > small.pyramid.max_scale
    assert examples_of(tiny, shape, small, rng) == []
    assert len(examples_of(view, shape, small, rng)) == 2

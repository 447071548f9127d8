"""Samples and sliding volumes: where objects may be, before anything is refined."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.detectors.detections import Part
from thingmap.factors.solid import project_solids
from thingmap.mapper.batch.sliding import grid_centres, occupied_points, slide_volumes
from thingmap.mapper.proposals.sampling import box_depths, class_shares, sample_volumes
from thingmap.mapper.proposals.views import StoredView, spread_views

MUG, BOWL, BOX = 0, 1, 2
GATE = 16.27


@pytest.fixture(scope="module")
def table(tools):
    half = np.exp(tools.priors.mean[1:])
    volumes = ((0.0, -0.15, 0.0), half[MUG], MUG), ((0.0, 0.2, 0.0), half[BOX], BOX)
    return tools.Table(tools.around(3), *volumes).detect_all()


def draw(table, tools, confidence, count: int = 400, seed: int = 0):
    views = table.packed()
    found = [d for view in table.detections for d in view]
    depths = [box_depths(table.depth(v), d.whole_xyxy, d.xyxy, 0.5) for v, d in zip(views.view, found, strict=True)]
    shares = class_shares(np.array([d.scores for d in found]).reshape(-1, len(tools.classes)))
    rng = np.random.default_rng(seed)
    return sample_volumes(views, depths, shares, np.asarray(confidence, float), tools.priors, count, 0.7, rng)


def test_samples_come_near_the_objects_in_proportion_to_confidence(table, tools):
    samples = draw(table, tools, [3.0, 1.0] * 3, count=1200)
    to_mug = np.linalg.norm(samples.position - [0.0, -0.15, 0.0], axis=1)
    to_box = np.linalg.norm(samples.position - [0.0, 0.2, 0.0], axis=1)
    assert np.mean(to_mug < to_box) == pytest.approx(0.75, abs=0.04)
    assert np.median(np.minimum(to_mug, to_box)) < 0.05
    share = np.mean(samples.class_id[to_mug < to_box] == MUG)
    assert share == pytest.approx(0.7 / 0.74, abs=0.03)


def test_the_centre_lies_on_the_ray_behind_a_surface_that_was_read(table, tools):
    samples = draw(table, tools, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], count=50)
    T, mug = table.cameras[0], table.detections[0][0]
    local = (samples.position - T[:3, 3]) @ T[:3, :3]
    np.testing.assert_allclose(tools.kinect.project(local), np.tile((mug.xyxy[:2] + mug.xyxy[2:]) / 2.0, (50, 1)))
    readings = box_depths(table.depth(0), mug.whole_xyxy, mug.xyxy, 0.5)
    assert local[:, 2].min() > readings.min() and local[:, 2].max() < readings.max() + 0.2


def test_sizes_agree_better_with_the_box_than_the_prior_alone(tools):
    """A mug that is larger than most."""
    large = (0.0, 0.0, 0.0), 1.4 * np.exp(tools.priors.mean[MUG + 1]), MUG
    table = tools.Table(tools.around(1), large).detect_all()
    samples = draw(table, tools, np.ones(1), count=400)
    mugs = samples.class_id == MUG
    rng = np.random.default_rng(1)
    prior = rng.multivariate_normal(tools.priors.mean[MUG + 1], tools.priors.covariance[MUG + 1], int(mugs.sum()))
    box = table.detections[0][0].xyxy

    def misfit(log_size: np.ndarray) -> float:
        got, _ = project_solids(table.cameras[0], tools.upright, samples.position[mugs], log_size, tools.kinect)
        return float(np.mean(np.abs(np.log((got[:, 2:] - got[:, :2]) / (box[2:] - box[:2])))))

    assert misfit(samples.log_size[mugs]) < 0.8 * misfit(prior)


def test_the_same_seed_draws_the_same(table, tools):
    one, same, other = (draw(table, tools, np.ones(6), 30, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.position, same.position)
    assert not np.array_equal(one.position, other.position)


def test_nothing_to_draw_from(table, tools):
    assert len(draw(table, tools, np.zeros(6))) == 0
    assert len(draw(tools.Table(tools.around(2)), tools, np.empty(0))) == 0


def test_the_depth_of_an_implied_half_is_not_read():
    depth = np.full((100, 100), 1.0, np.float32)
    depth[:, 50:] = 0.5  # an occluder before the right half
    left = np.array([30.0, 30.0, 50.0, 70.0])
    assert box_depths(depth, np.array([30.0, 30.0, 70.0, 70.0]), left, 0.5).max() == 1.0
    assert box_depths(depth, np.array([30.0, 30.0, 70.0, 70.0]), left, 0.5).min() == 1.0
    assert len(box_depths(0.0 * depth, left, left, 0.5)) == 0


# -- sliding volumes


def slide(table, tools, spacing: float = 0.5):
    views = [table.depth(t) for t in range(len(table.cameras))]
    points = occupied_points(views, table.cameras, tools.kinect)
    scores = np.array([d.scores for view in table.detections for d in view]).reshape(-1, len(tools.classes))
    return slide_volumes(table.packed(), points, scores, tools.priors, spacing, GATE)


def test_sliding_volumes_reach_every_detected_object(table, tools):
    volumes = slide(table, tools)
    for centre, log_size, k in table.volumes:
        mine = volumes.position[volumes.class_id == k]
        spacing = np.exp(log_size)  # half of the size
        assert (np.abs(mine - centre) <= spacing).all(axis=1).any()
    assert BOWL not in volumes.class_id  # nothing looks like one
    np.testing.assert_array_equal(volumes.log_size, tools.priors.mean[volumes.class_id + 1])


def test_no_detection_no_sliding_volume(tools):
    seen = tools.Table(tools.around(2), ((0.0, 0.0, 0.0), (0.05, 0.05, 0.05), MUG))
    assert len(slide(seen, tools)) == 0


def test_a_finer_grid_has_more_volumes(table, tools):
    assert len(slide(table, tools, 0.25)) > 3 * len(slide(table, tools, 0.5)) > 0


def test_the_grid_lies_behind_the_surface(tools):
    points = np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])  # seen along x
    centres = grid_centres(points, np.array([0.1, 0.2, 0.3]), tools.upright, 0.5)
    assert centres.shape == (1, 3) and abs(centres[0, 0] - 1.1) <= 0.05 + 1e-9


# -- views


def test_views_are_spread_evenly():
    assert spread_views(3, 11) == {0, 5, 10}
    assert spread_views(99, 4) == {0, 1, 2, 3}
    assert spread_views(1, 10) == {0}
    assert len(spread_views(12, 37)) == 12


def test_a_stored_view_keeps_depth_to_a_millimetre(table):
    view = table.views()[0]
    depth = table.depth(0)
    kept = depth < 65.535  # the most that 16 bits hold; beyond it there is no reading
    np.testing.assert_allclose(view.frame.depth[kept], depth[kept], atol=5.1e-4)
    assert kept.mean() > 0.9 and (view.frame.depth[~kept] == 0.0).all()
    odd = view.frame.depth.copy()
    odd[0, :3] = np.nan, np.inf, 70.0
    stored = StoredView.of(type(view.frame)(0, "a", 0.0, view.frame.color, odd, view.frame.intrinsics), 0, [])
    assert (stored.depth_mm[0, :3] == 0).all() and stored.depth_mm.dtype == np.uint16


def test_packing_orders_detections_by_view(table, tools):
    views = table.packed()
    np.testing.assert_array_equal(views.first, [0, 2, 4, 6])
    np.testing.assert_array_equal(views.view, [0, 0, 1, 1, 2, 2])
    np.testing.assert_allclose(views.centre[::2], np.tile([0.0, -0.15, 0.0], (3, 1)), atol=1e-12)
    np.testing.assert_array_equal(views.templates, [True, False, False, False, False])
    half = tools.Table(table.cameras, *[(c, np.exp(s), k) for c, s, k in table.volumes])
    half.detect(0, 0, Part.LEFT)
    np.testing.assert_array_equal(half.packed().templates, [True, False, False, True, False])

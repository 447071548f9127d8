"""The costs of pairs against plain formulas, pair by pair."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.boxes import box_ious
from thingmap.mapper.config import AssociationConfig
from thingmap.mapper.estimation.association_costs import (
    DetectionArrays,
    alignment_costs,
    box_sides,
    position_costs,
    shares_inside,
)
from thingmap.mapper.estimation.lifting import LiftedDetection

CONFIG = AssociationConfig()
NOWHERE = np.full((1, 4), np.nan)


def gaussians(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    roots = rng.normal(size=(count, 3, 3)) * 10.0 ** rng.uniform(-2.5, 0.0, (count, 1, 3))
    return rng.normal(size=(count, 3)), roots @ roots.transpose(0, 2, 1) + 1e-4 * np.eye(3)


@settings(deadline=None, derandomize=True, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_position_costs_are_mahalanobis_distances(seed):
    rng = np.random.default_rng(seed)
    (a, A), (b, B) = gaussians(rng, 3), gaussians(rng, 4)
    costs = position_costs(a, A, b, B)
    assert costs.shape == (3, 4)
    for n in range(3):
        for m in range(4):
            d = a[n] - b[m]
            assert costs[n, m] == pytest.approx(d @ np.linalg.solve(A[n] + B[m], d), rel=1e-6)


def test_a_place_without_extent_or_number_is_never_near():
    flat, good = np.diag([1.0, 1.0, 0.0])[None] / 2.0, np.eye(3)[None]
    here, lost = np.zeros((1, 3)), np.full((1, 3), np.nan)
    assert position_costs(here, flat, here, flat)[0, 0] == np.inf
    assert position_costs(here, good, here, good)[0, 0] == 0.0
    assert not position_costs(lost, good, here, good)[0, 0] < 1e300
    assert position_costs(here, np.full((1, 3, 3), np.nan), here, good)[0, 0] == np.inf
    assert position_costs(here[:0], good[:0], here, good).shape == (0, 1)


def test_alignment_errors_are_taken_over_the_scale_of_the_detection():
    detected = np.array([[100.0, 100.0, 140.0, 190.0]])  # 40 by 90: scale 60
    predicted = np.array([[112.0, 100.0, 152.0, 190.0], [100.0, 106.0, 140.0, 196.0], [110.0, 122.5, 130.0, 167.5]])
    costs = alignment_costs(detected, predicted, CONFIG)[0]
    assert costs[0] == pytest.approx((12.0 / 60.0) ** 2 / CONFIG.centre_variance)
    assert costs[1] == pytest.approx((6.0 / 60.0) ** 2 / CONFIG.centre_variance)
    assert costs[2] == pytest.approx(np.log(2.0) ** 2 / CONFIG.scale_variance)
    assert not np.isfinite(alignment_costs(detected, NOWHERE, CONFIG)).any()


def test_sides_shares_and_overlaps():
    boxes = np.array([[0.0, 0.0, 10.0, 10.0], [5.0, 0.0, 15.0, 10.0], [20.0, 0.0, 30.0, 40.0], [2.0, 2.0, 4.0, 12.0]])
    np.testing.assert_allclose(box_sides(boxes), [10.0, 10.0, 20.0, np.sqrt(20.0)])
    np.testing.assert_allclose(shares_inside(boxes, boxes[:2])[:, 0], [1.0, 0.5, 0.0, 0.8])
    overlaps = box_ious(boxes, boxes)
    np.testing.assert_allclose(overlaps, overlaps.T)
    np.testing.assert_allclose(np.diag(overlaps), 1.0)
    assert overlaps[0, 1] == pytest.approx(50.0 / 150.0) and overlaps[0, 2] == 0.0
    assert overlaps[0, 3] == pytest.approx(16.0 / 104.0)


def test_what_is_not_in_view_has_no_size_and_holds_nothing():
    assert box_sides(NOWHERE).tolist() == [0.0]
    assert shares_inside(np.array([[0.0, 0.0, 1.0, 1.0]]), NOWHERE).tolist() == [[0.0]]
    assert box_sides(np.array([[3.0, 3.0, 1.0, 5.0]])).tolist() == [0.0]


def test_columns_of_detections_are_in_world():
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    T[:3, 3] = [1.0, -2.0, 0.5]
    box, centre = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.0, 0.0, 2.0])
    scores, half = np.array([0.1, 0.7]), np.array([0.1, 0.2, 0.3])
    found = LiftedDetection(scores, box, np.ones(4, bool), 2.0, centre, 0.1, 0.3, half, 2, box + 1.0)
    columns = DetectionArrays.of([found, found], T)
    np.testing.assert_allclose(columns.positions, [[3.0, -2.0, 0.5]] * 2)
    np.testing.assert_allclose(columns.covariances[1], np.diag([0.09, 0.01, 0.01]), atol=1e-12)
    assert columns.part.tolist() == [2, 2] and columns.confidence.tolist() == [0.7, 0.7]
    assert columns.ranges.tolist() == [2.0, 2.0] and columns.sigma_range.tolist() == [0.3, 0.3]
    assert columns.half_widths.tolist() == [0.1, 0.1]
    np.testing.assert_array_equal(columns.whole_xyxy[0], box + 1.0)
    assert DetectionArrays.of([], T).covariances.shape == (0, 3, 3)

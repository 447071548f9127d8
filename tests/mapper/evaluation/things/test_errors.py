from dataclasses import replace

import numpy as np
import pytest

from thingmap.mapper.evaluation.things.errors import extents_along, in_sorted_order, measure_errors
from thingmap.mapper.evaluation.uncertainty.claims import size_claims


@pytest.fixture
def case(scene_truth, perfect_run, make_case):
    return make_case(perfect_run(scene_truth), scene_truth)


def resized(placed, size, size_std=(0.01, 0.02, 0.03), turned=0.0):
    return replace(placed, thing=replace(placed.thing, size=size, size_std=size_std), yaw=placed.yaw + turned)


def test_what_belongs_to_an_extent_goes_with_it():
    np.testing.assert_array_equal(in_sorted_order(np.array([1, 2, 3]), np.array([0.1, 0.2, 0.9])), [2, 1, 3])
    np.testing.assert_array_equal(in_sorted_order(np.array([1, 2, 3]), np.array([0.2, 0.1, 0.0])), [1, 2, 3])
    np.testing.assert_array_equal(in_sorted_order(np.array([1, 2, 3]), np.array([0.1, 0.1, 0.0])), [1, 2, 3])


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [(0.0, (2.0, 1.0)), (90.0, (1.0, 2.0)), (-180.0, (2.0, 1.0)), (45.0, (3.0 / np.sqrt(2), 3.0 / np.sqrt(2)))],
)
def test_extents_of_a_turned_box(degrees, expected):
    np.testing.assert_allclose(extents_along(np.array([2.0, 1.0, 0.5]), np.radians(degrees)), [*expected, 0.5])


def test_a_box_named_by_its_other_axes_has_no_error(case):
    long = case.truth.objects[2]
    other = resized(case.things[2], long.size[[1, 0, 2]], turned=np.pi / 2)
    errors = measure_errors(case, [(other, long)])
    np.testing.assert_allclose(errors.size, 0.0, atol=1e-12)
    np.testing.assert_allclose(errors.log_size, 0.0, atol=1e-9)
    np.testing.assert_allclose(errors.log_own_size, 0.0, atol=1e-9)
    assert errors.iou[0] == pytest.approx(1.0)


def test_a_quarter_turn_is_right_when_sorted_and_wrong_in_the_truths_axes(case):
    long = case.truth.objects[2]  # 0.19 x 0.06 x 0.26
    errors = measure_errors(case, [(resized(case.things[2], long.size, turned=np.pi / 2), long)])
    np.testing.assert_allclose(errors.log_size, 0.0, atol=1e-12)
    ratio = np.log(0.06 / 0.19)
    np.testing.assert_allclose(errors.log_own_size, [[ratio, -ratio, 0.0]], atol=1e-9)
    assert errors.iou[0] == pytest.approx(0.06 / (2 * 0.19 - 0.06))


def test_errors_have_signs_and_units(case):
    long = case.truth.objects[2]
    thing = resized(case.things[2], [0.06 / 2, 0.19, 0.26 * 3])
    thing = replace(thing, position=thing.position + [0.03, -0.04, 0.0])  # noqa: RUF005
    errors = measure_errors(case, [(thing, long)])
    np.testing.assert_allclose(errors.centre, [[0.03, -0.04, 0.0]], atol=1e-12)
    assert errors.distance[0] == pytest.approx(0.05)
    np.testing.assert_allclose(errors.size, [[0.0, -0.03, 0.52]], atol=1e-12)
    np.testing.assert_allclose(errors.log_size, [[0.0, np.log(0.5), np.log(3.0)]], atol=1e-12)


def test_deviations_of_sizes_go_with_the_sides_that_they_belong_to(case):
    long = case.truth.objects[2]
    errors, covariances = size_claims([(resized(case.things[2], [0.07, 0.21, 0.26]), long)])
    np.testing.assert_allclose(errors, [[0.02, 0.01, 0.0]], atol=1e-12)
    np.testing.assert_allclose(covariances[0], np.diag([0.02, 0.01, 0.03]) ** 2)


def test_what_is_unknown_is_nan_and_what_has_no_extent_is_infinite(case):
    unknown = replace(case.truth.objects[0], size=np.full(3, np.nan))
    errors = measure_errors(case, [(case.things[0], unknown)])
    assert np.isnan(errors.log_size).all() and np.isnan(errors.iou).all() and np.isfinite(errors.centre).all()
    assert len(size_claims([(case.things[0], unknown)])[0]) == 0
    flat = measure_errors(case, [(resized(case.things[0], [0.1, 0.1, 0.0]), case.truth.objects[0])])
    assert flat.log_size[0, 2] == -np.inf and flat.iou[0] == 0.0
    assert measure_errors(case, []).log_size.shape == (0, 3)

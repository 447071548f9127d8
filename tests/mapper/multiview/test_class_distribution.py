import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.mapper.multiview.class_distribution import bayes_update, class_distribution


def test_the_background_has_what_the_scores_leave():
    found = class_distribution(np.array([[0.6, 0.1], [0.0, 0.0]]), 1e-6)
    np.testing.assert_allclose(found, [[0.6, 0.1, 0.3], [0.0, 0.0, 1.0]], atol=1e-5)


def test_independent_scores_are_divided_by_their_sum_and_leave_nothing():
    found = class_distribution(np.array([[0.9, 0.6]]), 1e-6)
    np.testing.assert_allclose(found, [[0.6, 0.4, 0.0]], atol=1e-5)


def test_what_a_detector_does_not_say_is_no_score():
    found = class_distribution(np.array([[np.nan, 0.7]]), 1e-6)
    np.testing.assert_allclose(found, [[0.0, 0.7, 0.3]], atol=1e-5)


def test_nothing_is_ever_impossible():
    found = class_distribution(np.array([[1.0, 0.0]]), 1e-3)
    np.testing.assert_allclose(found, np.array([[1.0, 1e-3, 1e-3]]) / 1.002)


def test_no_detection_has_no_rows():
    assert class_distribution(np.empty((0, 3)), 1e-3).shape == (0, 4)


def test_bayes_rule_is_equation_2_by_hand():
    prior, view = np.array([1.0, 1.0, 1.0]) / 3.0, np.array([0.6, 0.1, 0.3])
    after = np.exp(bayes_update(np.log(prior), np.log(view)))
    np.testing.assert_allclose(after, view)  # uniform start
    after = np.exp(bayes_update(np.log(after), np.log([0.2, 0.2, 0.6])))
    np.testing.assert_allclose(after, np.array([0.12, 0.02, 0.18]) / 0.32)


@given(st.lists(st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3), min_size=1, max_size=6))
def test_the_order_of_views_does_not_matter(scores):
    views = np.log(class_distribution(np.array(scores), 1e-3))
    assert np.exp(views).sum(axis=1) == pytest.approx(1.0)

    def all_of(rows):
        after = np.full(4, -np.log(4.0))
        for row in rows:
            after = bayes_update(after, row)
        return after

    np.testing.assert_allclose(all_of(views), all_of(views[::-1]), atol=1e-9)
    assert np.exp(all_of(views)).sum() == pytest.approx(1.0)

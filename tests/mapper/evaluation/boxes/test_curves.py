"""Curves by hand, and what must hold for any ranking."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.mapper.evaluation.boxes.curves import (
    MOST_POINTS,
    Scored,
    at_threshold,
    average_precision,
    best_threshold,
    precision_recall,
    recall_at,
    recall_per_false_positives,
    thinned,
)


def ranked(outcomes: str, objects: int, images: int = 1) -> Scored:
    """ "+-+" is a right, a wrong and a right claim of falling score."""
    scores = 1.0 - np.arange(len(outcomes)) / 10.0
    return Scored(scores, np.array([mark == "+" for mark in outcomes], dtype=bool), objects, images)


@st.composite
def rankings(draw) -> Scored:
    right = np.array(draw(st.lists(st.booleans(), max_size=20)), dtype=bool)
    scores = np.array(
        draw(st.lists(st.sampled_from([0.1, 0.3, 0.5, 0.7, 0.9]), min_size=len(right), max_size=len(right)))
    )
    return Scored(scores, right, int(right.sum()) + draw(st.integers(0, 5)), draw(st.integers(1, 4)))


def test_average_precision_by_hand():
    # + - + - of 3 objects: recall 1/3 at precision 1, 2/3 at 2/3, the third never.
    assert average_precision(ranked("+-+-", 3)) == pytest.approx(1 / 3 + 1 / 3 * 2 / 3)
    # - + + : precision 1/2 at the first recall is lifted to the 2/3 of the second.
    assert average_precision(ranked("-++", 2)) == pytest.approx(2 / 3)
    assert average_precision(ranked("++", 2)) == 1.0
    assert average_precision(ranked("---", 2)) == 0.0
    assert average_precision(ranked("", 2)) == 0.0
    assert average_precision(ranked("--", 0)) is None


def test_recall_and_false_positives_per_image_by_hand():
    scored = ranked("+-+-", 4, images=2)
    fppi, recall = recall_per_false_positives(scored)
    assert fppi.tolist() == [0.0, 0.5, 0.5, 1.0]
    assert recall.tolist() == [0.25, 0.25, 0.5, 0.5]
    assert recall_at(scored, 0.0) == 0.25
    assert recall_at(scored, 0.5) == 0.5
    assert recall_at(ranked("--+", 1, images=1), 1.0) == 0.0
    assert recall_at(ranked("-+", 1, images=1), 1.0) == 1.0
    assert recall_at(ranked("-", 0), 1.0) is None


def test_equal_scores_pass_together():
    both = Scored(np.array([0.5, 0.5]), np.array([True, False]), 1, 1)
    turned = Scored(np.array([0.5, 0.5]), np.array([False, True]), 1, 1)
    assert average_precision(both) == average_precision(turned) == 0.5
    assert recall_at(both, 0.0) == recall_at(turned, 0.0) == 0.0


def test_threshold_of_best_f1():
    scored = ranked("++-+--", 4)  # F1: 2/5, 4/6, 4/7, 6/8, 6/9, 6/10
    assert best_threshold(scored) == pytest.approx(0.7)
    point = at_threshold(scored, best_threshold(scored))
    assert (point.precision, point.recall, point.f1) == (0.75, 0.75, 0.75)
    assert best_threshold(ranked("", 4)) is None
    nothing = at_threshold(scored, None)
    assert (nothing.precision, nothing.recall, nothing.f1) == (None, 0.0, 0.0)


def test_pooling_adds_images_and_objects():
    pooled = Scored.pooled([ranked("+-", 2, images=1), ranked("-+", 3, images=2)])
    assert (pooled.objects, pooled.images) == (5, 3)
    # scores 1 (+-), 0.9 (-+): 1 of 5 at 1/3 per image, then 2 of 5 at 2/3
    fppi, recall = recall_per_false_positives(pooled)
    assert fppi == pytest.approx([1 / 3, 2 / 3])
    assert recall == pytest.approx([0.2, 0.4])
    empty = Scored.pooled([])
    assert (len(empty.scores), empty.objects, empty.images) == (0, 0, 0)


def test_curves_are_thinned_to_their_ends():
    x, y = thinned(np.arange(1000.0), np.arange(1000.0) ** 2)
    assert len(x) == MOST_POINTS
    assert (x[0], x[-1], y[-1]) == (0.0, 999.0, 999.0**2)
    assert thinned(np.arange(3.0), np.arange(3.0))[0] == (0.0, 1.0, 2.0)


@given(rankings())
def test_shares_are_shares(scored):
    recall, precision = precision_recall(scored)
    for share in (*recall, *precision):
        assert 0.0 <= share <= 1.0
    assert np.all(np.diff(recall) >= 0.0)
    assert np.all(np.diff(precision) <= 0.0)
    value = average_precision(scored)
    assert value is None or 0.0 <= value <= 1.0
    assert value is None or value <= recall.max(initial=0.0) + 1e-12


@given(rankings(), st.sampled_from([0.1, 0.5, 0.9, 1.0]), st.sampled_from([0.1, 0.5, 0.9]))
def test_a_false_positive_never_helps(scored, score, threshold):
    worse = Scored(np.append(scored.scores, score), np.append(scored.right, False), scored.objects, scored.images)
    before, after = at_threshold(scored, threshold), at_threshold(worse, threshold)
    assert after.recall == before.recall
    if before.precision is not None:
        assert after.precision <= before.precision
    if scored.objects:
        assert average_precision(worse) <= average_precision(scored) + 1e-12
        assert recall_at(worse, 1.0) <= recall_at(scored, 1.0)


@given(rankings(), st.randoms(use_true_random=False))
def test_order_of_claims_does_not_matter(scored, random):
    order = list(range(len(scored.scores)))
    random.shuffle(order)
    mixed = Scored(scored.scores[order], scored.right[order], scored.objects, scored.images)
    assert average_precision(mixed) == pytest.approx(average_precision(scored))
    assert recall_at(mixed, 1.0) == recall_at(scored, 1.0)
    assert best_threshold(mixed) == best_threshold(scored)

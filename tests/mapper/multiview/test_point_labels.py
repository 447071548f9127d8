"""Classes of the cloud's points, by the masks that they project into."""

from __future__ import annotations

import numpy as np
import pytest

CUP, BOWL, NOTHING = (0.9, 0.02), (0.02, 0.9), (0.02, 0.02)


@pytest.fixture
def cards(tools):
    return tools.Cards(((-0.2, 0.0, 1.0), 0.06), ((0.2, 0.1, 1.2), 0.08), ((0.25, -0.25, 1.1), 0.06))


def true_labels(cards, points) -> np.ndarray:
    """Card of every point, by where it is; -1 for the wall."""
    labels = np.full(len(points), -1)
    for number, (centre, half) in enumerate(cards.cards):
        off = np.abs(points - centre)
        labels[(off[:, 0] < half + 0.01) & (off[:, 1] < half + 0.01) & (off[:, 2] < 0.01)] = number
    return labels


def test_points_have_the_final_label_of_their_track(cards):
    views = [(0.04 * i, {0: CUP, 1: BOWL if i else CUP, 2: NOTHING}) for i in range(5)]
    mapper = cards.map(views)
    points, _ = mapper.cloud()
    labels, true = mapper.point_labels(), true_labels(cards, points)
    assert labels.dtype == np.int64 and labels.shape == (len(points),) and len(points) > 1000
    expected = np.array([0, 1, -1, -1])[true]  # the bowl too, though one view called it a cup; the last is background
    assert np.mean(labels == expected) > 0.99
    for label in (0, 1):  # few are lost at the edges
        assert np.mean(labels[expected == label] == label) > 0.9


def test_masks_of_dropped_tracks_are_background(cards):
    views = [(0.02 * i, {0: CUP, 1: BOWL} if i < 2 else {0: CUP}) for i in range(6)]
    labels = cards.map(views).point_labels()
    assert set(labels.tolist()) == {-1, 0}


def test_the_majority_of_the_views_wins(cards):
    """The cup is hit by its mask in 2 of 5 views, then in 3."""
    for hits, found in ((2, {-1}), (3, {-1, 0})):
        views = [(0.01 * i, {0: CUP} if i < hits else {}) for i in range(5)]
        assert set(cards.map(views, min_share=0.0).point_labels().tolist()) == found


def test_a_view_in_which_something_is_before_a_point_has_no_vote(tools):
    """The card that stands before the cup in 3 of 5 views is no cup, nor does it make the cup background."""
    cards = tools.Cards(((0.0, 0.0, 1.5), 0.05), ((-0.16, 0.0, 0.8), 0.1))
    mapper = cards.map([(x, {0: CUP}) for x in (0.0, 0.02, -0.3, -0.31, -0.32)])
    points, _ = mapper.cloud()
    labels, true = mapper.point_labels(), true_labels(cards, points)
    assert np.mean(labels[true == 0] == 0) > 0.9 and np.all(labels[true == 1] == -1)


def test_boxes_do_not_tell_which_points_are_theirs(tools, cards):
    scores = {0: CUP, 1: BOWL}
    mapper = cards.map([(0.0, scores), (0.05, scores)], masks=False)
    assert len(mapper.object_map()) == 2 and mapper.point_labels() is None

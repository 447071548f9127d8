"""Votes and equation (1)."""

import numpy as np
import pytest

from thingmap.detectors.shape_context.voting import Voters, cast_votes, valid_votes

FOCAL = 100.0


def voters(xy, depth=1.0, owner=0, weight=1.0, turn=0.0) -> Voters:
    xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    each = np.ones(len(xy))
    return Voters(xy, depth * each, np.asarray(owner * each, dtype=np.int32), weight * each, turn * each)


def test_votes_go_to_the_middle_at_every_depth(codebook):
    book = codebook([(0.1, 0.0), (0.0, -0.2)], sizes=[(0.2, 0.4), (0.1, 0.1)])
    near, far = (
        cast_votes(voters((30, 20), depth), np.array([[0, 1]]), np.zeros((1, 2)), book, FOCAL, 0.1)
        for depth in (1.0, 2.0)
    )
    np.testing.assert_allclose(near.xy, [(40, 20), (30, 0)], atol=1e-5)
    np.testing.assert_allclose(far.xy, [(35, 20), (30, 10)], atol=1e-5)
    np.testing.assert_allclose(near.size, [(20, 40), (10, 10)], atol=1e-5)
    np.testing.assert_allclose(far.size, near.size / 2, atol=1e-5)


def test_perfect_matches_of_a_whole_contour_add_up_to_its_length_at_the_training_scale(codebook):
    """Twice as far, a contour has half as many points, and each says as much as two."""
    book = codebook([(0.0, 0.0)], depth=0.01)  # trained at 1 m with f = 100
    for depth, points in ((1.0, 40), (2.0, 20)):
        described = voters(np.zeros((10, 2)), depth, weight=points / 10)
        votes = cast_votes(described, np.zeros((10, 1), int), np.zeros((10, 1)), book, FOCAL, 0.1)
        assert votes.weight.sum() == pytest.approx(40.0)


def test_votes_turn_with_what_they_are_on(codebook):
    """A thing that leans a quarter turn clockwise has its right below."""
    book = codebook([(0.1, 0.0), (0.0, -0.2)])
    leaning = voters((30, 20), turn=np.pi / 2)
    votes = cast_votes(leaning, np.array([[0, 1]]), np.zeros((1, 2)), book, FOCAL, 0.1)
    np.testing.assert_allclose(votes.xy, [(30, 30), (50, 20)], atol=1e-5)


def test_a_worse_match_counts_less(codebook):
    book = codebook([(0.0, 0.0), (0.0, 0.0)])
    votes = cast_votes(voters((5, 5)), np.array([[0, 1]]), np.array([[0.0, 0.2]]), book, FOCAL, 0.1)
    assert votes.weight.tolist() == pytest.approx([0.5, 0.5 * np.exp(-2.0)])
    assert votes.voter.tolist() == [0, 0]


def test_votes_that_leave_their_proposal_are_pruned(codebook):
    labels = np.full((60, 80), -1, dtype=np.int32)
    labels[10:50, 10:30], labels[10:50, 30:60] = 0, 1
    book = codebook([(0.05, 0.0), (0.2, 0.0), (0.0, -0.15), (0.9, 0.0)])
    votes = cast_votes(voters((20, 20)), np.arange(4)[None], np.zeros((1, 4)), book, FOCAL, 0.1)
    # inside; on another thing; on nothing; outside the image
    assert valid_votes(votes, labels, prune=True).tolist() == [True, False, False, False]
    assert valid_votes(votes, labels, prune=False).tolist() == [True, True, True, False]
    assert len(votes.select(valid_votes(votes, labels, prune=True))) == 1


def test_nobody_votes(codebook):
    none = np.zeros((0, 3))
    votes = cast_votes(voters([]), none.astype(int), none, codebook([(0.0, 0.0)]), FOCAL, 0.1)
    assert len(votes) == 0 and valid_votes(votes, np.zeros((5, 5), np.int32), True).shape == (0,)

"""Maxima of the heat map, and who voted for them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.shape_context.config import VotingConfig
from thingmap.detectors.shape_context.hypotheses import find_hypotheses
from thingmap.detectors.shape_context.voting import Votes


def votes(xy, weight=1.0, group=0, size=(20.0, 40.0)) -> Votes:
    xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    count = len(xy)
    return Votes(
        xy,
        np.broadcast_to(np.asarray(size, dtype=np.float64), (count, 2)),
        np.broadcast_to(np.float64(weight), count),
        np.broadcast_to(np.int32(group), count),
        np.arange(count, dtype=np.int32),
    )


def test_votes_for_one_place_are_one_hypothesis_with_their_sum():
    found = find_hypotheses(votes(np.full((12, 2), (30.0, 25.0))), np.array([50.0]), VotingConfig())
    assert len(found) == 1
    np.testing.assert_allclose(found.xy, [(30.0, 25.0)])
    assert found.score[0] == pytest.approx(12.0)
    assert found.voters[0].tolist() == list(range(12))
    np.testing.assert_allclose(found.xyxy, [(20.5, 5.5, 40.5, 45.5)])


def test_two_places_are_two_hypotheses_the_stronger_first():
    both = np.concatenate([np.full((5, 2), (10.0, 10.0)), np.full((9, 2), (60.0, 40.0))])
    found = find_hypotheses(votes(both), np.array([40.0]), VotingConfig())
    np.testing.assert_allclose(found.xy, [(60.0, 40.0), (10.0, 10.0)])
    assert [len(v) for v in found.voters] == [9, 5]
    assert set(found.voters[0]) == set(range(5, 14))


def test_the_weak_one_is_left_out_within_its_proposal_only():
    xy = np.concatenate([np.full((10, 2), (10.0, 10.0)), np.full((2, 2), (60.0, 40.0))])
    sides = np.array([40.0, 40.0])
    together = find_hypotheses(votes(xy), sides, VotingConfig())
    apart = find_hypotheses(votes(xy, group=np.repeat([0, 1], [10, 2])), sides, VotingConfig())
    assert len(together) == 1 and len(apart) == 2


def test_the_box_is_what_most_voters_say():
    size = np.array([(20.0, 40.0)] * 6 + [(90.0, 10.0)] * 3)
    found = find_hypotheses(votes(np.zeros((9, 2)), size=size), np.array([50.0]), VotingConfig())
    np.testing.assert_allclose(found.size, [(20.0, 40.0)])


def test_no_votes_no_hypotheses():
    found = find_hypotheses(votes([]), np.zeros(0), VotingConfig())
    assert len(found) == 0 and found.xyxy.shape == (0, 4) and found.voters == ()


@given(st.integers(1, 60), st.integers(0, 999))
def test_hypotheses_lie_among_their_votes_and_never_count_one_for_more_than_it_weighs(count, seed):
    rng = np.random.default_rng(seed)
    cast = votes(rng.uniform(0, 100, (count, 2)), rng.uniform(0.1, 2.0, count), rng.integers(0, 3, count))
    found = find_hypotheses(cast, np.array([30.0, 60.0, 90.0]), VotingConfig())
    assert len(found) >= 1
    for xy, score, voters in zip(found.xy, found.score, found.voters, strict=True):
        own = cast.select(np.isin(np.arange(count), voters))
        assert len(set(own.group)) == 1
        assert score <= own.weight.sum() * (1 + 1e-9)
        group = cast.xy[cast.group == own.group[0]]
        assert (xy >= group.min(axis=0) - 1e-6).all() and (xy <= group.max(axis=0) + 1e-6).all()
    most = VotingConfig().maxima
    groups = [int(cast.group[v[0]]) for v in found.voters]
    assert max(groups.count(g) for g in set(groups)) <= most


def test_a_narrower_kernel_parts_what_a_wide_one_joins():
    xy = np.concatenate([np.full((5, 2), (10.0, 10.0)), np.full((5, 2), (26.0, 10.0))])
    wide, narrow = (
        len(find_hypotheses(votes(xy), np.array([100.0]), VotingConfig(smoothing=share))) for share in (0.2, 0.03)
    )
    assert (wide, narrow) == (1, 2)


def test_scores_do_not_depend_on_where_the_image_begins():
    xy = np.random.default_rng(0).normal(40.0, 6.0, (50, 2))
    here, there = (find_hypotheses(votes(xy + shift), np.array([50.0]), VotingConfig()) for shift in (0.0, 17.0))
    np.testing.assert_allclose(there.xy, here.xy + 17.0, atol=1e-9)
    assert there.score == pytest.approx(here.score)

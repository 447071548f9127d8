"""What a landmark looks like, over its views."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper.estimation.embeddings import KEPT_BLOCKS, EmbeddingMean

vectors = st.lists(
    st.tuples(st.integers(0, 60), st.tuples(*[st.floats(-3.0, 3.0)] * 4), st.floats(0.01, 1.0)), max_size=50
)


def reference(views):
    """The weighted mean of unit vectors, and its length before it was made 1."""
    units = [w * np.array(v) / np.linalg.norm(v) for _, v, w in views if np.linalg.norm(v) >= 1e-9]
    total = np.sum(units, axis=0) if units else np.zeros(4)
    return total, np.linalg.norm(total)


@given(views=vectors, split=st.integers(0, 50))
@settings(max_examples=100, deadline=None)
def test_the_mean_is_that_of_all_views_whatever_the_order_and_the_landmarks_they_came_by(views, split):
    one, other = EmbeddingMean(), EmbeddingMean()
    for k, view in enumerate(views):
        (one if k < split else other).add(*view)
    one.absorb(other)
    total, length = reference(views)
    if length > 1e-3:
        mean = one.mean()
        assert mean is not None and mean.dtype == np.float32
        np.testing.assert_allclose(mean, total / length, atol=2e-3 if length < 0.1 else 1e-4)
    assert one.views == len({k for k, v, _ in views if np.linalg.norm(v) >= 1e-9})
    assert len(one._blocks) <= KEPT_BLOCKS


def test_two_things_that_were_seen_at_different_times_part_cleanly():
    mixed = EmbeddingMean()
    for k in (*range(100), *range(400, 500)):
        mixed.add(k, [1.0, 0.0] if k < 200 else [0.0, 1.0], 0.5)
    second = mixed.take_out(range(400, 500))
    np.testing.assert_allclose(mixed.mean(), [1.0, 0.0])
    np.testing.assert_allclose(second.mean(), [0.0, 1.0])
    assert (mixed.views, second.views) == (100, 100)


def test_nothing_looks_like_nothing():
    mean = EmbeddingMean()
    assert mean.mean() is None and mean.views == 0
    mean.add(1, np.zeros(3), 1.0)
    assert mean.mean() is None and mean.views == 0
    mean.add(1, [2.0, 0.0, 0.0], 1.0)
    mean.add(2, [-1.0, 0.0, 0.0], 1.0)
    assert mean.mean() is None and mean.views == 2  # they cancel out


def test_embeddings_of_another_length_are_refused():
    mean = EmbeddingMean()
    mean.add(1, np.ones(3), 1.0)
    with pytest.raises(ValueError, match=r"shape \(3,\), but got \(4,\)"):
        mean.add(2, np.ones(4), 1.0)

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.shape_context.config import LENGTH
from thingmap.detectors.shape_context.matching import best_matches

CLOSE = 2e-6


def rows(rng, count, filled=50):
    """Descriptors like real ones: counts of neighbours in some of the bins, as shares."""
    counts = rng.integers(1, 30, (count, LENGTH)) * (rng.random((count, LENGTH)) < filled / LENGTH)
    counts[:, 0] += 1
    return (counts / counts.sum(axis=1, keepdims=True)).astype(np.float32)


def chi_square(queries, codebook):
    """(S, M) float64, the definition."""
    a, b = queries.astype(float)[:, None], codebook.astype(float)[None]
    return 0.5 * ((a - b) ** 2 / np.where(a + b > 0, a + b, 1.0)).sum(axis=-1)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 300), st.integers(1, 20), st.integers(1, 144))
def test_as_brute_force(seed, count, size, k, filled):
    rng = np.random.default_rng(seed)
    queries, codebook = rows(rng, count, filled), rows(rng, size, filled)
    index, distance = best_matches(queries, codebook, k)
    true = chi_square(queries, codebook)
    assert index.dtype == np.int32 and distance.dtype == np.float32
    assert index.shape == distance.shape == (count, min(k, size))
    np.testing.assert_allclose(distance, np.sort(true, axis=1)[:, :k], atol=CLOSE)
    np.testing.assert_allclose(np.take_along_axis(true, index.astype(int), axis=1), distance, atol=CLOSE)
    assert all(len(set(line)) == len(line) for line in index.tolist())
    assert (np.diff(distance, axis=1) >= 0).all()


@pytest.mark.parametrize("size", [999, 1000, 1001, 2345])
def test_codebooks_of_several_blocks(size):
    rng = np.random.default_rng(size)
    queries, codebook = rows(rng, 20), rows(rng, size)
    codebook[-1] = queries[0]
    index, distance = best_matches(queries, codebook, 10)
    true = chi_square(queries, codebook)
    np.testing.assert_allclose(distance, np.sort(true, axis=1)[:, :10], atol=CLOSE)
    assert index[0, 0] == size - 1 and distance[0, 0] < CLOSE


def test_equal_entries_come_by_index():
    rng = np.random.default_rng(0)
    distinct = rows(rng, 4)
    codebook = distinct[np.arange(2203) % 4]  # equal ones in all blocks, and among those that no vector holds whole
    queries = distinct * 0.9 + 0.1 * rows(rng, 4)
    index, distance = best_matches(queries, codebook, 700)
    order = np.argsort(chi_square(queries, distinct), axis=1)
    for line, found, values in zip(order, index, distance, strict=True):
        copies = [np.arange(first, 2203, 4) for first in line]
        np.testing.assert_array_equal(found, np.concatenate(copies)[:700])
        assert len(set(values.tolist())) == 2


def test_k_larger_than_the_codebook_gives_all_of_it():
    rng = np.random.default_rng(1)
    queries, codebook = rows(rng, 3), rows(rng, 5)
    index, distance = best_matches(queries, codebook, 10)
    assert index.shape == distance.shape == (3, 5)
    np.testing.assert_array_equal(np.sort(index, axis=1), np.tile(np.arange(5), (3, 1)))


def test_nothing_to_match():
    some, none = rows(np.random.default_rng(2), 5), np.zeros((0, LENGTH), np.float32)
    assert [a.shape for a in best_matches(none, some, 3)] == [(0, 3), (0, 3)]
    assert [a.shape for a in best_matches(some, none, 3)] == [(5, 0), (5, 0)]


def test_rows_of_zeros():
    some, zero = rows(np.random.default_rng(3), 6), np.zeros((1, LENGTH), np.float32)
    index, distance = best_matches(zero, some, 3)
    np.testing.assert_allclose(distance, 0.5, atol=CLOSE)
    assert len(set(index[0].tolist())) == 3
    index, distance = best_matches(some[:1], np.concatenate([zero, some[:1]]), 2)
    assert index.tolist() == [[1, 0]]
    np.testing.assert_allclose(distance, [[0.0, 0.5]], atol=CLOSE)
    assert best_matches(zero, zero, 1)[1] == 0.0


def test_distance_is_symmetric_and_from_0_to_1():
    rng = np.random.default_rng(4)
    first, second = rows(rng, 30), rows(rng, 30)
    for a, b in zip(first, second, strict=True):
        there, back = best_matches(a[None], b[None], 1)[1], best_matches(b[None], a[None], 1)[1]
        np.testing.assert_allclose(there, back, atol=CLOSE)
    left, right = np.zeros((2, 1, LENGTH), np.float32)
    left[0, :70], right[0, 70:] = 1 / 70, 1 / 74
    assert best_matches(left, right, 1)[1] == pytest.approx(1.0, abs=CLOSE)
    assert best_matches(left, left, 1)[1] == pytest.approx(0.0, abs=CLOSE)


@pytest.mark.parametrize("tiny", [1e-8, 2e-9, 1e-12, 1e-38, 1e-45])
def test_tiny_shares_do_no_harm(tiny):
    query = np.full((1, LENGTH), tiny, np.float32)
    query[0, 5] = 1.0
    codebook = np.zeros((3, LENGTH), np.float32)
    codebook[0, 6] = codebook[1, 5] = 1.0
    codebook[2] = query[0]
    index, distance = best_matches(query, codebook, 3)
    assert index[0, 2] == 0
    np.testing.assert_allclose(distance, [[0.0, 0.0, 1.0]], atol=CLOSE)


def test_the_same_bits_whatever_else_is_asked():
    rng = np.random.default_rng(5)
    queries, codebook = rows(rng, 40), rows(rng, 1700)
    index, distance = best_matches(queries, codebook, 8)
    again = best_matches(queries, codebook, 8)
    np.testing.assert_array_equal(index, again[0])
    np.testing.assert_array_equal(distance, again[1])
    np.testing.assert_array_equal(distance[7:9], best_matches(queries[7:9], codebook, 8)[1])
    shuffled = rng.permutation(1700)
    np.testing.assert_array_equal(distance, best_matches(queries, codebook[shuffled], 8)[1])


@pytest.mark.parametrize(
    ("queries", "codebook", "k"), [((3, 7), (4, LENGTH), 1), ((3, LENGTH), (LENGTH,), 1), ((3, LENGTH), (4, LENGTH), 0)]
)
def test_wrong_arguments_are_told(queries, codebook, k):
    with pytest.raises(ValueError, match="must be"):
        best_matches(np.zeros(queries), np.zeros(codebook), k)

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.shape_context.training.codebooks import build_codebook, edge_counts, spread
from thingmap.detectors.shape_context.training.outlines import outline


@pytest.fixture(scope="module")
def outlines(make_view, small):
    return [outline(make_view("cross", number), small) for number in range(5)]


def test_entries_come_from_all_views_and_all_sides(outlines, small):
    book = build_codebook(outlines, 0.1, small)
    assert book is not None and len(book) == small.entries
    np.testing.assert_allclose(book.descriptors.sum(axis=1), 1.0, atol=1e-5)
    kinds = np.unique(book.sizes, axis=0, return_counts=True)[1]
    assert kinds.tolist() == [small.entries // 5] * 5
    for axis in range(2):
        assert book.offsets[:, axis].min() < -0.05 and book.offsets[:, axis].max() > 0.05
    assert book.radius == 0.1 and book.depth == pytest.approx(1.0 / 300.0, rel=0.01)


def test_views_from_different_distances_give_one_count(outlines, small):
    book = build_codebook(outlines, 0.1, small)
    counts = [len(one.points()) for one in outlines]
    assert max(counts) > 1.3 * min(counts)  # pixels
    assert book is not None and book.edge_mean == pytest.approx(np.median(counts), rel=0.1)
    assert book.edge_std < 0.15 * book.edge_mean


def test_counts_are_brought_to_one_scale():
    mean, std, scale = edge_counts([400, 200, 100], [0.001, 0.002, 0.004])
    assert (mean, scale) == (pytest.approx(200.0), 0.002) and std == pytest.approx(np.sqrt(200.0))
    assert edge_counts([100, 900], [0.002, 0.002])[1] == pytest.approx(400.0)


def test_a_radius_within_which_nothing_lies_gives_no_codebook(outlines, small):
    assert build_codebook(outlines, 1e-4, small) is None


@given(st.lists(st.integers(0, 50), min_size=1, max_size=12), st.integers(1, 200))
def test_as_many_as_wanted_evenly(counts, most):
    rows = spread(counts, most)
    taken = np.array([len(row) for row in rows])
    assert taken.sum() == min(most, sum(counts))
    for count, row in zip(counts, rows, strict=True):
        assert len(set(row.tolist())) == len(row) and all(0 <= k < count for k in row)
        assert len(row) < 2 or np.ptp(np.diff(row)) <= 1  # steps differ by one at most
    level = taken.max(initial=0)
    assert all(given >= min(count, level - 1) for given, count in zip(taken, counts, strict=True))

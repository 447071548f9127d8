from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError
from thingmap.datasets.stamps import associate, nearest, read_specific_force

# Whole milliseconds: differences are far from the bound or exactly on it.
stamp_lists = st.lists(st.integers(0, 120), max_size=12).map(lambda ms: 1.3e9 + np.array(ms, dtype=float) / 1000)


def by_hand(a: np.ndarray, b: np.ndarray, bound: float) -> set[tuple[int, int]]:
    """The greedy choice, with all pairs looked at one by one."""
    left_a, left_b, taken = set(range(len(a))), set(range(len(b))), set()
    while pairs := [(d, i, j) for i in left_a for j in left_b if (d := round(abs(a[i] - b[j]), 4)) <= bound]:
        _, i, j = min(pairs)
        left_a.remove(i)
        left_b.remove(j)
        taken.add((i, j))
    return taken


@given(stamp_lists, stamp_lists)
def test_association_is_one_to_one_within_the_bound_and_greedy(a: np.ndarray, b: np.ndarray) -> None:
    pairs = associate(a, b, 0.02)
    assert len(set(pairs[:, 0])) == len(set(pairs[:, 1])) == len(pairs)
    differences = np.round(np.abs(a[pairs[:, 0]] - b[pairs[:, 1]]), 4)
    assert (differences <= 0.02).all()
    assert (np.diff(a[pairs[:, 0]]) >= 0).all()
    possible = np.round(np.abs(a[:, None] - b[None, :]), 4)
    possible = possible[possible <= 0.02]
    if len(set(possible)) == len(possible):  # without ties the choice is unique
        assert {tuple(pair) for pair in pairs.tolist()} == by_hand(a, b, 0.02)


def test_the_closest_pair_is_made_first() -> None:
    pairs = associate(np.array([0.000, 0.010]), np.array([0.009, 0.030]), 0.02)
    np.testing.assert_array_equal(pairs, [[1, 0]])  # 0.000-0.009 would leave 0.010-0.030, yet 0.010-0.009 is closer


def test_a_difference_of_exactly_the_bound_counts() -> None:
    assert len(associate(np.array([1311868164.36]), np.array([1311868164.38]), 0.02)) == 1
    assert len(associate(np.array([1311868164.36]), np.array([1311868164.381]), 0.02)) == 0


def test_nothing_pairs_with_nothing() -> None:
    assert associate(np.zeros(0), np.array([1.0]), 0.02).shape == (0, 2)
    np.testing.assert_array_equal(nearest(np.array([1.0]), np.zeros(0), 1.0), [-1])


@given(st.lists(numbers := st.integers(0, 50), min_size=1, max_size=10), st.lists(numbers, max_size=10))
def test_nearest_is_the_nearest(of: list[int], asked: list[int]) -> None:
    sorted_of = np.sort(np.array(of, dtype=float))
    index = nearest(np.array(asked, dtype=float), sorted_of, 3.0)
    for stamp, i in zip(asked, index, strict=True):
        best = np.abs(sorted_of - stamp).min()
        assert (abs(sorted_of[i] - stamp) == best) if best <= 3 else i == -1


def test_the_accelerometer_reading_nearest_in_time_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "accelerometer.txt"
    path.write_text("# stamp ax ay az\n1.00 0 -9.8 0\n0.90 9.8 0 0\n1.02 0 0 0\n1.04 nan 0 0\n1.10 0 0 9.8\n")
    force = read_specific_force(path, np.array([0.93, 1.03, 1.06, 1.15, 1.16]))
    np.testing.assert_array_equal(force, [[9.8, 0, 0], [0, -9.8, 0], [0, 0, 9.8], [0, 0, 9.8], [np.nan] * 3])


def test_without_readings_there_is_no_force(tmp_path: Path) -> None:
    assert read_specific_force(tmp_path / "accelerometer.txt", np.array([1.0])) is None
    (tmp_path / "accelerometer.txt").write_text("# accelerometer data\n")
    assert read_specific_force(tmp_path / "accelerometer.txt", np.array([1.0])) is None


def test_readings_in_g_are_told(tmp_path: Path) -> None:
    (tmp_path / "accelerometer.txt").write_text("1 0 -1 0\n2 0 -1 0\n")
    with pytest.raises(InputError, match="found a median length of 1; convert to m/s"):
        read_specific_force(tmp_path / "accelerometer.txt", np.array([1.0]))

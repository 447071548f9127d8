import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS

from thingmap.mapper.labelling.neighbours import neighbour_pairs


def every_pair(voxels: np.ndarray) -> set[tuple[int, int]]:
    far = np.abs(voxels[:, None] - voxels[None]).max(axis=2)
    return {(int(i), int(j)) for i, j in zip(*np.nonzero(far == 1), strict=True) if i < j}


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, count=st.integers(1, 80), reach=st.integers(1, 12))
def test_pairs_are_those_that_touch_each_once_and_sorted(seed: int, count: int, reach: int) -> None:
    rng = np.random.default_rng(seed)
    voxels = np.unique(rng.integers(-reach, reach, (count, 3)), axis=0).astype(np.int32)
    rng.shuffle(voxels)
    pairs = neighbour_pairs(voxels)
    assert pairs.dtype == np.int32 and pairs.shape[1] == 2
    assert pairs.tolist() == sorted(list(pair) for pair in every_pair(voxels))


def test_a_full_block_has_26_neighbours_inside() -> None:
    voxels = np.indices((5, 5, 5)).reshape(3, -1).T.astype(np.int32)
    pairs = neighbour_pairs(voxels)
    degree = np.bincount(pairs.ravel()).reshape(5, 5, 5)
    assert (degree[1:-1, 1:-1, 1:-1] == 26).all()
    assert degree[0, 0, 0] == 7
    assert len(pairs) > 6 * len(voxels)  # more than there is room for at first


def test_rows_of_the_grid_do_not_run_into_each_other() -> None:
    assert len(neighbour_pairs(np.array([[0, 0, 9], [0, 1, 0], [1, 0, 0]], np.int32))) == 1  # only the last two touch


def test_voxels_may_lie_a_thousand_kilometres_apart() -> None:
    voxels = np.array([[10**8, 5, 5], [-(10**8), 5, 5], [10**8, 6, 4]], np.int32)
    assert neighbour_pairs(voxels).tolist() == [[0, 2]]


def test_no_voxels_have_no_pairs() -> None:
    assert neighbour_pairs(np.empty((0, 3), np.int32)).shape == (0, 2)


@pytest.mark.parametrize(
    ("voxels", "says"),
    [
        (np.zeros((4, 2), np.int32), "shape"),
        (np.zeros((4, 3)), "float64"),
        (np.array([[0, 0, 0], [7, 8, 9], [7, 8, 9]]), r"\[7, 8, 9\] comes more than once"),
        (np.array([[-(2**30)] * 3, [2**30] * 3]), "2\\^62"),
    ],
)
def test_what_is_not_a_set_of_voxels_is_refused(voxels: np.ndarray, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        neighbour_pairs(voxels)

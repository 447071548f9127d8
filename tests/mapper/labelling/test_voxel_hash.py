"""The table of voxels: every cell has one row, wherever it lies and however full the table is."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS

from thingmap.mapper.labelling.voxel_hash import CELL, CLASSES, FREE, POINTS, add_points, fill_table


def rows_of(cells: np.ndarray, table: np.ndarray, rows: np.ndarray, used: int) -> tuple[np.ndarray, int]:
    """Rows of the cells' middles, added as one frame; and how many are taken now."""
    count = len(cells)
    nothing = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.uint8), np.empty((count, 0), np.float32)
    points = (cells + 0.5).astype(np.float32)
    found, used, _ = add_points(np.eye(4), 1.0, points, *nothing, 1, table, rows.view(np.int32), rows, used)
    return found, used


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, count=st.integers(1, 1500), reach=st.sampled_from([1, 3, 40, 500_000]), spare=st.integers(0, 2))
def test_each_cell_has_one_row_and_is_found_again(seed: int, count: int, reach: int, spare: int) -> None:
    """Negative cells too, a plane of neighbours as well as far apart, in a table that is half full or emptier."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(-reach, reach, (count, 3))
    places = 1 << (int(2 * count - 1).bit_length() + spare)
    table, rows = np.zeros(places, np.int32), np.full((count, CLASSES), np.nan, np.float32)  # free rows are anything
    found, used = rows_of(cells, table, rows, 0)
    distinct, number, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    ints = rows.view(np.int32)
    assert used == len(distinct) == np.count_nonzero(table != FREE)
    np.testing.assert_array_equal(ints[found, CELL:POINTS], cells)
    np.testing.assert_array_equal(ints[found, POINTS], counts[number.ravel()])
    again, used_again = rows_of(cells, table, rows, used)
    np.testing.assert_array_equal(again, found)
    assert used_again == used
    larger = np.zeros(2 * places, np.int32)
    fill_table(larger, ints, used)
    np.testing.assert_array_equal(rows_of(cells, larger, rows, used)[0], found)

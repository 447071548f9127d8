"""Points on edges."""

import numpy as np


def test_selected_points_keep_their_rows(edge_map):
    edges = edge_map([(5, 2), (1, 2), (7, 4), (3, 0)])
    assert edges.columns.tolist() == [3, 1, 5, 7] and len(edges) == 4
    some = edges.select(np.array([False, True, False, True]))
    assert some.columns.tolist() == [1, 7] and some.rows.tolist() == [2, 4]
    for row in range(60):
        own = some.rows[some.row_start[row] : some.row_start[row + 1]]
        assert (own == row).all() and len(own) == (some.rows == row).sum()

"""Which observation is of which track (Georgakis et al., section III-B): the closest centroid within a threshold."""

from __future__ import annotations

import numpy as np

NEW = -1  # of no track there is


def link(observed: np.ndarray, tracks: np.ndarray, max_distance: float) -> np.ndarray:
    """Pairs the closest first, each observation with one track and each track with one observation.

    Args:
        observed: (N, 3) centroids seen in one view, world, metres.
        tracks: (T, 3) centroids of the tracks, world, metres.
        max_distance: metres; pairs farther apart are none.

    Returns:
        (N,) rows of `tracks`, `NEW` for what is near none that is left. Of equally close pairs the earlier
        observation's comes first, then the earlier track's.
    """
    found = np.full(len(observed), NEW, dtype=np.int64)
    distance = np.linalg.norm(observed[:, None] - tracks[None], axis=2)
    rows, columns = np.nonzero(distance <= max_distance)
    taken = np.zeros(len(tracks), dtype=np.bool_)
    for pair in np.argsort(distance[rows, columns], kind="stable"):
        row, column = rows[pair], columns[pair]
        if found[row] == NEW and not taken[column]:
            found[row], taken[column] = column, True
    return found

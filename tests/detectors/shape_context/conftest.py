"""Edge maps and codebooks by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from thingmap.detectors.shape_context.codebook import Codebook
from thingmap.detectors.shape_context.config import LENGTH
from thingmap.detectors.shape_context.edge_map import EdgeMap


@pytest.fixture(scope="session")
def edge_map() -> Callable[..., EdgeMap]:
    """`edge_map(xy, shape=(60, 80), depth=1.0, orientation=0.0)`: points (E, 2), in any order."""

    def make(xy, shape=(60, 80), depth=1.0, orientation=0.0) -> EdgeMap:
        xy = np.asarray(xy, dtype=np.int32).reshape(-1, 2)
        count = len(xy)
        depths = np.broadcast_to(np.float32(depth), count).copy()
        angles = np.broadcast_to(np.float32(orientation), count).copy()
        order = np.lexsort((xy[:, 0], xy[:, 1]))
        columns, rows = xy[order].T
        start = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=shape[0]))]).astype(np.int64)
        return EdgeMap(shape, columns, rows, start, angles[order], depths[order], np.ones(count, dtype=bool))

    return make


@pytest.fixture(scope="session")
def codebook() -> Callable[..., Codebook]:
    """`codebook(offsets, sizes)`: entry k has all its points in bin k; an edge count of 10 +- 2 at 1 m and f = 100."""

    def make(offsets, sizes=None, radius=0.1, edge_mean=10.0, edge_std=2.0, depth=0.01) -> Codebook:
        offsets = np.asarray(offsets, dtype=np.float32).reshape(-1, 2)
        sizes = np.full_like(offsets, 0.2) if sizes is None else np.asarray(sizes, dtype=np.float32)
        return Codebook(np.eye(len(offsets), LENGTH), offsets, sizes, radius, edge_mean, edge_std, depth)

    return make

"""Codebooks from the outlines of a class's views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..codebook import Codebook
from ..config import Context
from ..descriptor import shape_contexts
from .config import TrainConfig
from .outlines import Outline


def build_codebook(outlines: Sequence[Outline], radius: float, config: TrainConfig) -> Codebook | None:
    """The descriptors f_i = (d_i, q_i) of a class, all of one radius (section III-A).

    Args:
        outlines: of the views, at least one.
        radius: metres at the object.
        config: the numbers; `entries` are spread evenly over the views, and around the outline of each.

    Returns:
        None where no point has another within the radius.
    """
    every = [one.points() for one in outlines]
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for one, its, chosen in zip(outlines, every, spread([len(its) for its in every], config.entries), strict=True):
        points = its[chosen]
        pixels = np.full(len(points), radius / one.scale, dtype=np.float32)
        owner = one.owner if config.voting.context is Context.PROPOSAL else None
        descriptors = shape_contexts(one.edges, points, pixels, owner)
        some = descriptors.any(axis=1)
        size = np.repeat(one.size[None], int(some.sum()), axis=0)
        parts.append((descriptors[some], one.offsets(points[some]), size))
    descriptors, offsets, sizes = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    if len(descriptors) == 0:
        return None
    mean, std, scale = edge_counts([len(its) for its in every], [one.scale for one in outlines])
    return Codebook(descriptors, offsets, sizes, radius, mean, std, scale)


def edge_counts(counts: Sequence[int], scales: Sequence[float]) -> tuple[float, float, float]:
    """mu and sigma of the number of edge points of a class's objects, and the scale z_t / f at which they are counted.

    The scale is the median of the views'. The length of a contour in pixels goes with f / z, so that a count at another
    scale is multiplied by their ratio. Sigma is at least the square root of mu, that of independent points: of one
    view, or of copies of one, nothing could be said otherwise.

    Args:
        counts: edge points of the object, for each view.
        scales: metres a pixel, z_t / f, likewise.
    """
    common = float(np.median(scales))
    at_common = np.asarray(counts) * np.asarray(scales) / common
    mean = float(at_common.mean())
    return mean, max(float(at_common.std()), float(np.sqrt(mean))), common


def spread(counts: Sequence[int], most: int) -> list[np.ndarray]:
    """For each of several rows of points the positions of those that are taken: at most so many of all together.

    Every row gives equally many, or all it has where it has fewer; with more rows than points to take, evenly chosen
    rows give one each. The positions in a row are spaced evenly.

    Args:
        counts: points of each row.
        most: positions in all.
    """
    have = np.asarray(counts, dtype=np.int64)
    low, high = 0, int(have.max(initial=0))  # the greatest level up to which every row can give without too many
    while low < high:
        level = (low + high + 1) // 2
        low, high = (level, high) if np.minimum(have, level).sum() <= most else (low, level - 1)
    wanted = np.minimum(have, low)
    more = np.flatnonzero(have > low)
    rest = min(most - int(wanted.sum()), len(more))
    wanted[more[np.linspace(0, len(more), rest, endpoint=False).astype(np.int64)]] += 1
    return [np.arange(number) * count // max(number, 1) for count, number in zip(have, wanted, strict=True)]

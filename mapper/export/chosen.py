"""What of a run's folder an exporter writes: its things, a part of its cloud, its path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from ..map.thing import Thing

DEFAULT_POINTS = 200_000  # of a cloud; 3.2 MB of colours and coordinates, which viewers on the web still turn smoothly
SEED = 0  # of the choice of points


def read_things(folder: OutputFolder, min_existence: float = 0.0) -> ObjectMap:
    """The map, without things whose existence is below `min_existence`; raises `InputError` as `ObjectMap.load`."""
    object_map = folder.read_map()
    kept = tuple(thing for thing in object_map.things if thing.existence >= min_existence)
    return replace(object_map, things=kept)


def title(thing: Thing) -> str:
    """What a thing is called in scenes: the name that somebody gave it, else its label, and its id."""
    return f"{thing.name or thing.label} {thing.id}"


def read_points(folder: OutputFolder, limit: int = DEFAULT_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """(M, 3) float64 metres, map frame, and (M, 3) uint8 sRGB of the folder's cloud, none where it has none.

    Of a larger cloud `limit` points are drawn evenly, always the same ones, in the order of the file.
    """
    if limit == 0 or not folder.cloud_file.is_file():
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8)
    points, colors = folder.read_cloud()
    if len(points) <= limit:
        return points, colors
    drawn = np.sort(np.random.default_rng(SEED).choice(len(points), limit, replace=False))
    return points[drawn], colors[drawn]


def read_path(folder: OutputFolder) -> tuple[np.ndarray, np.ndarray]:
    """(N,) stamps and (N, 4, 4) `T_world_camera` of every mapped frame; none where the folder has no trajectory."""
    if not folder.trajectory_file.is_file():
        return np.empty(0), np.empty((0, 4, 4))
    return folder.read_trajectory()

"""PLY: the cloud and the boxes of the things in one file, coloured and labelled by class."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..map.atomic import replacing
from ..map.boxes import EDGES, inside_box
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from .chosen import read_things
from .colors import class_color

DOT_SPACING = 0.005  # m between the points drawn along a box's edges
MAX_DOTS = 400  # on one edge
VERTEX = [
    *((axis, "<f4") for axis in "xyz"),
    *((name, "u1") for name in ("red", "green", "blue")),
    ("label", "<i4"),
    ("thing", "<i4"),
]
EDGE = [("vertex1", "<i4"), ("vertex2", "<i4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")]


def export_ply(folder: OutputFolder, file: Path, *, min_existence: float = 0.0) -> int:
    """Write the cloud and the boxes as binary PLY; returns the number of things.

    Vertices are, in this order: 8 corners for each thing (thing i has 8i to 8i + 7), the points of the cloud, and dots
    along the edges of the boxes, for viewers that do not draw PLY's `edge` element. Each has its colour and
    `label`: 0 for none, else the number of a class that a comment line names (`comment label 3 "cup"`);
    `thing`: 0 for none, else the number of a thing (`comment thing 1 "thing-0007"`).
    Points of the cloud keep their own colour and take label and thing from the smallest box that they are in. Things
    whose existence is below `min_existence` are left out.
    """
    from plyfile import PlyData, PlyElement

    object_map = read_things(folder, min_existence)
    labels = _labels(object_map)
    corners = _corners(object_map)
    colors = np.array([class_color(thing.label) for thing in object_map.things], dtype=np.uint8).reshape(-1, 3)
    codes = np.array([labels.index(thing.label) + 1 for thing in object_map.things], dtype=np.int32)
    vertices = np.concatenate(
        [
            _vertices(corners.reshape(-1, 3), colors.repeat(8, axis=0), codes.repeat(8), _numbers(len(codes), 8)),
            _cloud_vertices(folder, object_map, codes),
            _dot_vertices(corners, colors, codes),
        ]
    )
    comments = [
        "thingmap: coordinates in metres, map frame " + json.dumps(str(object_map.frame)),
        *(f"label {code} {json.dumps(label)}" for code, label in enumerate(labels, start=1)),
        *(f"thing {number} {json.dumps(thing.id)}" for number, thing in enumerate(object_map.things, start=1)),
    ]
    elements = [PlyElement.describe(vertices, "vertex"), PlyElement.describe(_edges(colors), "edge")]
    with replacing(file) as temporary:
        PlyData(elements, byte_order="<", comments=comments).write(str(temporary))
    return len(object_map)


def _labels(object_map: ObjectMap) -> list[str]:
    """Classes of the map, then labels of things that are somehow not among them."""
    return list(dict.fromkeys([*object_map.classes, *(thing.label for thing in object_map.things)]))


def _corners(object_map: ObjectMap) -> np.ndarray:
    """(N, 8, 3) of the N things."""
    R_world_upright = object_map.R_world_upright
    return np.array([thing.corners(R_world_upright) for thing in object_map.things]).reshape(-1, 8, 3)


def _numbers(things: int, times: int) -> np.ndarray:
    return np.arange(1, things + 1, dtype=np.int32).repeat(times)


def _vertices(points: np.ndarray, colors: np.ndarray, label: np.ndarray, thing: np.ndarray) -> np.ndarray:
    vertices = np.empty(len(points), dtype=VERTEX)
    for column, axis in enumerate("xyz"):
        vertices[axis] = points[:, column]
    for column, name in enumerate(("red", "green", "blue")):
        vertices[name] = colors[:, column]
    vertices["label"], vertices["thing"] = label, thing
    return vertices


def _cloud_vertices(folder: OutputFolder, object_map: ObjectMap, codes: np.ndarray) -> np.ndarray:
    if not folder.cloud_file.is_file():
        return np.empty(0, dtype=VERTEX)
    points, colors = folder.read_cloud()
    label, number = np.zeros(len(points), dtype=np.int32), np.zeros(len(points), dtype=np.int32)
    for index, inside in _points_inside(points, object_map):
        label[inside], number[inside] = codes[index], index + 1
    return _vertices(points, colors, label, number)


def _points_inside(points: np.ndarray, object_map: ObjectMap) -> Iterator[tuple[int, np.ndarray]]:
    """Number of a thing and indices of the points in its box; largest box first, so that small ones have the last word.

    A tree finds the points near a box first: trying all points for all things takes minutes for a large map.
    """
    from scipy.spatial import KDTree

    tree, R_world_upright = KDTree(points), object_map.R_world_upright
    for index in sorted(range(len(object_map)), key=lambda i: -float(np.prod(object_map.things[i].size))):
        thing = object_map.things[index]
        radius = float(np.linalg.norm(thing.size)) / 2.0 + 1e-9
        near = np.array(tree.query_ball_point(thing.position, radius), dtype=np.int64)
        yield index, near[inside_box(points[near], thing.position, thing.size, thing.yaw, R_world_upright)]


def _dot_vertices(corners: np.ndarray, colors: np.ndarray, codes: np.ndarray) -> np.ndarray:
    parts = [np.empty(0, dtype=VERTEX)]
    for index, box in enumerate(corners):
        starts, ends = box[EDGES[:, 0]], box[EDGES[:, 1]]
        count = np.clip(np.linalg.norm(ends - starts, axis=1) / DOT_SPACING, 1, MAX_DOTS).astype(int)
        edge = np.repeat(np.arange(len(EDGES)), count)
        along = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
        dots = starts[edge] + along[:, None] * (ends - starts)[edge]
        parts.append(
            _vertices(
                dots,
                np.tile(colors[index], (len(dots), 1)),
                np.full(len(dots), codes[index]),
                np.full(len(dots), index + 1),
            )
        )
    return np.concatenate(parts)


def _edges(colors: np.ndarray) -> np.ndarray:
    edges = np.empty(len(colors) * len(EDGES), dtype=EDGE)
    first_corner = 8 * np.arange(len(colors))[:, None]
    edges["vertex1"], edges["vertex2"] = (EDGES[:, 0] + first_corner).ravel(), (EDGES[:, 1] + first_corner).ravel()
    for column, name in enumerate(("red", "green", "blue")):
        edges[name] = colors[:, column].repeat(len(EDGES))
    return edges

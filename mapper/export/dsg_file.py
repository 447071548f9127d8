"""Scene graph in the JSON of spark_dsg 1.1, which Hydra and its tools read with `DynamicSceneGraph.load`.

    layer 2           a node a thing, O(n) with the number n of its id: label, oriented box, position, name
    layer 2, part a   a node a keyframe, a(k), each with an edge to the next

There are no places, rooms or buildings: the map knows of none. Coordinates are metres in the map's upright frame, z up
as Hydra has it; the graph's metadata give `R_map_upright`, which takes them back to the map's axes, and each thing's
metadata are its numbers of map.json, in the map's axes. Semantic label k + 1 is class k of the map.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..map.atomic import write_atomic
from ..map.boxes import box_axes
from ..map.map_file import thing_to_dict
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from .chosen import read_things, title
from .colors import class_color
from .rotations import quaternions
from .trajectory_files import read_poses

HEADER = {"project_name": "main", "version": {"major": 1, "minor": 1, "patch": 3}}  # as spark_dsg 1.1.3 writes it
OBJECTS, AGENT = {"layer": 2, "partition": 0}, {"layer": 2, "partition": ord("a")}
NUMBERED = re.compile(r".*?(\d{1,9})")


def export_dsg(folder: OutputFolder, file: Path, *, min_existence: float = 0.0) -> int:
    """Write the scene graph; returns the number of things.

    Things whose existence is below `min_existence` are left out. A folder without keyframes gives a graph without the
    camera's nodes.

    Raises:
        InputError: the map or the keyframes are damaged.
    """
    object_map = read_things(folder, min_existence)
    stamps, poses = np.empty(0), np.empty((0, 4, 4))
    if folder.keyframes_file.is_file():
        stamps, poses = read_poses(folder, keyframes=True)
    write_atomic(file, json.dumps(_graph(object_map, stamps, poses), ensure_ascii=False, allow_nan=False).encode())
    return len(object_map)


def _graph(object_map: ObjectMap, stamps: np.ndarray, poses: np.ndarray) -> dict[str, Any]:
    labels = list(dict.fromkeys([*object_map.classes, *(thing.label for thing in object_map.things)]))
    about = {
        "source": object_map.source,
        "frame": str(object_map.frame),
        "units": "metres, seconds",
        "R_map_upright": object_map.R_world_upright.tolist(),
    }
    agents = [_symbol("a", k) for k in range(len(stamps))]
    nodes = [*_object_nodes(object_map, labels), *_agent_nodes(agents, stamps, poses, object_map.R_world_upright)]
    names = [[number, label] for number, label in enumerate(labels, start=1)]
    return {
        "SPARK_DSG_header": HEADER,
        "directed": False,
        "multigraph": False,
        "metadata": {"labelspaces": {"_l2p0": names}, "thingmap": about},
        "layer_keys": [OBJECTS, AGENT],
        "layer_names": {"OBJECTS": OBJECTS, "AGENTS": OBJECTS},
        "nodes": nodes,
        "edges": [_edge(one, other) for one, other in pairwise(agents)],
    }


def _object_nodes(object_map: ObjectMap, labels: list[str]) -> Iterator[dict[str, Any]]:
    R = object_map.R_world_upright
    for number, thing in zip(_numbers([t.id for t in object_map.things]), object_map.things, strict=True):
        position = (R.T @ thing.position).tolist()
        turn = _quaternion(R.T @ box_axes(thing.yaw, R))
        red, green, blue = class_color(thing.label).tolist()
        yield {
            "id": _symbol("O", number),
            **OBJECTS,
            "attributes": {
                "type": "ObjectNodeAttributes",
                "name": title(thing),
                "position": position,
                "semantic_label": labels.index(thing.label) + 1,
                "bounding_box": {
                    "type": "RAABB",
                    "dimensions": thing.size.tolist(),
                    "world_P_center": position,
                    "world_R_center": turn,
                },
                "world_R_object": turn,
                "registered": True,
                "color": {"r": red, "g": green, "b": blue, "a": 255},
                "last_update_time_ns": max(_nanoseconds(thing.last_seen), 0),
                "metadata": thing_to_dict(thing),
                "semantic_feature": {"rows": 0, "cols": 0, "data": None},
                "mesh_connections": [],
                "is_active": False,
                "is_predicted": False,
            },
        }


def _agent_nodes(
    agents: list[int], stamps: np.ndarray, poses: np.ndarray, R_world_upright: np.ndarray
) -> Iterator[dict[str, Any]]:
    for number, (symbol, stamp, pose) in enumerate(zip(agents, stamps, poses, strict=True)):
        yield {
            "id": symbol,
            **AGENT,
            "attributes": {
                "type": "AgentNodeAttributes",
                "position": (R_world_upright.T @ pose[:3, 3]).tolist(),
                "world_R_body": _quaternion(R_world_upright.T @ pose[:3, :3]),
                "timestamp": _nanoseconds(stamp),
                "last_update_time_ns": max(_nanoseconds(stamp), 0),
                "external_key": number,
                "dbow_ids": None,
                "dbow_values": None,
                "metadata": {},
                "is_active": False,
                "is_predicted": False,
            },
        }


def _numbers(ids: Sequence[str]) -> list[int]:
    """A number for each id: the one it ends in, where that is its alone, else one that is free."""
    ends = [int(match[1]) if (match := NUMBERED.fullmatch(one)) else None for one in ids]
    times = Counter(ends)
    own = [number if times[number] == 1 else None for number in ends]
    free = max((number for number in ends if number is not None), default=-1) + 1
    spare = iter(range(free, free + len(ids)))
    return [next(spare) if number is None else number for number in own]


def _symbol(letter: str, number: int) -> int:
    """spark_dsg's node id: a letter in the highest byte."""
    return (ord(letter) << 56) | number


def _edge(source: int, target: int) -> dict[str, Any]:
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False, "metadata": {}}
    return {"source": source, "target": target, "info": info}


def _quaternion(R: np.ndarray) -> dict[str, float]:
    x, y, z, w = quaternions(R).tolist()
    return {"w": w, "x": x, "y": y, "z": z}


def _nanoseconds(stamp: float) -> int:
    """spark_dsg's unit; its times of an update have no sign, those of the camera have one."""
    return round(float(stamp) * 1e9)

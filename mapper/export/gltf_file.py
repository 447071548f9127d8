"""glTF 2.0: boxes, cloud and path for viewers, game engines and browsers.

    map (turns the map's axes to glTF's y up; extras say what the map's axes are)
     ├─ "mug thing-0007"  a node a thing: a unit cube, moved, turned and scaled; extras as in map.json
     ├─ "cloud"           points with colours
     └─ "trajectory"      lines from camera to camera; extras: their stamps

Everything below the root node is in the map's own axes and metres.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..map.atomic import write_atomic
from ..map.boxes import CORNER_SIGNS, EDGES, box_axes
from ..map.map_file import thing_to_dict
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from ..map.thing import Thing
from .chosen import DEFAULT_POINTS, read_path, read_points, read_things, title
from .colors import class_color, linear_color
from .gltf_buffers import GltfBuffers
from .rotations import Y_UP, quaternions

POINTS, LINES, TRIANGLES = 0, 1, 4  # glTF 2.0, section 3.7.2.1
FACE_OPACITY = 0.35  # what is in a box shows through it
SMALLEST = 1e-6  # m; a scale of zero cannot be inverted
UNLIT = "KHR_materials_unlit"  # colours as they are
PATH_COLOR = np.array([255, 120, 0], dtype=np.uint8)
# two triangles for each face of the corners in `boxes`, counter-clockwise from outside
TRIANGLE_CORNERS = np.array(
    [
        *([0, 3, 2], [0, 2, 1], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
    ],
    dtype=np.uint16,
)


def export_glb(folder: OutputFolder, file: Path, *, points: int = DEFAULT_POINTS, min_existence: float = 0.0) -> int:
    """Write the map as one binary file; returns the number of things.

    Args:
        folder: of the run.
        file: to write.
        points: of the cloud at most; 0 for none.
        min_existence: things below it are left out.
    """
    document, buffers, count = _scene(folder, points, min_existence)
    write_atomic(file, buffers.to_glb(document))
    return count


def export_gltf(folder: OutputFolder, file: Path, *, points: int = DEFAULT_POINTS, min_existence: float = 0.0) -> int:
    """The same as `export_glb` in JSON, the buffer embedded."""
    document, buffers, count = _scene(folder, points, min_existence)
    write_atomic(file, buffers.to_gltf(document))
    return count


def _scene(folder: OutputFolder, points: int, min_existence: float) -> tuple[dict[str, Any], GltfBuffers, int]:
    object_map = read_things(folder, min_existence)
    scene = _Scene(object_map)
    scene.add_things(object_map)
    scene.add_cloud(*read_points(folder, points))
    scene.add_path(*read_path(folder))
    return scene.document(), scene.buffers, len(object_map)


class _Scene:
    """Lists of a glTF document; node 0 is the root, of which all others are children."""

    def __init__(self, object_map: ObjectMap) -> None:
        self.buffers = GltfBuffers()
        self._meshes: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        R_root_map = Y_UP @ object_map.R_world_upright.T
        about = {
            "source": object_map.source,
            "frame": str(object_map.frame),
            "units": "metres, seconds, radians",
            "up": object_map.up.direction.tolist(),
            "axes": "nodes below this one are in the map's axes, in which `up` is; it turns them to glTF's y up",
            "classes": list(object_map.classes),
        }
        self._nodes: list[dict[str, Any]] = [
            {"name": "map", "rotation": quaternions(R_root_map).tolist(), "extras": about}
        ]

    def document(self) -> dict[str, Any]:
        """Everything but the buffer; lists that are empty are left out, as glTF demands."""
        root, *others = self._nodes
        children = {"children": list(range(1, len(self._nodes)))} if others else {}
        lists = {"meshes": self._meshes, "materials": self._materials}
        return {
            "asset": {"version": "2.0", "generator": "thingmap"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{**root, **children}, *others],
            **({"extensionsUsed": [UNLIT]} if self._materials else {}),
            **{name: values for name, values in lists.items() if values},
        }

    def add_things(self, object_map: ObjectMap) -> None:
        """A node a thing; things of one label share their mesh, a unit cube."""
        if not object_map.things:
            return
        cube = self.buffers.add((CORNER_SIGNS / 2.0).astype(np.float32), bounds=True)
        faces = self.buffers.add(TRIANGLE_CORNERS.ravel())
        edges = self.buffers.add(EDGES.astype(np.uint16).ravel())
        mesh_of: dict[str, int] = {}
        for thing in object_map.things:
            if thing.label not in mesh_of:
                mesh_of[thing.label] = self._add_box(thing.label, cube, faces, edges)
            self._nodes.append(_node(thing, mesh_of[thing.label], object_map.R_world_upright))

    def add_cloud(self, points: np.ndarray, colors: np.ndarray) -> None:
        """(M, 3) metres and (M, 3) uint8 sRGB; 16 bits a colour, as dark ones need in linear light."""
        if not len(points):
            return
        light = np.ones((len(points), 4))
        light[:, :3] = linear_color(colors)
        attributes = {
            "POSITION": self.buffers.add(points.astype(np.float32), bounds=True),
            "COLOR_0": self.buffers.add(np.round(light * 65535.0).astype(np.uint16), normalized=True),
        }
        material = self._add_material("cloud", np.full(3, 255, dtype=np.uint8))
        mesh = self._add_mesh("cloud", [{"attributes": attributes, "mode": POINTS, "material": material}])
        self._nodes.append({"name": "cloud", "mesh": mesh})

    def add_path(self, stamps: np.ndarray, T_world_camera: np.ndarray) -> None:
        """(N,) seconds and (N, 4, 4), at least two. Pairs of indices, as trimesh for one reads no strips."""
        if len(stamps) < 2:
            return
        position = self.buffers.add(T_world_camera[:, :3, 3].astype(np.float32), bounds=True)
        material = self._add_material("trajectory", PATH_COLOR)
        pairs = np.arange(len(stamps), dtype=np.uint32).repeat(2)[1:-1]
        lines = {"attributes": {"POSITION": position}, "indices": self.buffers.add(pairs), "mode": LINES}
        mesh = self._add_mesh("trajectory", [{**lines, "material": material}])
        self._nodes.append({"name": "trajectory", "mesh": mesh, "extras": {"stamps": stamps.tolist()}})

    def _add_box(self, label: str, cube: int, faces: int, edges: int) -> int:
        color = class_color(label)
        surface = {"mode": TRIANGLES, "indices": faces, "material": self._add_material(label, color, FACE_OPACITY)}
        outline = {"mode": LINES, "indices": edges, "material": self._add_material(f"{label} edges", color)}
        return self._add_mesh(label, [{"attributes": {"POSITION": cube}, **part} for part in (surface, outline)])

    def _add_mesh(self, name: str, primitives: list[dict[str, Any]]) -> int:
        self._meshes.append({"name": name, "primitives": primitives})
        return len(self._meshes) - 1

    def _add_material(self, name: str, color: np.ndarray, opacity: float = 1.0) -> int:
        factor = [*np.round(linear_color(color), 6).tolist(), opacity]
        see_through = {"alphaMode": "BLEND", "doubleSided": True} if opacity < 1.0 else {}
        surface = {"baseColorFactor": factor, "metallicFactor": 0.0, "roughnessFactor": 1.0}
        unlit = {} if see_through else {"extensions": {UNLIT: {}}}
        self._materials.append({"name": name, "pbrMetallicRoughness": surface, **see_through, **unlit})
        return len(self._materials) - 1


def _node(thing: Thing, mesh: int, R_world_upright: np.ndarray) -> dict[str, Any]:
    return {
        "name": title(thing),
        "mesh": mesh,
        "translation": thing.position.tolist(),
        "rotation": quaternions(box_axes(thing.yaw, R_world_upright)).tolist(),
        "scale": np.maximum(thing.size, SMALLEST).tolist(),
        "extras": thing_to_dict(thing),
    }

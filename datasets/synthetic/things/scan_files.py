"""One scanned thing from an OBJ or GLB file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, UserError
from ...extras import install_command
from ..mesh import Mesh
from .objects import Part
from .scan_normals import corner_normals
from .scan_textures import NOT_WHOLE, check_images, decoded, fitted, named_textures, palette

if TYPE_CHECKING:
    import trimesh

Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # from the y up that glTF prescribes


def read_scan(path: Path) -> list[Part]:
    """Surfaces of all meshes in the file, in its own units, z up.

    An OBJ is taken as z up, as scanners write it; GLB is y up by its standard. Without a texture the surface has the
    file's vertex, face or material colours, grey where there are none.

    Raises:
        UserError: the package that reads meshes is not installed.
        InputError: no triangles, or a texture or material file that is named but cannot be read.
    """
    named = named_textures(path) if path.suffix.lower() == ".obj" else {}
    if path.suffix.lower() == ".glb":
        check_images(path)
    parts = []
    for mesh, T_file_mesh in _meshes(path):
        vertices = np.asarray(mesh.vertices, np.float64) @ T_file_mesh[:3, :3].T + T_file_mesh[:3, 3]
        if path.suffix.lower() == ".glb":
            vertices = vertices @ Z_UP.T
        parts.append(_part(path, mesh, vertices, named))
    if not parts:
        raise InputError(path, "a mesh with triangles", "none", "export the object as a triangle mesh")
    return parts


def _meshes(path: Path) -> Iterator[tuple[trimesh.Trimesh, np.ndarray]]:
    """Meshes with their (4, 4) place in the file; lines and points are no surfaces and left out."""
    try:
        import trimesh  # slow to import, and only scans need it
        from PIL import Image  # noqa: F401  trimesh says nothing where it is missing and drops the textures
    except ImportError as error:
        raise UserError(
            f"{path}: expected the packages that read meshes, found none ({error}); "
            f"install them with: {install_command('meshes')}"
        ) from None
    try:
        scene = trimesh.load_scene(path, process=False)
    except Exception as error:  # whatever a damaged file makes the reader stumble over
        raise InputError(path, "a mesh file", f"something that cannot be read ({error})", NOT_WHOLE) from None
    for node in scene.graph.nodes_geometry:
        T_file_mesh, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            yield mesh, np.asarray(T_file_mesh)


def _part(path: Path, mesh: trimesh.Trimesh, vertices: np.ndarray, named: dict[str, Path]) -> Part:
    """The mesh with every triangle's corners apart, so that colours and creases need no special case."""
    triangles = np.asarray(mesh.faces, np.int64)
    if not np.all(np.isfinite(vertices)):
        raise InputError(path, "vertices with finite coordinates", "some that are not", NOT_WHOLE)
    texture, uv = _texture(path, mesh, triangles, named)
    corners = vertices[triangles].reshape(-1, 3)
    normals = corner_normals(vertices, triangles)
    return Part(Mesh(corners, normals, uv, np.arange(len(corners)).reshape(-1, 3)), texture)


def _texture(
    path: Path, mesh: trimesh.Trimesh, triangles: np.ndarray, named: dict[str, Path]
) -> tuple[np.ndarray, np.ndarray]:
    """Texture and (3 T, 2) coordinates of all corners."""
    visual: Any = mesh.visual
    uv, material = getattr(visual, "uv", None), getattr(visual, "material", None)
    picture = None if material is None or uv is None else _picture(path, material, named)
    factor = getattr(material, "baseColorFactor", None)  # of glTF, in linear light; display values are its root
    tint = np.ones(3) if factor is None else np.sqrt(np.asarray(factor, np.float64)[:3] / 255.0)
    if picture is not None:
        tinted = (fitted(picture) * tint + 0.5).astype(np.uint8)
        return tinted, np.asarray(uv, np.float64)[triangles].reshape(-1, 2)
    if factor is not None:
        colours = np.tile((255.0 * tint + 0.5).astype(np.uint8), (len(triangles), 1))
    elif material is not None:
        colours = np.tile(np.asarray(material.main_color)[:3], (len(triangles), 1))
    else:
        colours = np.asarray(visual.face_colors)[:, :3]
    return palette(colours)


def _picture(path: Path, material: Any, named: dict[str, Path]) -> np.ndarray | None:
    """(H, W, 3) uint8 of the material's texture, None without."""
    if material.name in named:
        return decoded(named[material.name].read_bytes(), path, named[material.name].name)
    image = getattr(material, "baseColorTexture", None)
    if image is None:
        return None
    try:
        return np.asarray(image.convert("RGB"))
    except OSError as error:
        raise InputError(path, "a readable texture", str(error), NOT_WHOLE) from None

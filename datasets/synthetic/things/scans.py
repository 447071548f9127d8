"""Scanned things: a folder of textured OBJ or GLB meshes, one mesh per object."""

from __future__ import annotations

import json
import logging
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..mesh import Mesh
from .objects import Model, Part, standing
from .scan_files import read_scan

LABELS = "labels.json"
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}  # metres
EXTENTS = (0.005, 10.0)  # metres: the largest extent of anything that is scanned in metres lies between
MANY_TRIANGLES = 50_000  # of one object, above which rendering gets slow
ALIASES = {  # other names of the procedural classes, as in factors/class_sizes.yaml
    "mug": "coffee mug",
    "coffee cup": "coffee mug",
    "baseball cap": "cap",
    "water bottle": "bottle",
    "beverage can": "soda can",
    "coke can": "soda can",
    "torch": "flashlight",
}
NUMBER = re.compile(r"^\d+([-_][a-z])?[-_ ]+(?=\D)")  # such as 025_ or 065-a_

logger = logging.getLogger(__name__)


def load_scans(folder: Path) -> tuple[Model, ...]:
    """All scans below a folder, upright as in their files, standing on z = 0, metres, in the order of their paths.

    A scan is called after the folder that holds it and no other scan (of several, the outermost), or else after its
    file. Its class is that name without a leading number: `025_mug/google_16k/textured.obj` is `025_mug`, class mug,
    which `ALIASES` makes a coffee mug. A file `labels.json` in the folder overrides: `{"025_mug": "cup"}`. It may
    state the unit of all files too, `{"unit": "mm"}`; files without are in metres.

    Raises:
        UserError: the package that reads meshes is not installed.
        InputError: no such folder, no mesh in it, one that cannot be used (see `read_scan`), one whose size cannot be
            in metres, two scans of one name, or labels that fit no scan.
    """
    files = scan_names(folder)
    labels, scale = _read_labels(folder, files)
    models = []
    for name, path in files.items():
        parts = read_scan(path)
        _check_size(folder, path, parts, scale)
        triangles = sum(len(part.mesh.triangles) for part in parts)
        if triangles > MANY_TRIANGLES:
            logger.warning("%s: %d triangles, more than %d; rendering is slower", path, triangles, MANY_TRIANGLES)
        label = labels.get(name, _label(name))
        models.append(standing(label, [replace(part, mesh=_scaled(part.mesh, scale)) for part in parts]))
    return tuple(models)


def scan_names(folder: Path) -> dict[str, Path]:
    """Name to mesh file of all scans below a folder.

    Raises:
        InputError: no such folder, no mesh in it, or two scans of one name.
    """
    if not folder.is_dir():
        raise InputError(folder, "a folder of OBJ or GLB meshes", "no such folder", "give the folder of the meshes")
    files = sorted(path for path in folder.rglob("*") if path.suffix.lower() in (".obj", ".glb") and path.is_file())
    if not files:
        raise InputError(folder, "OBJ or GLB meshes in it", "none", "give the folder of the meshes")
    names: dict[str, Path] = {}
    for path in files:
        inside = [place for place in path.relative_to(folder).parents if place.name]
        alone = [p.name for p in inside if sum(file.is_relative_to(folder / p) for file in files) == 1]
        name = alone[-1] if alone else path.stem
        if name in names:
            found = f"{names[name].relative_to(folder)} and {path.relative_to(folder)}, both {name!r}"
            raise InputError(folder, "one mesh per object", found, "keep one of them, or rename their folders")
        names[name] = path
    return names


def _label(name: str) -> str:
    """The class a name tells."""
    words = re.sub(r"[_\s]+", " ", NUMBER.sub("", name)).strip().lower()
    return ALIASES.get(words, words)


def _read_labels(folder: Path, files: dict[str, Path]) -> tuple[dict[str, str], float]:
    """Name to class as the folder's own file states, and metres per unit of the meshes."""
    path, remedy = folder / LABELS, f'write it as {{"{next(iter(files))}": "class"}}'
    if not path.is_file():
        return {}, 1.0
    try:
        labels = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(path, "JSON", str(error), remedy) from None
    if not isinstance(labels, dict) or not all(isinstance(text, str) and text.strip() for text in labels.values()):
        raise InputError(path, "an object of names and classes", "something else", remedy)
    unit = labels.pop("unit", "m")
    if unit not in UNITS:
        raise InputError(path, f"a unit of {', '.join(UNITS)}", repr(unit), "name one of them")
    unknown = sorted(set(labels) - set(files))
    if unknown:
        raise InputError(path, f"names of scans ({', '.join(files)})", ", ".join(unknown), "correct or remove them")
    return labels, UNITS[unit]


def _check_size(folder: Path, path: Path, parts: list[Part], scale: float) -> None:
    """Refuse a mesh that is not in the unit it should be in."""
    points = np.concatenate([part.mesh.vertices for part in parts])
    largest = float(np.ptp(points, axis=0).max()) * scale
    if not EXTENTS[0] <= largest <= EXTENTS[1]:
        expected = f"an object from {EXTENTS[0]:g} to {EXTENTS[1]:g} metres"
        remedy = f'if the files are in millimetres, say so in {folder / LABELS}: {{"unit": "mm"}}'
        raise InputError(path, expected, f"one of {largest:g}", remedy)


def _scaled(mesh: Mesh, scale: float) -> Mesh:
    return mesh if scale == 1.0 else Mesh(mesh.vertices * scale, mesh.normals, mesh.uv, mesh.triangles)

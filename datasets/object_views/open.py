"""One way in: a folder of crops, clouds, meshes or annotated images, or a sequence with truth, becomes views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..open import LOADERS, SAMPLE_PREFIX, SYNTH_PREFIX, contents, open_sequence
from ..paths import user_path
from . import coco_folder, pcd_views, washington
from .object_view import ObjectViews
from .sequence_views import sequence_views

MESHES = "textured *.obj or *.glb"


@dataclass(frozen=True, slots=True)
class Source:
    """One kind of views.

    Attributes:
        name: what people call it.
        layout: the files it is recognised by, for people.
        holds: whether a path holds it.
        open: its views.
    """

    name: str
    layout: str
    holds: Callable[[Path], bool]
    open: Callable[[Path], ObjectViews]


def _scan_views(folder: Path) -> ObjectViews:
    from .turntable import scan_views  # the renderer is slow to import

    return scan_views(folder)


def _has_meshes(path: Path) -> bool:
    return any(file.suffix.lower() in (".obj", ".glb") for file in path.rglob("*"))


SOURCES = (
    Source("crops", washington.LAYOUT, washington.holds_crops, washington.washington_views),
    Source("clouds", pcd_views.LAYOUT, pcd_views.holds_clouds, pcd_views.pcd_views),
    Source("COCO", coco_folder.LAYOUT, lambda p: bool(coco_folder.coco_files(p)), coco_folder.coco_views),
    Source("meshes", MESHES, _has_meshes, _scan_views),
)
SEQUENCE = f"a sequence with truth, also {SYNTH_PREFIX}PRESET or {SAMPLE_PREFIX}NAME"


def open_object_views(spec: str | Path) -> ObjectViews:
    """Opens views of objects; what kind of source it is, the files tell.

    Args:
        spec: a folder (see `SOURCES`), a JSON file in COCO's format, `synth:PRESET` or `sample:NAME`.

    Raises:
        InputError: there is nothing of that name, nothing in it is recognised or several kinds of source are, there is
            no usable view, or a file is damaged.
        UserError: a synthetic line is wrong, or the objects of the sequence are not known.
    """
    views = _open(spec)
    if len(views) == 0:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in list(views.skipped.items())[:3])
        found = f"{len(views.skipped)} that cannot be used ({reasons})" if views.skipped else "none"
        raise InputError(spec, "views of objects", found, "give a source with usable views")
    return views


def _open(spec: str | Path) -> ObjectViews:
    if str(spec).startswith((SYNTH_PREFIX, SAMPLE_PREFIX)):
        return sequence_views(open_sequence(spec))
    path = user_path(spec)
    known = "; or ".join([*(f"{source.layout} ({source.name})" for source in SOURCES), SEQUENCE])
    if path.is_file() and path.suffix.lower() == ".json":
        return coco_folder.coco_views(path)
    if not path.is_dir():
        found = "a file" if path.exists() else "no such folder"
        raise InputError(path, f"a folder of {known}", found, "check the path")
    held = [source for source in SOURCES if source.holds(path)]
    if len(held) == 1:
        return held[0].open(path)
    if held:
        found = ", ".join(source.name for source in held)
        raise InputError(path, "one kind of views", found, "put each kind into a folder of its own and give both")
    if any(loader.find(path) for loader in LOADERS):  # last: single clouds look like a LiDAR's sweeps as well
        return sequence_views(open_sequence(path))
    raise InputError(path, f"a folder of {known}", contents(path), "give a folder of one of these")

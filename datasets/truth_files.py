"""Truth beside a sequence in a plain folder (see `folder`), in a folder of its own called `truth`.

    truth.json            schema, source, up, classes, objects, clutter, configuration, names of the frames
    frames.npz            what can be seen of every object in every frame (see `truth_tables`)
    instances/000000.png  16-bit: 1 + id of the object or clutter that a pixel shows, 0 for none; numbered from 0
    cloud.ply             the labelled cloud, where `truth.json` says "cloud": true

An object or clutter is `{"id": 0, "label": "cup", "position": [x, y, z], "size": [w, d, h], "yaw": 0.3}`: an upright
box, metres, world of the poses; size along its own axes before yaw (radians about "up"). Null: unknown. The
configuration is that of the renderer, as far as this format goes any object: from it the sequence can be made again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError, UserError
from .json_record import JsonRecord, read_json_record
from .truth import TrueObject

SCHEMA = "thingmap-truth/1"
FOLDER = "truth"
REMEDY = f"write the sequence again with `thingmap synth`, or remove {FOLDER}/ to use it without its truth"


@dataclass(frozen=True, slots=True, eq=False)
class TruthRecord:
    """What `truth.json` holds.

    Attributes:
        source: the line that renders the same sequence, as far as a line can tell.
        up: (3,) unit vector in world axes.
        classes: of the objects.
        objects: things of these classes.
        clutter: things of no class; their ids go on from the objects'.
        configuration: of the renderer, exactly; values that JSON can hold.
        names: of the N frames.
        has_cloud: whether there is a labelled cloud.
    """

    source: str
    up: np.ndarray
    classes: tuple[str, ...]
    objects: tuple[TrueObject, ...]
    clutter: tuple[TrueObject, ...]
    configuration: Mapping[str, Any]
    names: tuple[str, ...]
    has_cloud: bool


@dataclass(frozen=True, slots=True)
class TruthPaths:
    """Where the parts lie.

    Attributes:
        folder: the `truth` folder itself.
    """

    folder: Path

    @property
    def record(self) -> Path:
        return self.folder / "truth.json"

    @property
    def frames(self) -> Path:
        return self.folder / "frames.npz"

    @property
    def cloud(self) -> Path:
        return self.folder / "cloud.ply"

    @property
    def instances(self) -> Path:
        """Folder of the instance images."""
        return self.folder / "instances"

    def instance_image(self, index: int) -> Path:
        return self.instances / f"{index:06d}.png"


def write_record(path: Path, record: TruthRecord) -> None:
    """Writes `truth.json`, whole or not at all; numbers keep all their digits.

    Raises:
        UserError: the file cannot be written.
    """
    document = {
        "schema": SCHEMA,
        "source": record.source,
        "up": record.up.tolist(),
        "classes": list(record.classes),
        "objects": [_plain(thing) for thing in record.objects],
        "clutter": [_plain(thing) for thing in record.clutter],
        "cloud": record.has_cloud,
        "configuration": dict(record.configuration),
        "names": list(record.names),
    }
    lines = ",\n".join(f'"{key}": {_lines(value)}' for key, value in document.items())
    write_whole(path, f"{{{lines}}}\n".encode())


def read_record(path: Path) -> TruthRecord:
    """Reads `truth.json`.

    Raises:
        InputError: the file is missing or damaged; it says where.
    """
    record = read_json_record(path, f"truth of a sequence ({SCHEMA})", REMEDY)
    if "schema" not in record or record.anything("schema") != SCHEMA:
        found = repr(record.anything("schema")) if "schema" in record else "none"
        raise InputError(path, f'the schema "{SCHEMA}"', found, REMEDY)
    classes = record.names("classes")
    objects = tuple(_thing(item) for item in record.records("objects"))
    clutter = tuple(_thing(item) for item in record.records("clutter"))
    ids = [thing.id for thing in (*objects, *clutter)]
    if len(set(ids)) < len(ids):
        raise InputError(path, "an id of its own for every object and clutter", f"ids {ids}", REMEDY)
    if strange := sorted({thing.label for thing in objects} - set(classes)):
        raise InputError(path, f"labels of the classes {', '.join(classes)}", ", ".join(strange), REMEDY)
    configuration = record.anything("configuration")
    if not isinstance(configuration, dict):
        raise InputError(path, "an object at configuration", json.dumps(configuration)[:60], REMEDY)
    names = record.names("names")
    if paths := [name for name in names if Path(name).name != name]:  # they are stems of files that may be replaced
        raise InputError(path, "names of frames without a folder", repr(paths[0]), REMEDY)
    up = record.vector("up")
    if abs(np.linalg.norm(up) - 1.0) > 1e-6:
        raise InputError(path, "a vector of length 1 at up", str(up.tolist()), REMEDY)
    return TruthRecord(
        source=record.name("source"),
        up=up,
        classes=classes,
        objects=objects,
        clutter=clutter,
        configuration=configuration,
        names=names,
        has_cloud=record.flag("cloud"),
    )


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file by way of a temporary one beside it, so that it is the old file or the whole new one.

    Raises:
        UserError: it cannot be written.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix}")
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError as error:
        remedy = "choose a place that you may write to and that has room"
        raise UserError(f"{path}: cannot be written ({error.strerror or error}); {remedy}") from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def _lines(value: Any) -> str:
    """JSON with one line for each thing: for people who look into the file."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join("  " + json.dumps(item, ensure_ascii=False) for item in value) + "\n]"
    return json.dumps(value, ensure_ascii=False)


def _plain(thing: TrueObject) -> dict[str, Any]:
    return {
        "id": thing.id,
        "label": thing.label,
        "position": _numbers(thing.position),
        "size": _numbers(thing.size),
        "yaw": float(thing.yaw),
    }


def _numbers(vector: np.ndarray) -> list[float] | None:
    return np.asarray(vector, dtype=np.float64).tolist() if np.isfinite(vector).all() else None


def _thing(item: JsonRecord) -> TrueObject:
    position, size = item.vector_or_unknown("position"), item.vector_or_unknown("size", least=0.0)
    return TrueObject(item.count("id"), item.name("label"), position, size, item.number("yaw"))

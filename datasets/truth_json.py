"""Objects of a place in a small JSON file, for recordings of which somebody measured a few.

    {"objects": [{"name": "white mug", "class": "cup", "position": [x, y, z], "tolerance": 0.08,
                  "size": [w, d, h], "yaw": 0.3}, ...],
     "known_false_detections": [{"class": "bowl", "position": [x, y, z], "truth": "the white mug"}, ...]}

Metres, world of the sequence's poses. The tolerance says how well a position is known; size (full extents) and yaw
(radians about "up") are optional, as are the false detections: things that detectors take for an object of that class.
Other keys are free for remarks. Not every object of the place need be listed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .ground_truth import GroundTruth
from .json_record import JsonRecord, read_json_record
from .truth import TrueObject

FILE_NAME = "objects_derived.json"
FORM = 'objects as {"objects": [{"name": ..., "class": ..., "position": [x, y, z], "tolerance": ...}, ...]}'
REMEDY = "correct the file; datasets/truth_json.py describes its form"
FALSE_RADIUS = 0.25  # m about a known false detection, at least: what is seen there moves with the view


@dataclass(frozen=True, slots=True, eq=False)
class KnownObject:
    """An object of the place, or what a detector takes for one.

    Attributes:
        name: for people.
        thing: class, position, and size where it is known (else NaN).
        tolerance: metres about the position.
    """

    name: str
    thing: TrueObject
    tolerance: float


@dataclass(frozen=True, slots=True, eq=False)
class KnownObjects:
    """What the file holds; ids of the false detections go on from the objects'."""

    objects: tuple[KnownObject, ...]
    false_detections: tuple[KnownObject, ...]


def read_known_objects(path: Path) -> KnownObjects:
    """Reads the file.

    Raises:
        InputError: it is missing, is no JSON, or a value is missing or impossible; it says which.
    """
    record = read_json_record(path, FORM, REMEDY)
    objects = tuple(_object(item, k) for k, item in enumerate(record.records("objects")))
    items = record.records("known_false_detections") if "known_false_detections" in record else ()
    return KnownObjects(objects, tuple(_false_detection(item, len(objects) + k) for k, item in enumerate(items)))


def truth_of_known_objects(path: Path) -> GroundTruth:
    """The file as truth without poses or images, `complete` being false; raises `InputError` as the reader does.

    The classes of false detections are among `classes`: that nothing of them is there is known.
    """
    known = read_known_objects(path)
    everything = (*known.objects, *known.false_detections)
    return GroundTruth(
        name=path.resolve().stem,
        classes=tuple(dict.fromkeys(item.thing.label for item in everything)),
        objects=tuple(item.thing for item in known.objects),
        tolerance={item.thing.id: item.tolerance for item in everything},
        complete=False,
        false_detections=tuple(item.thing for item in known.false_detections),
    )


def _object(item: JsonRecord, number: int) -> KnownObject:
    return KnownObject(item.name("name"), _thing(item, number), item.number("tolerance", least=0.0))


def _false_detection(item: JsonRecord, number: int) -> KnownObject:
    tolerance = item.number("tolerance", least=0.0) if "tolerance" in item else 0.0
    instead = item.name("truth") if "truth" in item else "nothing"
    return KnownObject(f"no {item.name('class')}: {instead}", _thing(item, number), max(tolerance, FALSE_RADIUS))


def _thing(item: JsonRecord, number: int) -> TrueObject:
    size = item.vector("size", least=0.0) if "size" in item else np.full(3, np.nan)
    yaw = item.number("yaw") if "yaw" in item else 0.0
    return TrueObject(number, item.name("class"), item.vector("position"), size, yaw)

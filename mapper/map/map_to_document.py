"""A map as the JSON values of a "thingmap/1" document, and as its text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..edits.stored import applied_to_dict, thing_edits_to_dict
from .object_map import ObjectMap
from .thing import Thing

SCHEMA = "thingmap/1"
DOUBTFUL_BELOW = 0.5  # existence: what more likely is not there is not written, unless asked for
NEGLIGIBLE = 1e-4  # class probability that is not written


def to_document(object_map: ObjectMap, include_doubtful: bool = False) -> dict[str, Any]:
    """The map as plain JSON values.

    Class probabilities below 1e-4 are left out and the others are kept as they are, not scaled up: what is missing from
    a sum of 1 belongs to the classes that are absent, and dividing by the sum renormalises.
    """
    up, labels = object_map.up, object_map.labels
    camera = {} if object_map.camera is None else {"camera": asdict(object_map.camera)}
    labelled = {} if labels is None else {"labels": {"file": labels.file.name, "points": dict(labels.points)}}
    return {
        "schema": SCHEMA,
        "source": object_map.source,
        "frame": str(object_map.frame),
        "up": {
            "direction": up.direction.tolist(),
            "std_deg": float(np.degrees(up.std_rad)),
            "source": up.source,
        },
        **camera,
        "classes": list(object_map.classes),
        **labelled,
        **applied_to_dict(object_map.edits),
        "things": [thing_to_dict(thing) for thing in written_things(object_map, include_doubtful)],
    }


def written_things(object_map: ObjectMap, include_doubtful: bool) -> list[Thing]:
    return [thing for thing in object_map.things if include_doubtful or thing.existence >= DOUBTFUL_BELOW]


def format_document(document: Mapping[str, Any]) -> str:
    """JSON text with one line for each value of a thing: short enough to read, one change a line to compare."""
    lines = []
    for key, value in document.items():
        if key != "things":
            lines.append(f" {json.dumps(key)}: {_compact(value)}")
            continue
        things = (",\n".join(f"   {json.dumps(k)}: {_compact(v)}" for k, v in thing.items()) for thing in value)
        body = ",\n".join(f"  {{\n{thing}\n  }}" for thing in things)
        lines.append(f' "things": [\n{body}\n ]' if body else ' "things": []')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def thing_to_dict(thing: Thing) -> dict[str, Any]:
    """One thing of the document; its classes are ordered by probability."""
    ranked = sorted(thing.class_posterior.items(), key=lambda item: (-item[1], item[0]))
    return {
        "id": thing.id,
        "label": thing.label,
        "probability": thing.probability,
        "existence": thing.existence,
        "class_posterior": {label: p for label, p in ranked if p >= NEGLIGIBLE or label == thing.label},
        "position": thing.position.tolist(),
        "position_covariance": thing.position_covariance.tolist(),
        "size": thing.size.tolist(),
        "size_std": thing.size_std.tolist(),
        "yaw": thing.yaw,
        "first_seen": thing.first_seen,
        "last_seen": thing.last_seen,
        "evidence": asdict(thing.evidence),
        **_points_to_dict(thing),
        **thing_edits_to_dict(thing),
    }


def _points_to_dict(thing: Thing) -> dict[str, Any]:
    """What labelling has added to a thing; nothing where it was not labelled."""
    values = {"points": thing.points, "volume": None if thing.volume is None else thing.volume.to_dict()}
    return {name: value for name, value in values.items() if value is not None}

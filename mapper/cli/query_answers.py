"""Answers to questions, for people and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..map.text import probability_text
from .tables import print_table

if TYPE_CHECKING:
    from ..queries.answer import Answer
    from ..queries.last_seen import LastView
    from ..queries.sightings import ExpectedDetection, Sighting
    from ..queries.viewpoints import Viewpoint


def answer_to_dict(answer: Answer) -> dict[str, Any]:
    """The whole thing, with the probability of being what was asked for, and the distance where there is one."""
    from ..map.map_file import thing_to_dict

    distance = {} if answer.distance is None else {"distance": answer.distance, "distance_std": answer.distance_std}
    return {"answer_probability": answer.probability, **distance, **thing_to_dict(answer.thing)}


def last_view_to_dict(view: LastView) -> dict[str, Any]:
    return {
        "id": view.thing.id,
        "label": view.thing.label,
        "answer_probability": view.probability,
        "stamp": view.stamp,
        "frame": view.frame,
        "keyframe": view.keyframe,
        "T_world_camera": None if view.T_world_camera is None else view.T_world_camera.tolist(),
        "distance": view.distance,
        "found_as": view.found_as,
        "score": view.score,
        "visible": view.visible,
    }


def sighting_to_dict(sighting: Sighting | ExpectedDetection) -> dict[str, Any]:
    std = getattr(sighting, "xyxy_std", None)
    return {
        "id": sighting.thing.id,
        "label": sighting.thing.label,
        "answer_probability": sighting.probability,
        "share": sighting.share,
        "xyxy": np.asarray(sighting.xyxy).tolist(),
        # of a thing that is not wholly in front of the camera nothing is known; JSON has no NaN
        **({} if std is None else {"xyxy_std": [float(s) if np.isfinite(s) else None for s in std]}),
    }


def viewpoint_to_dict(viewpoint: Viewpoint) -> dict[str, Any]:
    return {
        "T_world_camera": viewpoint.T_world_camera.tolist(),
        "gain_bits": viewpoint.gain_bits,
        "things": list(viewpoint.things),
        "visible": list(viewpoint.visible),
        "visited": viewpoint.visited,
    }


def print_last_views(views: Sequence[LastView]) -> None:
    """When, in which frame, from where, and by what evidence."""
    rows = []
    for view in views:
        known = "" if view.found_as is None else view.found_as + ("" if view.score is None else f" {view.score:.2f}")
        seen = "" if view.visible is None else f"{view.visible:.2f}"
        rows.append(
            (
                *(f"{view.stamp:.3f}", view.frame or "not on record", _place(view.T_world_camera)),
                *("" if view.distance is None else f"{view.distance:.2f}", known, seen),
                *(probability_text(view.probability), view.thing.label, view.thing.id),
            )
        )
    headers = ("last seen, s", "frame", "camera x, y, z, m", "distance, m", "found as", "visible", "P(asked for)")
    print_table((*headers, "label", "id"), rows)


def print_sightings(sightings: Sequence[Sighting | ExpectedDetection], head: str) -> None:
    """What is seen from a place; `head` says what the probability is of."""
    rows = []
    for sighting in sightings:
        std = getattr(sighting, "xyxy_std", None)
        errors = ("",) * 4 if std is None else tuple(f"±{s:.0f}" for s in std)
        sides = "  ".join(f"{side:.0f}{error}" for side, error in zip(sighting.xyxy, errors, strict=True))
        cells = probability_text(sighting.probability), sighting.thing.label, f"{sighting.share:.2f}"
        rows.append((*cells, sides, sighting.thing.id))
    print_table((head, "label", "visible", "box x, y, x, y, px", "id"), rows)


def print_viewpoints(viewpoints: Sequence[Viewpoint]) -> None:
    """Where to look from, the most telling place first."""
    rows = []
    for view in viewpoints:
        seen = ", ".join(f"{name} {share:.2f}" for name, share in zip(view.things, view.visible, strict=True))
        looking = "  ".join(f"{value:.2f}" for value in view.T_world_camera[:3, 2])
        visited = "yes" if view.visited else "no"
        rows.append((f"{view.gain_bits:.3f}", _place(view.T_world_camera), looking, visited, seen))
    print_table(("gain, bits", "camera x, y, z, m", "looking along", "visited", "tells of (visible)"), rows)


def _place(T_world_camera: np.ndarray | None) -> str:
    return "" if T_world_camera is None else "  ".join(f"{value:.3f}" for value in T_world_camera[:3, 3])

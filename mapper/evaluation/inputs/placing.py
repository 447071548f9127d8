"""The things of a map in the truth's axes and in its words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....datasets.errors import UserError
from ....datasets.ground_truth import GroundTruth
from ....datasets.truth import NO_OBJECT, FrameTruth, PointTruth
from ...map.boxes import box_axes
from ...map.object_map import ObjectMap
from ...map.upright import upright_rotation
from ..config import EvaluationConfig
from .case import Alignment, PlacedThing, in_truth_words

NAMED = 12  # classes listed in a message


def check_classes(object_map: ObjectMap, truth: GroundTruth, config: EvaluationConfig) -> None:
    """The map knows every class that an object of the truth has, and every alias is of use.

    A map without any class was made without a detector, and lacks things rather than words for them.

    Raises:
        UserError: it does not; the message names the classes and the remedies.
    """
    mapped, true = object_map.classes, truth.classes
    if not mapped:
        return
    for name, meant in config.aliases.items():
        if not object_map.knows(name):
            raise UserError(f"alias {name}={meant}: the map has no class {name!r}; it has {_listed(mapped)}")
        if in_truth_words(meant, true, {}) is None:
            raise UserError(f"alias {name}={meant}: {truth.name} has no class {meant!r}; it has {_listed(true)}")
    said = {in_truth_words(name, true, config.aliases) for name in mapped}
    needed = {thing.label for thing in truth.objects} or set(true)
    if missing := tuple(name for name in true if name in needed and name not in said):
        rest = ",".join(name for name in true if name in needed and name in said)
        remedy = f"say what the map calls them (--alias NAME={missing[0]!r})"
        if rest:
            remedy += f", or judge only the others (--classes {rest!r})"
        raise UserError(
            f"{truth.name} has objects of classes that the map does not know: {_listed(missing)}; it knows "
            f"{_listed(mapped)}; {remedy}"
        )


def place_things(
    object_map: ObjectMap, truth: GroundTruth, alignment: Alignment, config: EvaluationConfig
) -> tuple[tuple[PlacedThing, ...], dict[str, int]]:
    """The things whose label means something in the truth, in the map's order; of the others, how many by label."""
    up = alignment.R @ object_map.up.direction if truth.up is None else truth.up
    R_truth_upright, R_map_upright = upright_rotation(up), object_map.R_world_upright
    placed: list[PlacedThing] = []
    left_out: dict[str, int] = {}
    for thing in object_map.things:
        meant = {name: in_truth_words(name, truth.classes, config.aliases) for name in thing.class_posterior}
        label = meant[thing.label]
        if label is None:
            left_out[thing.label] = left_out.get(thing.label, 0) + 1
            continue
        along = R_truth_upright.T @ alignment.R @ box_axes(thing.yaw, R_map_upright)[:, 0]
        yaw = float(np.arctan2(along[1], along[0]))
        probability = min(sum(p for name, p in thing.class_posterior.items() if meant[name] == label), 1.0)
        placed.append(PlacedThing(thing, label, alignment.apply(thing.position), yaw, probability))
    return tuple(placed), left_out


def restrict_classes(truth: GroundTruth, classes: tuple[str, ...]) -> GroundTruth:
    """The truth of some of its classes only: objects, boxes and labelled points of others become unlabelled.

    Raises:
        UserError: the truth has no such class.
    """
    chosen = [in_truth_words(name, truth.classes, {}) for name in classes]
    if unknown := tuple(name for name, found in zip(classes, chosen, strict=True) if found is None):
        raise UserError(f"{truth.name} has no class {_listed(unknown)}; it has {_listed(truth.classes)}")
    kept = tuple(name for name in truth.classes if name in chosen)
    objects = tuple(thing for thing in truth.objects if thing.label in kept)
    false = tuple(thing for thing in truth.false_detections if thing.label in kept)
    ids = np.array([thing.id for thing in objects], dtype=np.int64)
    frame_truth, point_truth = truth.frame_truth, truth.point_truth

    def frame_of(index: int) -> FrameTruth | None:
        seen = frame_truth(index) if frame_truth is not None else None
        return None if seen is None else _rows(seen, np.isin(seen.object_id, ids))

    def points() -> PointTruth:
        assert point_truth is not None
        whole = point_truth()
        code = np.array([*(kept.index(c) if c in kept else NO_OBJECT for c in truth.classes), NO_OBJECT])
        class_id = code[whole.class_id]
        object_id = None if whole.object_id is None else np.where(class_id == NO_OBJECT, NO_OBJECT, whole.object_id)
        return PointTruth(whole.points, class_id, object_id)

    return replace(
        truth,
        classes=kept,
        objects=objects,
        tolerance={thing.id: truth.tolerance[thing.id] for thing in (*objects, *false) if thing.id in truth.tolerance},
        false_detections=false,
        frame_truth=None if frame_truth is None else frame_of,
        point_truth=None if point_truth is None else points,
    )


def _rows(seen: FrameTruth, rows: np.ndarray) -> FrameTruth:
    return FrameTruth(
        seen.object_id[rows],
        seen.xyxy[rows],
        seen.xyxy_visible[rows],
        seen.visibility[rows],
        seen.part_visibility[rows],
    )


def _listed(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (", ".join(names[:NAMED]) or "none") + more

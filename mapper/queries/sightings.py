"""What can be seen of a map from a place, and what the detector should find there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...datasets.frame import Intrinsics
from ..map.thing import Thing
from .map_content import MapContent
from .run_files import RunFiles, class_posteriors
from .seen_volumes import Occluders, Volumes, box_sides, box_std, sampled_visibility


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One thing as seen from somewhere.

    Attributes:
        thing: of the map.
        probability: P(it exists, is what was asked for, and at least the share asked for can be seen).
        share: of it that is in the image and not hidden, in [0, 1], mean over where it may be.
        xyxy: (4,) its box in the image, pixels, cut off at the borders.
    """

    thing: Thing
    probability: float
    share: float
    xyxy: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedDetection:
    """One thing that a detector should find from somewhere.

    Attributes:
        thing: of the map.
        probability: P(it exists and is detected).
        share: of it that is in the image and not hidden, in [0, 1], mean over where it may be.
        xyxy: (4,) its box in the image, pixels, cut off at the borders.
        xyxy_std: (4,) standard deviations of the sides, pixels, by what is not known of its position and size; the
            detector's own error comes on top.
    """

    thing: Thing
    probability: float
    share: float
    xyxy: np.ndarray
    xyxy_std: np.ndarray


class _Shown(NamedTuple):
    """A thing's number in the map, its box, and the (S,) shares of it that may be seen."""

    number: int
    xyxy: np.ndarray
    shares: np.ndarray


def sightings(
    content: MapContent,
    T_world_camera: np.ndarray,
    camera: Intrinsics,
    belief: Callable[[Thing], float],
    min_share: float,
) -> list[Sighting]:
    """See `SightQuestions.visible_from`; `belief` is P(a thing exists and is what was asked for)."""
    answers = []
    for number, xyxy, shares in _things_in_view(content, RunFiles(content), T_world_camera, camera):
        thing = content.things[number]
        probability = belief(thing) * float(np.mean(shares >= min_share))
        if probability > 0.0:
            answers.append(Sighting(thing, probability, float(shares.mean()), xyxy))
    return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))


def expected_detections(content: MapContent, T_world_camera: np.ndarray, camera: Intrinsics) -> list[ExpectedDetection]:
    """See `SightQuestions.expected_at`."""
    files, R = RunFiles(content), content.R_world_upright
    detection, posteriors = files.model().detection, class_posteriors(content)
    answers = []
    for number, xyxy, shares in _things_in_view(content, files, T_world_camera, camera):
        thing = content.things[number]
        chance = detection.probability(shares, box_sides(xyxy[None]), posterior=posteriors[number])
        probability = thing.existence * float(np.mean(np.where(shares > 0.0, chance, 0.0)))
        if probability > 0.0:
            std = box_std(thing, R, T_world_camera, camera)
            answers.append(ExpectedDetection(thing, probability, float(shares.mean()), xyxy, std))
    return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))


def _things_in_view(
    content: MapContent, files: RunFiles, T_world_camera: np.ndarray, camera: Intrinsics
) -> list[_Shown]:
    """The things that may be seen, each with a box of some area."""
    things, R = content.things, content.R_world_upright
    volumes = Volumes.of(things, R)
    occluders = Occluders(things, volumes, R, files.cloud(), files.spacing)
    depth = occluders.depth(T_world_camera, camera)
    xyxy = volumes.boxes(T_world_camera, camera)
    shown = []
    for number in np.flatnonzero(box_sides(xyxy) > 0.0):
        view = depth, T_world_camera, camera, occluders.tolerance
        shares = sampled_visibility(things[number], R, *view)
        if shares.any():
            shown.append(_Shown(int(number), xyxy[number], shares))
    return shown

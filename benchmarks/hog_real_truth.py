"""What is known to be in real images, and which boxes show it.

Nobody has drawn boxes there. Known are points: the place of an object of a recorded room, projected with the poses, or
a pixel that somebody named by looking. A box shows such an object if its class is right, its middle is near the point,
and where the object's distance is known, its size is possible.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.object_views.class_names import class_name
from thingmap.detectors.detections import Detections, Part

BEHIND = 0.20  # m, by which measured depth may be less than that of a known object before it counts as hidden
SIDE = 0.10  # m, about a mug
SIDE_FACTOR = 2.0  # by which a box's side may differ from a mug's at that distance
NEAREST = 0.3  # m, of an object that is asked for
MARGIN = 20.0  # px from the image's edge, within which an object is cut and not asked for
SHARE = 0.35  # of a box's sides, within which a pixel named by looking must lie about the box's middle
NAMES = {"cup": "coffee mug"}  # the lists' words -> the models' classes
SEEN_FORM = 'points by image as {"scene_02": {"bowl": [[427, 236]], ...}, ...}'


@dataclass(frozen=True, slots=True, eq=False)
class KnownPoint:
    """An object that an image shows.

    Attributes:
        label: class.
        xy: (2,) pixels.
        reach: pixels from it within which the middle of a right box lies; None for `SHARE` of the box.
        side: pixels, about the side of a right box; None where unknown.
    """

    label: str
    xy: np.ndarray
    reach: float | None = None
    side: float | None = None


@dataclass(frozen=True, slots=True)
class Verdict:
    """Boxes of whole objects in some images, from one probability on.

    Attributes:
        images: looked at.
        known: objects in them, and
        hits: of those, found.
        false: label -> boxes that show nothing known, second boxes on one object among them.
    """

    images: int
    known: int
    hits: int
    false: dict[str, int]


def known_in_frame(frame: Frame, truth: GroundTruth, labels: Sequence[str]) -> list[KnownPoint]:
    """The located objects of these classes that a frame of a posed sequence shows whole and unhidden.

    An object is taken to be hidden where depth is measured well before it; where nothing is measured it is not.
    """
    if frame.T_world_camera is None:
        return []
    points, k = [], frame.intrinsics
    for label, tolerance, u, v, z in _projected(frame.T_world_camera, k, truth, labels):
        if z <= NEAREST or not (MARGIN <= u < k.width - MARGIN and MARGIN <= v < k.height - MARGIN):
            continue
        around = frame.depth[int(v) - 2 : int(v) + 3, int(u) - 2 : int(u) + 3]
        around = around[around > 0.0]
        if around.size and np.median(around) < z - BEHIND:
            continue
        points.append(KnownPoint(label, np.array([u, v]), tolerance * k.fx / z, SIDE * k.fx / z))
    return points


def is_in_view(T_world_camera: np.ndarray, camera: Intrinsics, truth: GroundTruth, labels: Sequence[str]) -> bool:
    """Whether a part of a located object of these classes may be in the image, hidden or not."""
    for _, tolerance, u, v, z in _projected(T_world_camera, camera, truth, labels):
        room = 2.0 * tolerance * camera.fx / max(z, NEAREST)
        if z > 0.0 and -room < u < camera.width + room and -room < v < camera.height + room:
            return True
    return False


def _projected(
    T_world_camera: np.ndarray, camera: Intrinsics, truth: GroundTruth, labels: Sequence[str]
) -> Iterator[tuple[str, float, float, float, float]]:
    """Class, tolerance (metres), column, row and distance of located objects; nonsense behind the camera (z <= 0)."""
    rotation, centre = T_world_camera[:3, :3], T_world_camera[:3, 3]
    for thing in truth.located:
        called: str = class_name(thing.label)
        label = NAMES.get(called, called)
        if label in labels:
            point = rotation.T @ (thing.position - centre)
            u, v = camera.project(point[None])[0]
            yield label, truth.tolerance.get(thing.id, SIDE), float(u), float(v), float(point[2])


def read_seen(path: Path) -> dict[str, list[KnownPoint]]:
    """What somebody saw in images: their name to points.

    Raises:
        InputError: the file is missing or says something else.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {
            image: [
                KnownPoint(class_name(label), np.array(xy, dtype=np.float64).reshape(2))
                for label, places in by_label.items()
                for xy in places
            ]
            for image, by_label in content.items()
        }
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise InputError(path, SEEN_FORM, str(error), "write it by looking at the images") from None


def judge(
    found: Sequence[Detections], known: Sequence[Sequence[KnownPoint]], least: float, labels: Sequence[str]
) -> Verdict:
    """Boxes of whole objects of these classes with a probability of at least `least`, best first, against points."""
    hits, false = 0, dict.fromkeys(labels, 0)
    for boxes, points in zip(found, known, strict=True):
        taken = [False] * len(points)
        for n in np.argsort(-boxes.confidence, kind="stable") if len(boxes) else ():
            label = boxes.classes[boxes.class_id[n]]
            if boxes.part[n] != Part.WHOLE or boxes.confidence[n] < least or label not in false:
                continue
            fits = (k for k, one in enumerate(points) if not taken[k] and shows(boxes.xyxy[n], label, one))
            hit = next(fits, None)
            if hit is None:
                false[label] += 1
            else:
                taken[hit] = True
                hits += 1
    asked = sum(point.label in false for points in known for point in points)
    return Verdict(len(found), asked, hits, false)


def shows(xyxy: np.ndarray, label: str, known: KnownPoint) -> bool:
    """Whether a box of a class shows what is known to be there."""
    if label != known.label:
        return False
    size = xyxy[2:] - xyxy[:2]
    off = np.abs(0.5 * (xyxy[:2] + xyxy[2:]) - known.xy)
    near = bool((off <= SHARE * size).all()) if known.reach is None else float(np.hypot(*off)) <= known.reach
    side = float(np.sqrt(size.prod()))
    fits = known.side is None or known.side / SIDE_FACTOR <= side <= known.side * SIDE_FACTOR
    return near and fits

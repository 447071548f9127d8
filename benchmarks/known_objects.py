"""Checks of a map against objects that are known to be in the place, and against known false detections.

The file, in the world of the pose files, metres:

    {"objects": [{"name": "white mug", "class": "cup", "position": [x, y, z], "tolerance": 0.08}, ...],
     "known_false_detections": [{"class": "bowl", "position": [x, y, z], "truth": "the white mug"}, ...]}

Not every object of the place need be listed, so what is further away than the tolerances is not judged.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thingmap.datasets.errors import InputError
from thingmap.mapper.evaluation.inputs.case import Alignment
from thingmap.mapper.map.thing import Thing

MIN_EXISTENCE = 0.9  # of a thing that stands for a listed object
BELIEVED = 0.5  # existence times probability of the class from which a map claims that there is such an object
FALSE_RADIUS = 0.25  # m about a known false detection, at least


@dataclass(frozen=True, slots=True, eq=False)
class KnownObject:
    """An object of the place, or with `is_false` one that a detector sees there and that is none.

    Attributes:
        name: for people.
        label: its class.
        position: (3,) metres, world of the pose files.
        tolerance: metres.
        is_false: whether nothing of this class is there.
    """

    name: str
    label: str
    position: np.ndarray
    tolerance: float
    is_false: bool


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """One verdict.

    Attributes:
        known: what was looked for.
        matches: things believed to be of its class within the tolerance, each counted for the object nearest to it.
        nearest: the best candidate there is, with any existence; None without one within 1 m.
        distance: metres to `nearest`.
        passed: exactly one match, existing with `MIN_EXISTENCE`; for a false detection, none.
    """

    known: KnownObject
    matches: tuple[Thing, ...]
    nearest: Thing | None
    distance: float
    passed: bool


def read_known_objects(path: Path) -> list[KnownObject]:
    """Objects, then false detections.

    Raises:
        InputError: for a missing file or one that is not of the form.
    """
    remedy = "see benchmarks/known_objects.py for the form"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        known = [_known(item, str(item["name"]), float(item["tolerance"]), False) for item in content["objects"]]
        for item in content.get("known_false_detections", []):
            radius = max(float(item.get("tolerance", 0.0)), FALSE_RADIUS)
            known.append(_known(item, f"no {item['class']}: {item.get('truth', 'nothing')}", radius, True))
    except FileNotFoundError:
        raise InputError(path, "a file of known objects", "no such file", "check the path") from None
    except KeyError as error:
        raise InputError(path, f"the key {error}", "none", remedy) from None
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise InputError(path, "known objects as JSON", str(error), remedy) from None
    return known


def check_things(things: tuple[Thing, ...], known: list[KnownObject], alignment: Alignment) -> list[Check]:
    """One verdict for every known object; `alignment` takes the map's axes to the world of the pose files."""
    positions = alignment.apply(np.array([thing.position for thing in things]).reshape(-1, 3))
    apart = np.array([np.linalg.norm(positions - item.position, axis=1) for item in known]).reshape(len(known), -1)
    belief = np.array([[thing.belief(item.label) for thing in things] for item in known]).reshape(apart.shape)
    tolerance = np.array([item.tolerance for item in known])
    claims = (belief >= BELIEVED) & (apart <= tolerance[:, None])
    checks = []
    for i, item in enumerate(known):
        rivals = [j for j, other in enumerate(known) if other.label == item.label and not other.is_false]
        mine = np.flatnonzero(claims[i])
        if not item.is_false:
            distances = np.where(claims[rivals], apart[rivals], np.inf)
            mine = np.array([k for k in mine if rivals[int(np.argmin(distances[:, k]))] == i], dtype=int)
        matches = tuple(things[k] for k in mine)
        found = len(matches) == 1 and matches[0].label == item.label and matches[0].existence >= MIN_EXISTENCE
        nearest = _best(belief[i], apart[i], item.tolerance)
        checks.append(
            Check(
                known=item,
                matches=matches,
                nearest=None if nearest is None else things[nearest],
                distance=float("nan") if nearest is None else float(apart[i, nearest]),
                passed=not matches if item.is_false else found,
            )
        )
    return checks


def _best(belief: np.ndarray, apart: np.ndarray, tolerance: float) -> int | None:
    """The thing with the most belief within the tolerance; without one, the nearest that may be of the class."""
    near = np.flatnonzero((apart <= tolerance) & (belief > 0.01))
    if len(near):
        return int(near[np.argmax(belief[near])])
    far = np.flatnonzero((apart <= 1.0) & (belief >= 0.1))
    return int(far[np.argmin(apart[far])]) if len(far) else None


def _known(item: dict, name: str, tolerance: float, is_false: bool) -> KnownObject:
    position = np.array(item["position"], dtype=float)
    if position.shape != (3,) or not np.isfinite(position).all() or not tolerance > 0.0:
        raise ValueError(f"{name}: position {item['position']} with tolerance {tolerance}")
    return KnownObject(name, str(item["class"]), position, tolerance, is_false)

"""Where in the images the worst objects and things of a map can be seen.

A thing is drawn as the other protocols project it (`projection`), from the true camera pose where there is one: so a
thing in the wrong place is drawn in the wrong place, even if a wrong pose of the camera explains it. An object whose
image box the truth does not tell is drawn as the ball in which a thing was looked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ....datasets.truth import TrueObject
from ....factors.volume import project_volumes
from ..boxes.image_boxes import box_areas, clip_boxes, inside_share
from ..boxes.projection import project_cylinders
from ..inputs.case import Case, PlacedThing
from ..result import WorstCase
from .matching import Matching, same_label
from .seen import SeenObjects

Box = tuple[float, float, float, float]
MOST_LOOKS = 200  # frames, evenly spaced, in which a place for a picture is looked for
SHOWN_ERROR = 0.0005  # m; a smaller error of a centre is no bad case


class Projector:
    """Finds things in the images of a case; everything is None without intrinsics."""

    def __init__(self, case: Case) -> None:
        self._case = case
        to_truth, to_map = case.alignment.pose(np.eye(4)), np.linalg.inv(case.alignment.pose(np.eye(4)))
        self._poses = to_truth @ case.run.poses[case.run_index]
        if case.truth.poses is not None:
            true = case.truth.poses[case.truth_index]
            self._poses = np.where(np.isfinite(true), true, self._poses)  # all of a pose is NaN or nothing
        self._poses_in_map = to_map @ self._poses
        self._row = {int(index): row for row, index in enumerate(case.truth_index)}

    def thing_in(self, thing: PlacedThing, frame: int) -> Box | None:
        """xyxy of a thing in a frame of the truth, pixels, not clipped; None where it is not in front of the camera."""
        return self._thing_box(thing, self._row[frame])

    def find_thing(self, thing: PlacedThing) -> tuple[int, Box] | None:
        """The frame that shows most of a thing's volume, with its box; None where none does."""
        return self._find(lambda row: self._thing_box(thing, row))

    def find_ball(self, centre: np.ndarray, radius: float) -> tuple[int, Box] | None:
        """The same for a ball about a point of the truth's world, metres."""
        return self._find(lambda row: self._ball_box(centre, radius, row))

    def _thing_box(self, thing: PlacedThing, row: int) -> Box | None:
        intrinsics, R = self._case.truth.intrinsics, self._case.run.object_map.R_world_upright
        if intrinsics is None:
            return None
        return _finite(project_cylinders([thing.thing], self._poses_in_map[row], R, intrinsics)[0])

    def _ball_box(self, centre: np.ndarray, radius: float, row: int) -> Box | None:
        intrinsics, log_radii = self._case.truth.intrinsics, np.full((1, 3), np.log(radius))
        if intrinsics is None:
            return None
        return _finite(project_volumes(self._poses[row], np.eye(3), centre[None], log_radii, intrinsics)[0][0])

    def _find(self, box_in: Callable[[int], Box | None]) -> tuple[int, Box] | None:
        best, most = None, 0.0
        rows = np.linspace(0, len(self._poses) - 1, min(len(self._poses), MOST_LOOKS)).round().astype(int)
        for row in rows.tolist():
            box = box_in(row)
            shown = 0.0 if box is None else self._shown_area(box)
            if box is not None and shown > most:
                best, most = (int(self._case.truth_index[row]), box), shown
        return best

    def _shown_area(self, box: Box) -> float:
        """Square pixels inside the image, less where the image cuts the box."""
        intrinsics = self._case.truth.intrinsics
        assert intrinsics is not None
        xyxy = np.array([box])
        shown = float(box_areas(clip_boxes(xyxy, intrinsics))[0])
        return shown * float(inside_share(xyxy, intrinsics)[0]) if shown > 0.0 else 0.0


def worst_cases(
    case: Case, matching: Matching, seen: SeenObjects, exhaustive: bool, false: Sequence[tuple[PlacedThing, TrueObject]]
) -> tuple[WorstCase, ...]:
    """Objects missed in plain sight, things that are none, known false detections, wrong names and wrong places; the
    worst `worst_cases` of each kind. `false` holds things believed to be what the truth says is not there."""
    projector, most = Projector(case), case.config.worst_cases
    clear = {true.id: seen.best[true.id].clearness if true.id in seen.best else 0.0 for true in matching.objects}
    reach = {true.id: radius for true, radius in zip(matching.objects, matching.reach.tolist(), strict=True)}
    matched = sorted(matching.matched, key=lambda pair: -pair[0].belief)

    def place(true: TrueObject) -> tuple[int, Box] | None:
        view = seen.best.get(true.id)
        return projector.find_ball(true.position, reach[true.id]) if view is None else (view.frame, view.xyxy)

    hidden = sorted(matching.missed, key=lambda true: -clear[true.id])
    shown = [_missed(true, place(true)) for true in hidden[:most]]
    extra = sorted(matching.false_positives, key=lambda thing: -thing.belief) if exhaustive else []
    again = {thing.thing.id for thing in matching.duplicates}
    for thing in extra[:most]:
        why = "its object has a thing already" if thing.thing.id in again else "no object is there"
        shown.append(_false(thing, why, projector.find_thing(thing)))
    shown += [
        _false(thing, f"known not to be a {claim.label}", projector.find_thing(thing)) for thing, claim in false[:most]
    ]
    misnamed = [(thing, true) for thing, true in matched if not same_label(thing.label, true.label)]
    for thing, true in misnamed[:most]:
        text = f"{true.label} {true.id} is called {thing.label} ({thing.thing.id}, {thing.thing.probability:.2f})"
        shown.append(_pair(text, thing, place(true), projector))
    apart = [(float(np.linalg.norm(thing.position - true.position)), thing, true) for thing, true in matched]
    for distance, thing, true in sorted(apart, key=lambda item: -item[0])[:most]:
        if distance > SHOWN_ERROR:
            text = f"{true.label} {true.id} is {1000 * distance:.0f} mm off ({thing.thing.id})"
            shown.append(_pair(text, thing, place(true), projector))
    return tuple(shown)


def _missed(true: TrueObject, where: tuple[int, Box] | None) -> WorstCase:
    frame, box = where or (None, None)
    return WorstCase(f"{true.label} {true.id} is missed", frame, truth_xyxy=box)


def _false(thing: PlacedThing, why: str, where: tuple[int, Box] | None) -> WorstCase:
    frame, box = where or (None, None)
    text = f"{thing.label} ({thing.thing.id}, {thing.belief:.2f}): {why}"
    return WorstCase(text, frame, found_xyxy=box)


def _pair(text: str, thing: PlacedThing, where: tuple[int, Box] | None, projector: Projector) -> WorstCase:
    frame, box = where or (None, None)
    return WorstCase(text, frame, box, None if frame is None else projector.thing_in(thing, frame))


def _finite(xyxy: np.ndarray) -> Box | None:
    left, top, right, bottom = xyxy.tolist()
    return (left, top, right, bottom) if np.isfinite(xyxy).all() else None

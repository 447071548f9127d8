"""Places of a scene that a simulated detector takes for objects, again and again."""

from __future__ import annotations

from collections.abc import Sequence as Rows
from dataclasses import dataclass

import numpy as np

from ..datasets.frame import BrokenFrame, Frame
from ..datasets.sequence import Sequence
from ..datasets.truth import HasClutter, HasTruth

HIDDEN = 0.05  # metres; a spot lies behind a surface that is nearer than it by this much
FRAMES_SEARCHED = 3
REACH = (0.5, 3.0)  # metres from the camera at which spots of the background are looked for
BACKGROUND_SIZE = (0.07, 0.22)  # metres, width of what is taken for an object
BACKGROUND_ASPECT = (0.6, 1.8)  # height / width


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """Something that looks like an object, best from one side.

    Attributes:
        position: (3,) metres, world.
        width, height: metres, as seen.
        class_id: column of the class it is taken for.
        best_view: (3,) unit vector from the spot to where it looks most like that.
    """

    position: np.ndarray
    width: float
    height: float
    class_id: int
    best_view: np.ndarray

    def project(self, frame: Frame) -> np.ndarray | None:
        """(4,) xyxy pixels counted from the image's outer edges; None where it is hidden or not in view.

        Needs the frame's ground-truth pose.
        """
        assert frame.T_world_camera is not None
        x, y, z = frame.T_world_camera[:3, :3].T @ (self.position - frame.T_world_camera[:3, 3])
        camera = frame.intrinsics
        if z < 0.1:
            return None
        u, v = camera.fx * x / z + camera.cx + 0.5, camera.fy * y / z + camera.cy + 0.5
        if not (0.0 <= u < camera.width and 0.0 <= v < camera.height):
            return None
        reading = frame.depth[int(v), int(u)]
        if 0.0 < reading < z - HIDDEN - self.width / 2.0:
            return None
        half = np.array([camera.fx * self.width, camera.fy * self.height]) / (2.0 * z)
        return np.array([u - half[0], v - half[1], u + half[0], v + half[1]])

    def likeness(self, frame: Frame, sharpness: float) -> float:
        """1 from the best view, falling as a von Mises-Fisher density does with the angle from it."""
        assert frame.T_world_camera is not None
        view = unit(frame.T_world_camera[:3, 3] - self.position)
        return float(np.exp(sharpness * (view @ self.best_view - 1.0)))


def unit(vector: np.ndarray) -> np.ndarray:
    """(3,) scaled to length one."""
    return vector / np.linalg.norm(vector)


def whole_of(sequence: object) -> object:
    """The whole sequence behind a view of it (see `datasets.views`), so that all views see the same spots."""
    while hasattr(sequence, "sequence"):
        sequence = sequence.sequence  # pyright: ignore[reportAttributeAccessIssue]
    return sequence


def find_spots(sequence: object, classes: Rows[str], background: int, rng: np.random.Generator) -> tuple[Spot, ...]:
    """A spot on every thing of clutter, and `background` ones on surfaces away from all objects.

    None where the sequence has no ground-truth poses or no frame can be read.
    """
    if not isinstance(sequence, HasTruth) or not isinstance(sequence, Sequence) or sequence.poses is None:
        return ()
    eyes = sequence.poses[np.isfinite(sequence.poses).all(axis=(1, 2)), :3, 3]
    if not len(eyes):
        return ()

    def spot(position: np.ndarray, width: float, height: float) -> Spot:
        best = unit(eyes[rng.integers(len(eyes))] - position)
        return Spot(position, width, height, int(rng.integers(len(classes))), best)

    things = sequence.clutter if isinstance(sequence, HasClutter) else ()
    spots = [spot(thing.position, float(max(thing.size[:2])), float(thing.size[2])) for thing in things]
    for point in _surface_points(sequence, background, rng):
        width = rng.uniform(*BACKGROUND_SIZE)
        spots.append(spot(point, width, width * np.exp(rng.uniform(*np.log(BACKGROUND_ASPECT)))))
    return tuple(spots)


def _surface_points(sequence: Sequence, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """World points on surfaces outside every object's box, from a few frames over the sequence."""
    points: list[np.ndarray] = []
    places = np.unique(np.linspace(0, len(sequence) - 1, FRAMES_SEARCHED).astype(int)) if count else []
    for k, index in enumerate(places):
        wanted = count * (k + 1) // len(places) - len(points)
        try:
            frame = sequence[int(index)]
        except BrokenFrame:
            continue
        if frame.T_world_camera is None or not wanted:
            continue
        assert isinstance(sequence, HasTruth)
        free = (frame.depth > REACH[0]) & (frame.depth < REACH[1])
        for x0, y0, x1, y1 in np.clip(sequence.truth(int(index)).xyxy, 0, max(free.shape)).astype(int):
            free[y0 : y1 + 1, x0 : x1 + 1] = False
        rows, columns = np.nonzero(free)
        if not len(rows):
            continue
        chosen = rng.integers(len(rows), size=wanted)
        pixels = np.stack([columns[chosen], rows[chosen]], axis=1).astype(np.float64)
        camera = frame.intrinsics.back_project(pixels, frame.depth[rows[chosen], columns[chosen]].astype(np.float64))
        points += list(camera @ frame.T_world_camera[:3, :3].T + frame.T_world_camera[:3, 3])
    return points

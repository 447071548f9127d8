"""Things in space: labelled boxes, the ellipsoids of their positions, and what is doubtful in grey."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..queries.answer import PROBABLE
from .rerun_package import import_rerun
from .shown_things import ShownThings

BOXES, ELLIPSOIDS, DOUBTFUL = "world/things", "world/positions", "world/doubtful"
GREY = (128, 128, 128)
LINE_WIDTH = -1.5  # negative: in pixels of the screen, whatever the distance
THIN = -0.7


class ThingDrawer:
    """Draws all things anew each time, each kind in one entity: what is no longer there has gone with the next one.

    Args:
        recording: where to.
        static: draw them for all times, for a map that is finished.
    """

    def __init__(self, recording: Any, static: bool = False) -> None:
        self._rr, self._recording, self._static = import_rerun(), recording, static
        self._drawn: set[str] = set()  # entities that are not empty

    def draw(self, things: ShownThings) -> None:
        """Draws the probable ones with label and ellipsoid, the others as thin grey boxes."""
        probable = things.existence >= PROBABLE
        self._draw_probable(things.select(probable))
        self._draw_doubtful(things.select(~probable))

    def _draw_probable(self, things: ShownThings) -> None:
        boxes = self._boxes(things, colors=things.colors, labels=things.captions, radii=LINE_WIDTH, show_labels=True)
        half_axes, axes = things.ellipsoids()
        ellipsoids = self._rr.Ellipsoids3D(
            half_sizes=half_axes,
            centers=things.position,
            quaternions=quaternions(axes),
            colors=things.colors,
            line_radii=THIN,
            fill_mode=self._rr.components.FillMode.TransparentFillMajorWireframe,
        )
        self._log(BOXES, boxes, len(things))
        self._log(ELLIPSOIDS, ellipsoids, len(things))

    def _draw_doubtful(self, things: ShownThings) -> None:
        labels = [f"{caption}, doubtful" for caption in things.captions]
        self._log(DOUBTFUL, self._boxes(things, colors=GREY, labels=labels, radii=THIN, show_labels=False), len(things))

    def _boxes(self, things: ShownThings, **style: Any) -> Any:
        half_sizes, rotations = things.size / 2.0, quaternions(things.R_world_box)
        return self._rr.Boxes3D(half_sizes=half_sizes, centers=things.position, quaternions=rotations, **style)

    def _log(self, entity: str, shapes: Any, count: int) -> None:
        if count:
            self._recording.log(entity, shapes, static=self._static)
            self._drawn.add(entity)
        elif entity in self._drawn:
            self._recording.log(entity, self._rr.Clear(recursive=False), static=self._static)
            self._drawn.remove(entity)


def quaternions(rotations: np.ndarray) -> np.ndarray:
    """(N, 4) x, y, z, w of (N, 3, 3) rotations."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotations).as_quat() if len(rotations) else np.empty((0, 4))

"""What a run could see of every object: whether it had a chance, in which frame best, and how much was hidden.

An object that no mapped frame showed well enough need not be in a map. The mean occlusion of an object is one minus its
mean visibility over the frames that show any of it and have at least half of its box inside the image: the image border
hides too, and truths do not tell the two apart. Frames that show nothing of it are left out, as they are in annotated
sequences, where nobody draws the box of what is behind a wall.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ....datasets.truth import FrameTruth
from ..boxes.image_boxes import box_areas, inside_share
from ..inputs.case import Case

MIN_INSIDE = 0.5  # share of an object's box inside the image, of frames that tell how occluded it is


@dataclass(frozen=True, slots=True)
class View:
    """One object in one frame: index of the truth's frame, visibility, side in pixels (root of the visible box's area)
    and the box of the whole silhouette, xyxy pixels."""

    frame: int
    visibility: float
    side: float
    xyxy: tuple[float, float, float, float]

    @property
    def clearness(self) -> float:
        """Grows with how much of the object is seen, and how large."""
        return self.visibility * self.side


@dataclass(frozen=True, slots=True, eq=False)
class SeenObjects:
    """What the mapped frames show of the objects.

    Attributes:
        frames: how many of them are annotated; without any, nothing is known and everything counts as seen.
        well_seen: ids of objects that some frame showed well enough to be found.
        best: object id -> its clearest view; absent where no pixel of it was ever visible.
        occlusion: object id -> mean occlusion in [0, 1]; absent where no frame tells.
    """

    frames: int
    well_seen: frozenset[int]
    best: Mapping[int, View]
    occlusion: Mapping[int, float]

    def counts(self, object_id: int) -> bool:
        """Whether this object must be in a map."""
        return self.frames == 0 or object_id in self.well_seen


@lru_cache(maxsize=1)  # several protocols ask, and some truths have to render to answer
def see_objects(case: Case) -> SeenObjects:
    """Go through the truth of all mapped frames."""
    look, frames = case.truth.frame_truth, 0
    well_seen: set[int] = set()
    best: dict[int, View] = {}
    shares: dict[int, list[float]] = {}
    for index in case.truth_index.tolist():
        frame = None if look is None else look(index)
        if frame is None:
            continue
        frames += 1
        telling = frame.visibility > 0.0
        if case.truth.intrinsics is not None:
            telling &= inside_share(frame.xyxy, case.truth.intrinsics) >= MIN_INSIDE
        for row, object_id in enumerate(frame.object_id.tolist()):
            view = _view(index, frame, row)
            if view.visibility >= case.config.seen_visibility and view.side >= case.config.seen_side:
                well_seen.add(object_id)
            if view.clearness > (best[object_id].clearness if object_id in best else 0.0):
                best[object_id] = view
            if telling[row]:
                shares.setdefault(object_id, []).append(view.visibility)
    occlusion = {object_id: 1.0 - float(np.mean(values)) for object_id, values in shares.items()}
    return SeenObjects(frames, frozenset(well_seen), best, occlusion)


def _view(index: int, frame: FrameTruth, row: int) -> View:
    side = float(np.sqrt(np.nan_to_num(box_areas(frame.xyxy_visible[[row]])[0])))  # NaN where nothing is visible
    a, b, c, d = (float(value) for value in frame.xyxy[row])
    return View(index, float(frame.visibility[row]), side, (a, b, c, d))

"""When a thing was seen last, from where, and by what evidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimation.view_log import Verdict
from ..map.thing import Thing
from .answer import PROBABLE
from .relations import RelationQuestions

SAME_STAMP = 1e-4  # s: of one view in two files, one of which has six digits after the point


@dataclass(frozen=True, slots=True, eq=False)
class LastView:
    """The last view that showed a thing.

    Attributes:
        thing: which.
        probability: P(it is what was asked for).
        stamp: seconds.
        frame: `Frame.name` of the view; None where no view is on record, only the stamp.
        keyframe: its number in the graph; None with `frame`.
        T_world_camera: (4, 4) from where it was seen; None where no trajectory is beside the map.
        distance: metres from the camera to the thing's centre; None without a pose.
        found_as: the class that the detector named; None where it named none, or no view is on record.
        score: of that class; None with `found_as`.
        visible: share of the thing that the camera saw, in [0, 1]; None where no view is on record.
    """

    thing: Thing
    probability: float
    stamp: float
    frame: str | None = None
    keyframe: int | None = None
    T_world_camera: np.ndarray | None = None
    distance: float | None = None
    found_as: str | None = None
    score: float | None = None
    visible: float | None = None


class LastViewQuestions(RelationQuestions):
    """Questions about when things were seen."""

    __slots__ = ()

    def last_seen(self, which: Thing | str, min_probability: float = PROBABLE) -> list[LastView]:
        """The last view that showed each thing that `which` means, the latest first.

        A view showed a thing when its detection was taken as that thing's (`Verdict.SUPPORTED`). Where the map was read
        without its evidence, only `Thing.last_seen` is known.

        Args:
            which: a thing of this map, its id, or words as in `find`.
            min_probability: of being what was asked for; a thing or an id is answered whatever its existence.

        Raises:
            UserError: no such thing, or no such label.
            InputError: the evidence file or the trajectory is damaged.
        """
        by_id = self._by_id(which) is not None
        found = {self.things[place]: p * self.things[place].existence for place, p in self._meant(which).items()}
        from .run_files import RunFiles  # it reads maps, which are built on this

        path = RunFiles(self).trajectory()
        seen = [_last_view(thing, p, *path) for thing, p in found.items() if by_id or p >= min_probability]
        return sorted(seen, key=lambda view: (-view.stamp, view.thing.id))


def _last_view(thing: Thing, probability: float, stamps: np.ndarray, poses: np.ndarray) -> LastView:
    views = None if thing.views is None else thing.views.find()
    notes = [] if views is None else [note for note in views.notes if note.verdict is Verdict.SUPPORTED]
    if views is None or not notes:
        return LastView(thing, probability, thing.last_seen)
    note = max(notes, key=lambda note: (note.stamp, note.keyframe))
    at = np.flatnonzero(np.abs(stamps - note.stamp) <= SAME_STAMP)
    pose = poses[at[0]] if len(at) else None
    return LastView(
        thing,
        probability,
        note.stamp,
        note.frame,
        note.keyframe,
        pose,
        None if pose is None else float(np.linalg.norm(thing.position - pose[:3, 3])),
        None if note.class_id < 0 else views.classes[note.class_id],
        None if np.isnan(note.score) else float(note.score),
        float(note.visible[0]),
    )

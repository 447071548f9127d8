"""The map of things and the questions people ask it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...datasets.errors import UserError
from ..edits.applied import AppliedEdits
from ..queries.index import ThingIndex
from ..queries.last_seen import LastViewQuestions
from ..queries.places import PlaceQuestions
from ..queries.sight import SightQuestions
from .thing import Thing
from .up_direction import UpDirection
from .upright import upright_rotation

if TYPE_CHECKING:
    from ...datasets.frame import Intrinsics
    from .labelled_cloud import LabelledCloud


class MapFrame(StrEnum):
    """Whose axes the coordinates of a map are in."""

    FIRST_CAMERA = "first camera"
    GRAVITY_ALIGNED = "gravity-aligned"
    DATASET = "dataset"


@dataclass(frozen=True, slots=True, eq=False)
class ObjectMap(PlaceQuestions, LastViewQuestions, SightQuestions):
    """Things in one frame of reference.

    Attributes:
        things: any order; ids are unique.
        classes: every label that the map knows, whether or not there is such a thing.
        source: what was mapped.
        frame: whose axes positions are in.
        up: needed to place the upright boxes.
        labels: the cloud whose points are labelled, where `thingmap label` wrote one.
        camera: that mapped it, where one did; the default for questions about views.
        cloud: PLY file of what was seen, which hides what is behind it; where the map was read with one beside it.
        edits: ids that people's edits merged or deleted, and edits that wait for their things; nothing in a map as it
            was estimated. What was changed of a thing is with the thing.
    """

    things: tuple[Thing, ...]
    classes: tuple[str, ...]
    source: str
    frame: MapFrame
    up: UpDirection
    labels: LabelledCloud | None = None
    camera: Intrinsics | None = None
    cloud: Path | None = None
    edits: AppliedEdits = field(default_factory=AppliedEdits, repr=False)
    _index: ThingIndex | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        object.__setattr__(self, "things", tuple(self.things))
        object.__setattr__(self, "classes", tuple(self.classes))
        object.__setattr__(self, "frame", MapFrame(self.frame))
        ids = [thing.id for thing in self.things]
        if len(set(ids)) != len(ids):
            twice = sorted(i for i, count in Counter(ids).items() if count > 1)
            raise ValueError(f"ids of things must be unique, but got {', '.join(twice)} more than once")

    def __len__(self) -> int:
        return len(self.things)

    @classmethod
    def load(cls, path: str | Path, *, edits: bool = True) -> ObjectMap:
        """Read the output folder of a run, or its `map.json`; raises `InputError` where it is not one.

        Args:
            path: of the folder or the file.
            edits: with what people changed since (`MapEditor`); else as the mapper estimated it.
        """
        from .map_file import read_map

        return read_map(Path(path), edits)

    def save(self, path: str | Path, include_doubtful: bool = False, *, evidence: bool = True) -> Path:
        """Write to a `.json` file, or as `map.json` into a folder; returns the file, which is replaced if it was there.

        A labelled cloud is named as it was, beside the file; it is not copied.

        Args:
            path: where to.
            include_doubtful: write things whose existence is below 0.5 too.
            evidence: write what the views said too, so that things can be explained once they are loaded: into
                `evidence.npz` beside `map.json`, into `NAME.evidence.npz` beside `NAME.json`. Embeddings go into
                `embeddings.npz` or `NAME.embeddings.npz`, where there are any.

        Raises:
            UserError: the map has edits in it, and their journal lies at that place: it is for what was estimated.
        """
        from .map_file import write_map

        return write_map(self, Path(path), include_doubtful, evidence)

    @property
    def index(self) -> ThingIndex:
        """Finds things quickly; made when it is first asked for."""
        if self._index is None:
            object.__setattr__(self, "_index", ThingIndex(self.things))
        assert self._index is not None
        return self._index

    def thing(self, which: Thing | str) -> Thing:
        """The thing of this map that has an id, or the id of `which`.

        The id of a thing that was merged into another one is an id of that one for ever.

        Raises:
            UserError: there is no such thing; of one that was deleted it says who did it, when and why.
        """
        wanted = which if isinstance(which, str) else which.id
        own = self.index.thing(self.edits.aliases.get(wanted, wanted))
        if own is not None:
            return own
        gone = self.edits.deleted.get(self.edits.aliases.get(wanted, wanted))
        if gone is not None:
            why = f" ({gone.why})" if gone.why else ""
            raise UserError(
                f"{wanted}: {gone.who} deleted it on {gone.when}{why}; undo that with "
                f"`thingmap edit OUT undo {gone.number}`"
            )
        raise self.no_such_thing(wanted)

    @property
    def R_world_upright(self) -> np.ndarray:
        """(3, 3) axes of the upright frame in which boxes are measured; argument of `Thing.corners`."""
        return upright_rotation(self.up.direction)

    def points(self, thing: Thing | str) -> np.ndarray:
        """(M, 3) points of a thing, metres, map frame: those of the labelled cloud that are its own; maybe none.

        Args:
            thing: of this map, or its id.

        Raises:
            UserError: there is no such thing, or the map is not labelled: it says what to do.
            InputError: the cloud is missing or damaged, or that of another map.
        """
        own = self.thing(thing)
        if self.labels is None:
            raise UserError(
                f"the map of {self.source} is not labelled; label its run with `thingmap label OUT` and load it again"
            )
        parts = self.edits.parts.get(own.id, (own,))
        return np.concatenate([self.labels.points_of(part) for part in parts])

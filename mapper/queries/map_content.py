"""What questions may read of a map; `ObjectMap` fills it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...datasets.errors import UserError
from ..map.thing import Thing

if TYPE_CHECKING:
    from ...datasets.frame import Intrinsics
    from ..map.up_direction import UpDirection
    from .index import ThingIndex

LISTED = 12  # ids named in a message


class MapContent:
    """Base of the classes of questions, which are methods of `ObjectMap`; its attributes are documented there."""

    __slots__ = ()

    things: tuple[Thing, ...]
    classes: tuple[str, ...]
    source: str
    up: UpDirection
    camera: Intrinsics | None
    cloud: Path | None

    @property
    def R_world_upright(self) -> np.ndarray:
        """(3, 3) axes of the upright frame in which boxes are measured; argument of `Thing.corners`."""
        raise NotImplementedError

    @property
    def index(self) -> ThingIndex:
        """Finds things quickly."""
        raise NotImplementedError

    def thing(self, which: Thing | str) -> Thing:
        """The thing of this map that has an id, or the id of `which`; raises `UserError` where there is none."""
        wanted = which if isinstance(which, str) else which.id
        own = next((other for other in self.things if other.id == wanted), None)
        if own is None:
            raise self.no_such_thing(wanted)
        return own

    def no_such_thing(self, wanted: str) -> UserError:
        """What is said of an id that no thing has: which ids there are."""
        ids = [thing.id for thing in self.things]
        more = f" and {len(ids) - LISTED} more" if len(ids) > LISTED else ""
        known = f"it has {', '.join(ids[:LISTED])}{more}" if ids else "it has none"
        return UserError(f"{wanted}: the map of {self.source} has no such thing; {known}")

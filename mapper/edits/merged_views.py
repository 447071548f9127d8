"""The views and the looks of things that somebody said are one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..estimation.view_log import Verdict, ViewLog
from ..map.appearance import Appearance
from ..map.views_file import ThingViews

if TYPE_CHECKING:
    from ..map.appearance import SomeAppearance
    from ..map.thing import Thing
    from ..map.views_file import StoredViews


@dataclass(frozen=True, slots=True, eq=False)
class MergedViews:
    """The views of several things, read when they are asked for.

    Of a keyframe that saw more than one of them, what supports stays, as when the mapper merges (`ViewLog`).
    """

    parts: tuple[ThingViews | StoredViews | MergedViews, ...]

    @classmethod
    def of(cls, things: Iterable[Thing]) -> MergedViews | None:
        """None where the views of one of them are not known."""
        parts = [thing.views for thing in things]
        known = tuple(views for views in parts if views is not None)
        return cls(known) if len(known) == len(parts) else None

    def read(self) -> ThingViews:
        """The views; raises as those of `StoredViews.read`."""
        return _join([part.read() for part in self.parts])

    def find(self) -> ThingViews | None:
        """The views, None where those of one thing are not there; raises as `StoredViews.find`."""
        found = [part.find() for part in self.parts]
        known = [views for views in found if views is not None]
        return _join(known) if len(known) == len(found) else None


@dataclass(frozen=True, slots=True, eq=False)
class MergedAppearance:
    """How several things look, read when it is asked for: the mean over all their views."""

    parts: tuple[SomeAppearance, ...]

    @classmethod
    def of(cls, things: Iterable[Thing]) -> MergedAppearance | None:
        """None where nobody knows how any of them looks."""
        known = tuple(thing.appearance for thing in things if thing.appearance is not None)
        return cls(known) if known else None

    def read(self) -> Appearance | None:
        """The appearance, None where there is none; raises as `StoredAppearance.read`."""
        return Appearance.mean([known for part in self.parts if (known := part.read()) is not None])


def _join(parts: Sequence[ThingViews]) -> ThingViews:
    log = ViewLog(keep_silent=sum(len(views.notes) for views in parts))  # none is left out here
    for views in parts:
        for note in views.notes:
            log.append(note)
    left_out = {verdict: sum(views.left_out.get(verdict, 0) for views in parts) for verdict in Verdict}
    return ThingViews(parts[0].classes, tuple(log), left_out)

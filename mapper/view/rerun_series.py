"""Time series: existence and class probabilities of some things, times of the stages, counts."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..glimpse import Glimpse
from ..queries.answer import PROBABLE
from .rerun_package import import_rerun
from .shown_things import ShownThings, label_color

EXISTENCE, CLASSES, TIMES, COUNTS = "series/existence", "series/classes", "series/times", "series/counts"
MAX_THINGS = 12  # with series at a time: the first to become probable; one that vanishes leaves its place to another
MAX_CLASSES = 4  # of a thing, in the order in which they become likely
LIKELY = 0.05


class SeriesDrawer:
    """Draws what changes with time, once a keyframe."""

    def __init__(self, recording: Any) -> None:
        self._rr, self._recording = import_rerun(), recording
        self._lines: dict[str, list[int]] = {}  # id of every thing with series -> its classes
        self._timed: dict[str, int] = {}  # stage -> how often it was run when last drawn

    def draw_things(self, things: ShownThings) -> None:
        """Existence and class probabilities of those that have series."""
        row = {i: n for n, i in enumerate(things.ids)}
        for vanished in self._lines.keys() - row.keys():
            del self._lines[vanished]
            for entity in (EXISTENCE, CLASSES):
                self._recording.log(f"{entity}/{vanished}", self._rr.Clear(recursive=False))
        for n in np.flatnonzero(things.existence >= PROBABLE):
            if len(self._lines) < MAX_THINGS:
                self._lines.setdefault(things.ids[n], [])
        for i, classes in self._lines.items():
            self._draw_thing(things, row[i], classes)

    def draw_numbers(self, now: Glimpse, things: ShownThings) -> None:
        """Milliseconds of the stages that were run since the last time, and how many there are of what."""
        for stage, (times, milliseconds) in now.stages.items():
            if self._timed.get(stage) != times:
                if stage not in self._timed:
                    self._recording.log(f"{TIMES}/{stage}", self._rr.SeriesLines(names=stage), static=True)
                self._timed[stage] = times
                self._scalar(f"{TIMES}/{stage}", milliseconds)
        probable = int(np.count_nonzero(things.existence >= PROBABLE))
        self._scalar(f"{COUNTS}/things", probable)
        self._scalar(f"{COUNTS}/doubtful", len(things) - probable)
        self._scalar(f"{COUNTS}/candidates", now.candidates)
        self._scalar(f"{COUNTS}/loops", len(now.loops))

    def _draw_thing(self, things: ShownThings, n: int, classes: list[int]) -> None:
        posterior = things.posterior[n]
        for k in np.argsort(-posterior, kind="stable"):
            if posterior[k] < LIKELY or len(classes) == MAX_CLASSES:
                break
            if int(k) not in classes:
                classes.append(int(k))
                self._name(things, n, classes)
        if classes:
            self._scalar(f"{CLASSES}/{things.ids[n]}", posterior[classes])
        self._scalar(f"{EXISTENCE}/{things.ids[n]}", things.existence[n])

    def _name(self, things: ShownThings, n: int, classes: list[int]) -> None:
        """Names and colours of a thing's lines, which are those of their classes; existence has the likeliest one's."""
        labels = [things.classes[k] for k in classes]
        colors = [label_color(label) for label in labels]
        number = things.names[n].rsplit(" ", 1)[1]
        names, lines = [f"{number} {label}" for label in labels], self._rr.SeriesLines
        self._recording.log(f"{CLASSES}/{things.ids[n]}", lines(names=names, colors=colors), static=True)
        self._recording.log(f"{EXISTENCE}/{things.ids[n]}", lines(names=names[0], colors=colors[0]), static=True)

    def _scalar(self, entity: str, value: Any) -> None:
        self._recording.log(entity, self._rr.Scalars(value))

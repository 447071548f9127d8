"""What every view said about one landmark: the record from which a thing explains itself."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ...detectors.detections import Part

KEPT_SILENT = 300  # latest views that said nothing and are kept whole, for each landmark: about 100 kB with 40 classes
REPEATED = 0.1  # view weight below which a view shows what other views have shown
FAINT = 0.05  # nats; a log ratio below it moves a probability of 0.5 by 0.012


class Verdict(IntEnum):
    """What a view said about a landmark; the numbers are those of evidence files."""

    SUPPORTED = 0  # detected
    OCCLUDED = 1  # hidden: said nothing
    MISSED = 2  # should have been detected and was not: contradicted
    SEEN_THROUGH = 3  # the camera looked through its volume: contradicted
    UNCLEAR = 4  # in sight, but too small or too much hidden to be found for sure: said nothing

    @property
    def contradicts(self) -> bool:
        return self in (Verdict.MISSED, Verdict.SEEN_THROUGH)


@dataclass(frozen=True, slots=True, eq=False)
class ViewNote:
    """What one keyframe said about a landmark over K classes.

    Attributes:
        keyframe: its number in the graph.
        stamp: seconds.
        frame: `Frame.name`.
        visible: (5,) share that the camera sees of the whole, top, bottom, left and right, in [0, 1].
        score: of the detection for its best class; NaN without one.
        part: template of the detection that weighed most (`Part`); -1 without one.
        class_id: best class of that detection; -1 without one.
        log_ratio: (K,) float32, nats: log p(view | an object of class k) - log p(view | no object), of this view by
            itself and already times its weight.
        weight: in [0, 1]: how new the view was.
        verdict: what it comes to.

    Raises:
        ValueError: where a shape is not as above, or a log ratio is not a number.
    """

    keyframe: int
    stamp: float
    frame: str
    visible: np.ndarray
    score: float
    part: int
    class_id: int
    log_ratio: np.ndarray
    weight: float
    verdict: Verdict

    def __post_init__(self) -> None:
        for name, shape in (("visible", (len(Part),)), ("log_ratio", None)):
            array = np.array(getattr(self, name), dtype=np.float32)
            if array.ndim != 1 or (shape and array.shape != shape):
                raise ValueError(f"{name} must have shape {shape or '(K,)'}, but got {array.shape}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if np.isnan(self.log_ratio).any():
            raise ValueError(f"log_ratio must be numbers, but got {self.log_ratio.tolist()}")

    @property
    def said_nothing(self) -> bool:
        """Hidden, unclear or a repetition, and of no effect on any class."""
        silent = self.verdict in (Verdict.OCCLUDED, Verdict.UNCLEAR) or self.weight < REPEATED
        return silent and float(np.max(np.abs(self.log_ratio), initial=0.0)) < FAINT


class ViewLog:
    """Notes of the views that had a landmark in the image, one a keyframe.

    Of the views that said nothing, only the latest `keep_silent` are kept whole, so that a thing that is hidden for
    hours takes no more memory than one that is hidden for a minute; the others are counted by verdict.
    """

    def __init__(self, keep_silent: int = KEPT_SILENT) -> None:
        self._keep_silent = keep_silent
        self._telling: dict[int, ViewNote] = {}
        self._silent: dict[int, ViewNote] = {}
        self._left_out = [0 for _ in Verdict]  # keyframes by verdict, as bit sets

    def append(self, note: ViewNote) -> None:
        """Adds a view; of two notes of one keyframe the one that supports stays, then the one that contradicts."""
        old = self._telling.get(note.keyframe) or self._silent.get(note.keyframe)
        if old is not None and _rank(old) >= _rank(note):
            return
        self._forget(note.keyframe)
        kept = self._silent if note.said_nothing else self._telling
        kept[note.keyframe] = note
        self._leave_out()

    def absorb(self, other: ViewLog) -> None:
        """Takes over the views of a landmark that turned out to be this one."""
        for note in other:
            self.append(note)
        whole = sum(1 << keyframe for keyframe in (*self._telling, *self._silent))
        for verdict, keyframes in enumerate(other._left_out):
            self._left_out[verdict] |= keyframes & ~whole & ~sum(self._left_out)

    def take_out(self, keyframes: Iterable[int]) -> ViewLog:
        """What these keyframes said was of something else: their notes, as the log of that."""
        taken = ViewLog(self._keep_silent)
        for keyframe in keyframes:
            note = self._telling.get(keyframe) or self._silent.get(keyframe)
            if note is not None:
                taken.append(note)
            self._forget(keyframe)
        return taken

    def __len__(self) -> int:
        """Notes kept whole."""
        return len(self._telling) + len(self._silent)

    def __iter__(self) -> Iterator[ViewNote]:
        """Notes kept whole, by keyframe."""
        notes = (*self._telling.values(), *self._silent.values())
        return iter(sorted(notes, key=lambda note: note.keyframe))

    @property
    def left_out(self) -> int:
        """Views that said nothing and are only counted."""
        return sum(self.left_out_by.values())

    @property
    def left_out_by(self) -> dict[Verdict, int]:
        """The same by verdict; every verdict is a key."""
        return {verdict: self._left_out[verdict].bit_count() for verdict in Verdict}

    def counts(self) -> dict[Verdict, int]:
        """All views by verdict, those that are only counted among them; every verdict is a key."""
        counts = self.left_out_by
        for note in self:
            counts[note.verdict] += 1
        return counts

    def _forget(self, keyframe: int) -> None:
        self._telling.pop(keyframe, None)
        self._silent.pop(keyframe, None)
        self._left_out = [keyframes & ~(1 << keyframe) for keyframes in self._left_out]

    def _leave_out(self) -> None:
        while len(self._silent) > self._keep_silent:
            keyframe = min(self._silent)
            self._left_out[self._silent.pop(keyframe).verdict] |= 1 << keyframe


def _rank(note: ViewNote) -> tuple[int, float]:
    supports = note.verdict == Verdict.SUPPORTED
    return (2 if supports else 1 if note.verdict.contradicts else 0), note.weight

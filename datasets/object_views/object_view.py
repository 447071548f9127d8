"""One object as a camera saw it, and collections of such views that are read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

MARGIN = 0.5  # of the box's longer side, kept around an object where the image reaches so far
MARGIN_PIXELS = 24  # kept at least, three cells of a feature pyramid


@dataclass(frozen=True, slots=True, eq=False)
class ObjectView:
    """A whole object in an image, with a margin where the source has one.

    A view with a mask may be put before other backgrounds (`composing.composed`); one without shows the object in the
    surroundings it has.

    Attributes:
        label: class name.
        instance: which object of the class, unique among all classes: views of one instance are alike.
        name: of the view, unique in its source.
        color: (H, W, 3) uint8, RGB.
        depth: (H, W) float32 metres along z, 0 = no reading; None where nothing was measured.
        mask: (H, W) bool, pixels of the object; None where unknown.
        xyxy: (4,) float64 pixels, box of the object in this image, counted from the image's outer edges as in
            `Detections`: the image spans [0, W] x [0, H].
        focal: pixels, of the image at this size.
    """

    label: str
    instance: str
    name: str
    color: np.ndarray
    depth: np.ndarray | None
    mask: np.ndarray | None
    xyxy: np.ndarray
    focal: float


class BrokenView(Exception):
    """A view that cannot be read; the message says why. Whoever iterates counts it and goes on."""


@dataclass(frozen=True, slots=True)
class ViewEntry:
    """What is known of a view before it is read.

    Attributes:
        label, instance, name: as in `ObjectView`.
        read: reads or renders it; raises `BrokenView`.
    """

    label: str
    instance: str
    name: str
    read: Callable[[], ObjectView]


class ObjectViews:
    """Views of labelled objects, always in the same order. They are read, or rendered, while one iterates.

    `len` counts the views that were found; iterating gives those of them that can be read.

    Args:
        entries: the views.
        skipped: views that are known to be unusable, by name, with the reason.

    Attributes:
        entries: label, instance and name of every view, unread.
        skipped: name -> reason of everything left out so far; reading adds to it.
    """

    def __init__(self, entries: Iterable[ViewEntry], skipped: dict[str, str] | None = None) -> None:
        self.entries = tuple(entries)
        self.skipped: dict[str, str] = dict(skipped or {})

    @property
    def labels(self) -> tuple[str, ...]:
        """Class names, sorted."""
        return tuple(sorted({entry.label for entry in self.entries}))

    def __len__(self) -> int:
        return len(self.entries)

    def __iter__(self) -> Iterator[ObjectView]:
        for entry in self.entries:
            try:
                view = entry.read()
            except BrokenView as broken:
                self.skipped[entry.name] = str(broken)
            else:
                yield view

    def select(self, indices: Iterable[int]) -> ObjectViews:
        """The views at these positions of `entries`, in the order given."""
        return ObjectViews([self.entries[index] for index in indices], self.skipped)

    @classmethod
    def joined(cls, several: Iterable[ObjectViews]) -> ObjectViews:
        """All views of several collections, one collection after the other."""
        items = list(several)
        skipped = {name: reason for item in items for name, reason in item.skipped.items()}
        return cls([entry for item in items for entry in item.entries], skipped)


def mask_box(mask: np.ndarray) -> np.ndarray:
    """(4,) float64 xyxy around the pixels of a (H, W) mask, from the image's outer edges.

    Raises:
        BrokenView: the mask is empty.
    """
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    if len(rows) == 0:
        raise BrokenView("no pixel belongs to the object")
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], dtype=np.float64)


def margin_about(xyxy: np.ndarray) -> float:
    """Pixels to each side of a box (4,) that belong to a view."""
    return max(MARGIN * float(max(xyxy[2] - xyxy[0], xyxy[3] - xyxy[1])), MARGIN_PIXELS)


def margin_window(xyxy: np.ndarray, width: int, height: int) -> tuple[slice, slice]:
    """Rows and columns of a width x height image that hold the box (4,) and the margin about it."""
    margin = margin_about(xyxy)
    left, top = (max(int(v - margin), 0) for v in xyxy[:2])
    right, bottom = min(int(np.ceil(xyxy[2] + margin)), width), min(int(np.ceil(xyxy[3] + margin)), height)
    return slice(top, bottom), slice(left, right)


def cut_out(view: ObjectView) -> ObjectView:
    """The view with no more of its surroundings than the margin; arrays are copied, so that the image can go."""
    height, width = view.color.shape[:2]
    rows, columns = margin_window(view.xyxy, width, height)
    return ObjectView(
        label=view.label,
        instance=view.instance,
        name=view.name,
        color=view.color[rows, columns].copy(),
        depth=None if view.depth is None else view.depth[rows, columns].copy(),
        mask=None if view.mask is None else view.mask[rows, columns].copy(),
        xyxy=view.xyxy - [columns.start, rows.start, columns.start, rows.start],
        focal=view.focal,
    )

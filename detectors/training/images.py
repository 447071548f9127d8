"""The images that are learned from, read when they are needed and kept as far as they fit."""

from __future__ import annotations

from collections.abc import Sequence

from ...datasets.object_views.backgrounds import Background, Backgrounds
from ...datasets.object_views.object_view import BrokenView, ObjectView, ObjectViews
from .keeping import Kept


def kept_frames(backgrounds: Backgrounds, indices: Sequence[int], limit: int) -> Kept[Background | None]:
    """Some of the frames; None for one that cannot be used."""

    def read(k: int) -> Background | None:
        try:
            return backgrounds[indices[k]]
        except BrokenView as broken:
            backgrounds.skipped[backgrounds.names[indices[k]]] = str(broken)
            return None

    return Kept(read, len(indices), limit)


def kept_views(views: ObjectViews, indices: Sequence[int], limit: int) -> Kept[ObjectView | None]:
    """Some of the views; None for one that cannot be read, which `ObjectViews.skipped` then names."""

    def read(k: int) -> ObjectView | None:
        entry = views.entries[indices[k]]
        try:
            return entry.read()
        except BrokenView as broken:
            views.skipped[entry.name] = str(broken)
            return None

    return Kept(read, len(indices), limit)

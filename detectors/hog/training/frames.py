"""The images that are learned from, read when they are needed and kept as far as they fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....datasets.object_views.backgrounds import Background, Backgrounds
from ....datasets.object_views.object_view import BrokenView, ObjectView, ObjectViews
from .config import TrainConfig
from .keeping import Kept
from .placing import in_scene


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


def mined_frames(
    frames: Kept[Background | None], views: Kept[ObjectView | None], config: TrainConfig
) -> Kept[Background | None]:
    """The frames, and after them `config.composed_frames` small ones with an object each, which they know.

    There, classes meet objects of the others where the backgrounds themselves show none. None stands for what cannot
    be put anywhere.
    """

    def read(k: int) -> Background | None:
        if k < len(frames):
            return frames[k]
        rng = np.random.default_rng([config.seed, 4, k - len(frames)])
        view = views[int(rng.integers(len(views)))]
        return None if view is None else in_scene(view, frames, rng)

    masked = any(view is not None and view.mask is not None for view in views)
    return Kept(read, len(frames) + (config.composed_frames if masked and len(frames) else 0), config.memory)

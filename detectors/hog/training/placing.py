"""Objects that were seen alone, put where something else stands."""

from __future__ import annotations

import numpy as np

from ....datasets.object_views.backgrounds import Background
from ....datasets.object_views.composing import composed
from ....datasets.object_views.object_view import ObjectView
from ...training.keeping import Kept

TRIES = 5  # backgrounds, until one has a place for the object


def in_surroundings(view: ObjectView, frames: Kept[Background | None], rng: np.random.Generator) -> ObjectView:
    """A view with a mask put into one of the frames; one without, or that fits nowhere, as it is."""
    if view.mask is None:
        return view
    there = _placed(view, frames, rng, with_objects=True)
    return view if there is None else there


def in_scene(view: ObjectView, frames: Kept[Background | None], rng: np.random.Generator) -> Background | None:
    """The object in what surrounds it in one of the frames, labelled; None where it fits nowhere.

    Only frames without known objects are taken: these would be in the picture, too, but not at a known place.
    """
    there = None if view.mask is None else _placed(view, frames, rng, with_objects=False)
    if there is None:
        return None
    return Background(there.name, there.color, there.depth, there.focal, (there.label,), there.xyxy[None], np.ones(1))


def _placed(
    view: ObjectView, frames: Kept[Background | None], rng: np.random.Generator, with_objects: bool
) -> ObjectView | None:
    for index in rng.integers(max(len(frames), 1), size=TRIES if len(frames) else 0):
        frame = frames[int(index)]
        if frame is None or (frame.labels and not with_objects):
            continue
        there = composed(view, frame, rng)
        if there is not None:
            return there
    return None

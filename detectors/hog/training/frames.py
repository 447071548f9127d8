"""The frames in which false positives are looked for."""

from __future__ import annotations

import numpy as np

from ....datasets.object_views.backgrounds import Background
from ....datasets.object_views.object_view import ObjectView
from ...training.keeping import Kept
from .config import TrainConfig
from .placing import in_scene


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

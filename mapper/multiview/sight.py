"""Whether a place could be seen in a view: in the image, near enough, and nothing before it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from ..config import MultiViewConfig
from . import kernels
from .kept_views import ViewStack


class Sight(IntEnum):
    """What a view can tell of a place."""

    OUT = kernels.OUT  # not in the image, or too far away
    HIDDEN = kernels.HIDDEN  # something is before it, or the sensor read nothing there
    VISIBLE = kernels.VISIBLE


def sight(places: np.ndarray, views: ViewStack, config: MultiViewConfig) -> np.ndarray:
    """(T, V) int8 `Sight` of T places (T, 3), world, metres, in V views.

    What is before a place is the median of the readings in a small square about it. A centroid lies behind its own
    surface: only what is nearer by more than `config.hidden` hides it. A view with nothing at that place, or something
    behind it, could have seen a thing there.
    """
    return kernels.see_places(
        np.ascontiguousarray(places, dtype=np.float64).reshape(-1, 3),
        views.T_camera_world,
        views.camera,
        views.step,
        views.depth_mm,
        float(config.margin),
        float(config.far),
        float(config.hidden),
        config.window // 2,
    )

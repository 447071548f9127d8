"""A cut-out object put into another image: it stands on what is there, at the distance of what it stands on.

    1. Where the background's depth is that of a level surface, an object may stand: the surface's normal points up in
       the image, more or less, as a table's does and a wall's does not.
    2. One such pixel, drawn by chance, becomes the object's foot. The object moves to that depth, and its size in the
       image changes as focal lengths and distances say.
    3. It must lie in the image as a whole and before everything there; else another pixel is drawn.
    4. Colour is blended by the share of each pixel that the object covers, depth is replaced. Seen from a Kinect's
       projector, the object then hides part of what is behind it: there nothing is measured.

Without depth, in the view or in the background, only step 4 is left: any place, and any size within the limits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..frame import Intrinsics
from ..synthetic.rendering.sensor import IDEAL, measure
from .backgrounds import Background
from .cutout import cut
from .object_view import ObjectView, cut_out, mask_box
from .places import DEFAULT_PLACES, PlaceConfig, Placed, anywhere, standing

SHADOW = replace(IDEAL, shadow=True)
LIGHT = 0.15  # deviation of the logarithm of a factor on the object's light; own choice


def composed(
    view: ObjectView, background: Background, rng: np.random.Generator, config: PlaceConfig = DEFAULT_PLACES
) -> ObjectView | None:
    """The view's object in the background, cut out with its margin.

    Args:
        view: with a mask.
        background: where to.
        rng: draws the place and the light.
        config: which places are accepted.

    Returns:
        A view of the same label, instance and name, whose depth is None where either has none; None where no place was
        found for the object.

    Raises:
        ValueError: the view has no mask.
        BrokenView: its mask is empty.
    """
    cutout = cut(view)
    if cutout.depth is None or background.depth is None:
        placed = anywhere(cutout, background.color.shape[:2], rng, config)
    else:
        zoom = background.focal / view.focal
        placed = standing(cutout, background.depth, zoom, background.focal, rng, config)
    if placed is None or not (placed.cutout.coverage > 0.5).any():
        return None
    return _shadowed(cut_out(_blended(view, placed, background, rng)), rng)


def _blended(view: ObjectView, placed: Placed, background: Background, rng: np.random.Generator) -> ObjectView:
    """The whole background with the object in it."""
    cutout, color = placed.cutout, background.color.copy()
    height, width = cutout.coverage.shape
    there = np.s_[placed.top : placed.top + height, placed.left : placed.left + width]
    light = np.float32(np.exp(LIGHT * rng.standard_normal()))
    mixed = light * cutout.color + (1.0 - cutout.coverage[..., None]) * color[there]
    color[there] = np.clip(mixed + 0.5, 0.0, 255.0).astype(np.uint8)
    mask = np.zeros(color.shape[:2], dtype=bool)
    mask[there] = cutout.coverage > 0.5
    depth = None
    if cutout.depth is not None and background.depth is not None:
        depth = background.depth.copy()
        depth[there] = np.where(mask[there], cutout.depth, depth[there])
    return ObjectView(view.label, view.instance, view.name, color, depth, mask, mask_box(mask), background.focal)


def _shadowed(view: ObjectView, rng: np.random.Generator) -> ObjectView:
    """Without the readings behind the object that the sensor's projector no longer reaches."""
    if view.depth is None or view.mask is None:
        return view
    height, width = view.depth.shape
    camera = Intrinsics(width, height, view.focal, view.focal, 0.0, 0.0)
    lit = measure(view.depth, np.ones_like(view.depth), camera, SHADOW, rng)
    return replace(view, depth=np.where(view.mask, view.depth, lit))

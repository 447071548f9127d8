"""Colours of the classes of one map, told apart on dark and on light ground."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence

import numpy as np

from ...export.colors import class_color

# RGB, round the circle of hues with about the same brightness; brown and grey last.
PALETTE = (
    (255, 107, 97),
    (255, 159, 64),
    (240, 205, 60),
    (156, 212, 74),
    (63, 196, 136),
    (54, 201, 200),
    (77, 166, 255),
    (129, 124, 255),
    (193, 112, 255),
    (255, 110, 199),
    (196, 146, 100),
    (168, 184, 204),
)
VIVID = 10  # of them; the others have no hue that anybody would name, and are taken last


def page_colors(labels: Sequence[str]) -> dict[str, np.ndarray]:
    """Label -> (3,) uint8 RGB, all different for twelve labels; the first to be named get what is likest their own.

    `class_color`, which files have, depends on the name alone: its colours are the same in every map, and two classes
    of one map may have nearly the same.
    """
    free = list(range(len(PALETTE)))
    colors: dict[str, np.ndarray] = {}
    for label in labels:
        own = _hue(class_color(label))
        vivid = [place for place in free if place < VIVID] or free
        best = min(vivid, key=lambda place: (_apart(own, _hue(np.array(PALETTE[place]))), place))
        free.remove(best)
        free = free or list(range(len(PALETTE)))
        colors[label] = np.array(PALETTE[best], dtype=np.uint8)
    return colors


def _hue(rgb: np.ndarray) -> float:
    return colorsys.rgb_to_hsv(*(float(band) / 255.0 for band in rgb))[0]


def _apart(a: float, b: float) -> float:
    return min(abs(a - b), 1.0 - abs(a - b))

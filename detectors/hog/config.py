"""Which scales of an image are searched."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .channels import CELL

LARGEST_SCALE = 2.0  # cells of half the pixels stand for twice the scale; finer ones would hold too few pixels
MOST_LEVELS = 32  # per octave: 2 % from scale to scale; a model's file must not ask for endless work


@dataclass(frozen=True, slots=True)
class PyramidConfig:
    """The levels of a feature pyramid.

    Attributes:
        levels_per_octave: scales per factor of two, at most 32.
        max_scale: of the first level. Above 1 it finds objects smaller than a window, at most 2: a level above 1 is
            made of cells of 4 pixels at half its scale, which costs little and needs no enlarged image.
        min_scale: no level is smaller.
        min_cells: nor has one fewer whole cells than this along the image's shorter side, except the first. An object
            larger than what a window sees at the last level is not found.
        border: cells of zeros on every side of a level, so that windows may reach over the image's edge.

    Raises:
        ValueError: for values out of range.
    """

    levels_per_octave: int = 4
    max_scale: float = math.sqrt(2.0)
    min_scale: float = 1.0 / 16.0
    min_cells: int = 5
    border: int = 2

    def __post_init__(self) -> None:
        if not 1 <= self.levels_per_octave <= MOST_LEVELS or self.min_cells < 1 or self.border < 0:
            limits = f"levels_per_octave must be 1 to {MOST_LEVELS}, min_cells 1 or more, border 0 or more"
            raise ValueError(f"{limits}; got {self}")
        if not 0.0 < self.min_scale <= self.max_scale <= LARGEST_SCALE:
            raise ValueError(f"expected 0 < min_scale <= max_scale <= {LARGEST_SCALE:g}, but got {self}")

    def scales(self, width: int, height: int) -> tuple[float, ...]:
        """Scales of the levels of an image, largest first; none for an image without one whole cell at the first."""
        shorter = min(width, height)
        found: list[float] = []
        while True:
            scale = self.max_scale * 2.0 ** (-len(found) / self.levels_per_octave)
            fewest = self.min_cells if found else 1
            if scale < self.min_scale * (1.0 - 1e-9) or whole_cells(shorter, scale) < fewest:
                return tuple(found)
            found.append(scale)


def whole_cells(pixels: int, scale: float) -> int:
    """Cells that fit into a side of an image at a scale."""
    return math.floor(pixels * scale / CELL + 1e-6)

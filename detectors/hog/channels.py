"""Which numbers describe a feature cell."""

from __future__ import annotations

from enum import StrEnum

HOG_SIZE = 31  # 18 contrast-sensitive orientations, 9 insensitive ones, 4 block energies
HISTOGRAM_SIZE = 20  # bins of normalised depth
CELL = 8  # pixels of the scaled image, the side of a cell (Lai et al., section III-C)


class Channels(StrEnum):
    """The features that a model sees of a cell, always in the order: colour HOG, depth HOG, depth histogram."""

    RGB = "rgb"
    DEPTH = "depth"
    RGBD = "rgbd"

    @property
    def columns(self) -> slice:
        """Where they are among the features of `RGBD`."""
        start = HOG_SIZE if self is Channels.DEPTH else 0
        stop = HOG_SIZE if self is Channels.RGB else 2 * HOG_SIZE + HISTOGRAM_SIZE
        return slice(start, stop)

    @property
    def count(self) -> int:
        """How many numbers describe a cell: 31, 51 or 82."""
        return self.columns.stop - self.columns.start

    @property
    def use_color(self) -> bool:
        """Whether the colour image is looked at."""
        return self is not Channels.DEPTH

    @property
    def use_depth(self) -> bool:
        """Whether depth is needed."""
        return self is not Channels.RGB

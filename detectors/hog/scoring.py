"""Scores of all templates in all windows of a pyramid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from .channels import CELL
from .pyramid import Level, Pyramid
from .threads import in_threads

if TYPE_CHECKING:
    from .model import HogTemplate

# A product of matrices is made of small ones. BLAS keeps to the calling thread for fewer than 2^18 multiplications; its
# own threads, which wait for each other by spinning, make it many times slower wherever other work has a share of the
# cores.
_TILE = (32, 96)  # cells of templates, cells of the level; times 82 channels they stay below
_TILES = 3  # of the level at once, whose products stay in a core's cache


class Scorer:
    """Scores many templates at once.

    Every cell is multiplied with every cell of every template, in one matrix product; a window's score is then the sum
    of the products of its cells, wherever they are. That is the work of a convolution at the speed of a product of
    matrices, whatever the sizes of the templates.

    Args:
        templates: over the same channels. Their `weights` and `scale_weight` and `bias` count.

    Raises:
        ValueError: for no templates, or such over different channels.
    """

    def __init__(self, templates: Sequence[HogTemplate]) -> None:
        shapes = [template.weights.shape for template in templates]
        if not shapes or any(len(shape) != 3 or shape[2] != shapes[0][2] for shape in shapes):
            raise ValueError(f"expected templates (rows, columns, C) with one C, but got {shapes}")
        self.templates = tuple(templates)
        weights = np.concatenate([np.float32(t.weights).reshape(-1, shapes[0][2]) for t in templates])
        padded = np.pad(weights, ((0, -len(weights) % _TILE[0]), (0, 0)))
        by_tile = padded.reshape(-1, 1, _TILE[0], shapes[0][2])
        self._weights = np.ascontiguousarray(by_tile.swapaxes(2, 3)).swapaxes(2, 3)  # BLAS is a fifth faster with these
        self._sizes = np.array([shape[:2] for shape in shapes], dtype=np.int64)
        self._scale_weight = np.array([t.scale_weight for t in templates], dtype=np.float32)
        self._bias = np.array([t.bias for t in templates], dtype=np.float32)

    def scores(self, pyramid: Pyramid) -> tuple[np.ndarray, ...]:
        """For each level of (h, w) cells, (T, h, w) float32, T in the order of templates.

        score = <weights, features> + scale_weight * log2(scale) + bias of the window of cells [i, i + rows) x
        [j, j + columns) of the level, borders counted; -inf where it does not fit into the level.
        """
        return tuple(in_threads(self._level_scores, pyramid.levels))

    def _level_scores(self, level: Level) -> np.ndarray:
        height, width, channels = level.features.shape
        if channels != self._weights.shape[-1]:
            raise ValueError(f"expected a pyramid of {self._weights.shape[-1]} channels, but got {channels}")
        cells = height * width
        tiles = _in_tiles(level.features.reshape(cells, channels))
        out = np.empty((len(self._sizes), cells), np.float32)
        out[:] = (self._bias + self._scale_weight * np.float32(np.log2(level.scale)))[:, None]
        products = np.empty((len(self._weights) * _TILE[0], _TILES * _TILE[1]), np.float32)
        by_tile = products.reshape(-1, _TILE[0], _TILES, _TILE[1]).transpose(0, 2, 1, 3)
        for first in range(0, len(tiles), _TILES):
            some = tiles[first : first + _TILES]
            np.matmul(self._weights, some[None], out=by_tile[:, : len(some)])
            _add_products(out, products, self._sizes, width, first * _TILE[1])
        scores = out.reshape(-1, height, width)
        _close_rims(scores, self._sizes)
        return scores


def part_boxes(template: HogTemplate, level: Level, ij: np.ndarray) -> np.ndarray:
    """Boxes of the part that a template shows, in windows at (row, column) of a level.

    Args:
        template: whose window and `box` in it count.
        level: whose scale and border count.
        ij: (N, 2) first row and column of the windows, borders counted.

    Returns:
        (N, 4) xyxy, pixels from the image's outer edges; they may reach over them.
    """
    rows, columns = template.weights.shape[:2]
    x0, y0, x1, y1 = template.box
    shares = np.array([x0 * columns, y0 * rows, x1 * columns, y1 * rows])
    corner = np.asarray(ij, dtype=np.float64).reshape(-1, 2)[:, [1, 0, 1, 0]] - level.border
    return (corner + shares) * (CELL / level.scale)


def _in_tiles(features: np.ndarray) -> np.ndarray:
    """(cells, C) to (tiles, C, cells of a tile), with zeros after the last cell."""
    cells, channels = features.shape
    whole, rest = divmod(cells, _TILE[1])
    tiles = np.zeros((whole + (rest > 0), channels, _TILE[1]), np.float32)
    tiles[:whole] = features[: cells - rest].reshape(whole, _TILE[1], channels).swapaxes(1, 2)
    if rest:
        tiles[-1, :, :rest] = features[cells - rest :].T
    return tiles


@njit(cache=True, nogil=True)
def _add_products(out, products, sizes, width, first):
    """Adds to each window the products of those of its cells that are among a level's from `first` on.

    Cells and windows are counted along the lines of a level of a width, one line after the other: what a window adds
    of a cell is then a fixed way behind it. Windows that reach over the end of a line or of the level get nonsense
    (there are products left over after the last cell); `_close_rims` closes them.

    Args:
        out: (T, cells) the windows.
        products: (cells of all templates, cells from `first` on).
        sizes: (T, 2) rows and columns of the templates.
    """
    row = 0
    for t in range(len(sizes)):
        for dy in range(sizes[t, 0]):
            for dx in range(sizes[t, 1]):
                back = dy * width + dx
                begin = max(first - back, 0)
                count = min(first + products.shape[1] - back, out.shape[1]) - begin
                if count > 0:
                    window, cell = out[t, begin:], products[row, begin + back - first :]
                    for i in range(count):
                        window[i] += cell[i]
                row += 1


@njit(cache=True, nogil=True)
def _close_rims(out, sizes):
    """-inf where a template does not fit."""
    height, width = out.shape[1:]
    for t in range(len(sizes)):
        out[t, max(height - sizes[t, 0] + 1, 0) :] = -np.inf
        out[t, :, max(width - sizes[t, 1] + 1, 0) :] = -np.inf

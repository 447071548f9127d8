"""What describes a cell of an image: oriented gradients, and how far away what it shows is for its size.

The gradients are the 31-dimensional variant of Felzenszwalb et al., "Object detection with discriminatively trained
part-based models" (PAMI 2010), section 6: every pixel's gradient votes with its magnitude for one of 18 orientations in
the four cells around it. Four blocks of 2 x 2 cells hold a cell; its histogram c is divided by each block's energy over
the 9 orientations without sign, cut at 0.2, and summed up:

    18 values  1/2  sum_b min(c_o n_b, 0.2)             orientations with sign
     9 values  1/2  sum_b min((c_o + c_{o+9}) n_b, 0.2) orientations without
     4 values  0.2357  sum_o min(c_o n_b, 0.2)          one for each block (0.2357 = 1 / sqrt(18))
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .channels import CELL, HISTOGRAM_SIZE, HOG_SIZE

BIN = 0.30  # m of normalised depth, a bin of its histogram (Lai et al., section III-C)
# Grey levels out of 255, magnitude of a gradient that may be noise, or shading that says little. On rendered surveys
# mean AP of a linear discriminant was 0.872 with 3, 0.874 with 6, 0.880 with 12, 0.883 with 20; real light is dimmer.
COLOR_NOISE = 8.0
MARGIN = 2  # cells around those wanted: one for the votes of its pixels, one for the blocks
_COS = np.cos(np.arange(9) * np.pi / 9).astype(np.float32)
_SIN = np.sin(np.arange(9) * np.pi / 9).astype(np.float32)


def hog_cells(image: np.ndarray, noise_floor: float = COLOR_NOISE) -> np.ndarray:
    """Oriented gradients of an image, whose edge goes on around it; the strongest channel of a pixel counts.

    Args:
        image: (H, W) or (H, W, C).
        noise_floor: magnitude of the gradient (difference of the pixels on either side), in the image's units, that is
            noise. Blocks are divided by the energy of their gradients and of this one's in all directions, so that
            noise on an even surface stays small however even it is.

    Returns:
        (H // 8, W // 8, 31) float32.
    """
    planes = np.atleast_3d(image).transpose(2, 0, 1).astype(np.float32)
    rows, columns = planes.shape[1] // CELL, planes.shape[2] // CELL
    around = MARGIN * CELL
    below, right = (rows + MARGIN) * CELL - planes.shape[1], (columns + MARGIN) * CELL - planes.shape[2]
    padded = np.pad(planes, ((0, 0), (around, below), (around, right)), mode="edge")
    out = np.empty((rows, columns, HOG_SIZE), np.float32)
    hog_into(out, padded, CELL, noise_floor)
    return out


def hog_into(out: np.ndarray, planes: np.ndarray, cell: int, noise_floor: float) -> None:
    """The same into `out` (h, w, 31) from planes (C, (h + 4) * cell, (w + 4) * cell) that reach two cells further."""
    if out.size:
        _normalize(_histograms(planes, cell), (cell * cell * noise_floor) ** 2 * 4.0 / 9.0, out)


def depth_histograms(normalised: np.ndarray) -> np.ndarray:
    """Shares of every cell's pixels in 20 bins of 0.30 m, the last of which takes all that is farther.

    Args:
        normalised: (H, W) metres times the scale that makes objects of one true size alike; 0 where there is none.

    Returns:
        (H // 8, W // 8, 20) float32; a cell's values sum up to the share of its pixels with a reading.
    """
    height, width = normalised.shape
    out = np.empty((height // CELL, width // CELL, HISTOGRAM_SIZE), np.float32)
    histograms_into(out, np.ascontiguousarray(normalised, np.float32), CELL, 1.0)
    return out


@njit(cache=True, nogil=True)
def histograms_into(out, depth, cell, factor):
    """The same into `out` (h, w, 20) from depth (>= h * cell, >= w * cell) times a factor."""
    share, per_bin = np.float32(1.0 / (cell * cell)), np.float32(factor / BIN)
    out[:] = np.float32(0.0)
    for y in range(out.shape[0] * cell):
        row = out[y // cell]
        for i in range(out.shape[1]):
            for x in range(i * cell, (i + 1) * cell):
                z = depth[y, x] * per_bin
                if z > 0.0 and z < np.inf:
                    row[i, int(min(z, HISTOGRAM_SIZE - 1.0))] += share


@njit(cache=True, nogil=True)
def _gradients(planes, y, dx, dy, magnitude, orientation):
    """Of one line of pixels, from the second to the last but one: magnitude and which of 18 orientations."""
    count, _, width = planes.shape
    for c in range(count):
        here, above, below = planes[c, y], planes[c, y - 1], planes[c, y + 1]
        for x in range(1, width - 1):
            across, down = here[x + 1] - here[x - 1], below[x] - above[x]
            square = across * across + down * down
            take = c == 0 or square > magnitude[x]
            dx[x] = across if take else dx[x]
            dy[x] = down if take else dy[x]
            magnitude[x] = square if take else magnitude[x]
    for x in range(1, width - 1):
        orientation[x] = 0 if dx[x] >= 0.0 else 9
    best = np.abs(dx)
    for o in range(1, 9):
        cos, sin = _COS[o], _SIN[o]
        for x in range(1, width - 1):
            along = cos * dx[x] + sin * dy[x]
            size = abs(along)
            bin_ = np.int32(o) if along >= 0.0 else np.int32(o + 9)
            orientation[x] = bin_ if size > best[x] else orientation[x]
            best[x] = size if size > best[x] else best[x]
    for x in range(1, width - 1):
        magnitude[x] = np.sqrt(magnitude[x])


@njit(cache=True, nogil=True)
def _histograms(planes, cell):
    """Votes of the pixels for cells, (h + 2, w + 2, 18): those wanted and one around them."""
    height, width = planes.shape[1:]
    rows, columns, half = height // cell, width // cell, cell // 2
    out = np.zeros((rows, columns, 18), np.float32)
    line = np.empty((columns, 18), np.float32)
    dx, dy = np.zeros(width, np.float32), np.zeros(width, np.float32)
    magnitude, orientation = np.zeros(width, np.float32), np.zeros(width, np.int32)
    for y in range(half, (rows - 1) * cell + half):
        _gradients(planes, y, dx, dy, magnitude, orientation)
        line[:] = np.float32(0.0)
        for i in range(columns - 1):  # between the middles of cells i and i + 1
            for k in range(cell):
                x = half + i * cell + k
                later = np.float32((k + 0.5) / cell) * magnitude[x]
                line[i, orientation[x]] += magnitude[x] - later
                line[i + 1, orientation[x]] += later
        j = (y - half) // cell
        share = np.float32((y - half - j * cell + 0.5) / cell)
        for i in range(columns):
            for o in range(18):
                out[j, i, o] += (np.float32(1.0) - share) * line[i, o]
                out[j + 1, i, o] += share * line[i, o]
    return out[1:-1, 1:-1]


@njit(cache=True, nogil=True)
def _normalize(votes, floor, out):
    """Votes (h + 2, w + 2, 18) to features (h, w, 31); `floor` is added to the energy of every block."""
    rows, columns = out.shape[:2]
    energy = np.empty((rows + 2, columns + 2), np.float32)
    for y in range(rows + 2):
        for x in range(columns + 2):
            total = np.float32(0.0)
            for o in range(9):
                both = votes[y, x, o] + votes[y, x, o + 9]
                total += both * both
            energy[y, x] = total
    n = np.empty((rows + 1, columns + 1), np.float32)  # of the block whose upper left cell is (y, x)
    for y in range(rows + 1):
        for x in range(columns + 1):
            block = energy[y, x] + energy[y, x + 1] + energy[y + 1, x] + energy[y + 1, x + 1]
            n[y, x] = 1.0 / np.sqrt(block + floor) if block > 0.0 else 0.0
    cut, half = np.float32(0.2), np.float32(0.5)
    for y in range(rows):
        for x in range(columns):
            a, b, c, d = n[y, x], n[y, x + 1], n[y + 1, x], n[y + 1, x + 1]
            cell, feature = votes[y + 1, x + 1], out[y, x]
            in_a, in_b, in_c, in_d = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
            for o in range(18):
                in_block = min(cell[o] * a, cut), min(cell[o] * b, cut), min(cell[o] * c, cut), min(cell[o] * d, cut)
                feature[o] = half * (in_block[0] + in_block[1] + in_block[2] + in_block[3])
                in_a += in_block[0]
                in_b += in_block[1]
                in_c += in_block[2]
                in_d += in_block[3]
            for o in range(9):
                v = cell[o] + cell[o + 9]
                feature[18 + o] = half * (min(v * a, cut) + min(v * b, cut) + min(v * c, cut) + min(v * d, cut))
            scale = np.float32(0.2357)
            feature[27], feature[28], feature[29], feature[30] = in_a * scale, in_b * scale, in_c * scale, in_d * scale

"""A frame of every preset of the synthetic world, in rows.

uv run python docs/draw_worlds.py -o docs/worlds.jpg
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import cv2
import numpy as np

from thingmap.datasets.open import open_sequence

FRAMES = {  # what is shown of each preset
    "synth:tabletop?seed=2&clutter=medium": 40,
    "synth:survey?seed=1&clutter=high": 12,
    "synth:kitchen?seed=4&clutter=high": 840,
    "synth:laps?seed=7&clutter=medium": 270,
    "synth:wall?seed=1": 60,
}
WIDTH = 480  # pixels of one
QUALITY = 85


def main() -> None:
    """Render and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="JPEG file")
    output = parser.parse_args().output
    shown = [_shrunk(open_sequence(line)[index].color) for line, index in FRAMES.items()]
    columns = math.ceil(math.sqrt(len(shown)))
    rows = [np.hstack(shown[k : k + columns]) for k in range(0, len(shown), columns)]
    picture = np.vstack([_widened(row, rows[0].shape[1]) for row in rows])
    cv2.imwrite(str(output), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def _shrunk(color: np.ndarray) -> np.ndarray:
    return cv2.resize(color, (WIDTH, WIDTH * 3 // 4), interpolation=cv2.INTER_AREA)


def _widened(row: np.ndarray, width: int) -> np.ndarray:
    """In the middle of so many white columns."""
    left, spare = (width - row.shape[1]) // 2, width - row.shape[1]
    return np.pad(row, ((0, 0), (left, spare - left), (0, 0)), constant_values=255)


if __name__ == "__main__":
    main()

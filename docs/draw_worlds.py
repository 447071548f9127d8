"""A frame of every preset of the synthetic world, side by side.

uv run python docs/draw_worlds.py -o docs/worlds.jpg
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from thingmap.datasets.open import open_sequence

FRAMES = {  # what is shown of each preset
    "synth:tabletop?seed=2&clutter=medium": 40,
    "synth:survey?seed=1&clutter=high": 12,
    "synth:kitchen?seed=4&clutter=high": 840,
    "synth:laps?seed=7&clutter=medium": 270,
}
WIDTH = 480  # pixels of one
QUALITY = 85


def main() -> None:
    """Render and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="JPEG file")
    output = parser.parse_args().output
    shown = [_shrunk(open_sequence(line)[index].color) for line, index in FRAMES.items()]
    picture = np.vstack([np.hstack(shown[:2]), np.hstack(shown[2:])])
    cv2.imwrite(str(output), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def _shrunk(color: np.ndarray) -> np.ndarray:
    return cv2.resize(color, (WIDTH, WIDTH * 3 // 4), interpolation=cv2.INTER_AREA)


if __name__ == "__main__":
    main()

"""Trains the words that places are recognised by, on the synthetic world: mapper/trajectory/loops/orb_words.npz.

uv run python benchmarks/place_vocabulary.py --write           some ten minutes, 700 MB of scenes
uv run python benchmarks/place_vocabulary.py -o FILE.npz       the same, somewhere else

The scenes are `synth:survey` of all levels of clutter, of seeds that no benchmark uses; many are those of
`default_model.py`, which may share the folder.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.mapper.config import VisualConfig
from thingmap.mapper.trajectory.loops.vocabulary import SHIPPED, packed, train_vocabulary
from thingmap.mapper.trajectory.visual.features import FeatureExtractor

SEEDS = range(2, 21)  # of each level of clutter
FRAMES = 37
STRIDE = 5  # frames: 25 degrees along the survey's arc
BRANCHING, DEPTH = 8, 4  # 4096 words, 150 kB


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--write", action="store_true", help="replace the words that are shipped")
    group.add_argument("-o", "--output", type=Path, metavar="FILE", help="write them there")
    parser.add_argument("--folder", type=Path, metavar="DIR", help="keep scenes there; scenes in it are used again")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as temporary:
        descriptors = np.concatenate(list(_descriptors(options.folder or Path(temporary))))
    vocabulary = train_vocabulary(packed(descriptors), BRANCHING, DEPTH)
    output = SHIPPED if options.write else options.output
    vocabulary.save(output)
    print(f"{vocabulary.size} words of {len(descriptors)} descriptors; {output}", file=sys.stderr)
    return 0


def _descriptors(folder: Path) -> Iterator[np.ndarray]:
    """Of every image that is trained on, read from its file: what JPEG does to images belongs to it."""
    extract = FeatureExtractor(VisualConfig())
    for clutter in ClutterLevel:
        for seed in SEEDS:
            print(f"{Preset.SURVEY}, clutter {clutter}, seed {seed}", file=sys.stderr, flush=True)
            config = SyntheticConfig(Preset.SURVEY, clutter=clutter, seed=seed, frames=FRAMES)
            for frame in open_sequence(_rendered(folder, config), stride=STRIDE):
                yield extract(frame).descriptors


def _rendered(folder: Path, config: SyntheticConfig) -> Path:
    place = folder / f"{config.preset}-{config.clutter}-{config.seed}-{config.frames}"
    if not (place / "poses.txt").is_file():  # the last file but one that is written
        write_sequence(SyntheticSequence(config), place, overwrite=True)
    return place


if __name__ == "__main__":
    sys.exit(main())

"""Learns the second stage of the HOG model that is shipped: it replaces that of detectors/hog/models/synthetic.npz.

uv run python benchmarks/hog_second_stage.py --write            about an hour on two cores
uv run python benchmarks/hog_second_stage.py -o FILE.npz        the same, somewhere else

The scenes are rendered ones of seeds that neither a benchmark nor the training of the templates uses.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from hog_model import rendered, scene_name
from learning_script import run_script
from timing import StageLines

from thingmap.datasets.object_views.backgrounds import Backgrounds
from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.detectors.hog.model import load_model, shipped_model
from thingmap.detectors.hog.training.network_fit import FitConfig
from thingmap.detectors.hog.training.second_stage import SecondStageConfig, train_second_stage

# preset, frames, pace, seeds of each level of clutter, frames from one that is looked at to the next
SCENES = (
    (Preset.TABLETOP, 30, 8.0, range(100, 172), 2),
    (Preset.SURVEY, 37, 1.0, range(100, 106), 2),
    (Preset.KITCHEN, 112, 8.0, range(100, 102), 3),
)
QUICK_SCENES = ((Preset.TABLETOP, 6, 8.0, range(100, 102), 1),)
QUICK_CONFIG = SecondStageConfig(fit=FitConfig(hidden=(8,), dropout=(0.0, 0.0), epochs=2))


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, learn, write; 2 for a user's mistake."""
    return run_script(arguments, __doc__, shipped_model(), learn)


def learn(folder: Path, output: Path, quick: bool = False) -> None:
    """The shipped model's templates with a second stage learned anew, into a file."""
    frames, names = [], []
    for config, stride in scene_configs(quick):
        frames.append(Backgrounds(open_sequence(rendered(folder, config)), stride=stride))
        names.append(scene_name(config))
    settings = QUICK_CONFIG if quick else SecondStageConfig()
    model = train_second_stage(
        load_model(shipped_model()), Backgrounds.joined(frames), settings, StageLines(), tuple(names)
    )
    model.save(output)


def scene_configs(quick: bool = False) -> Iterator[tuple[SyntheticConfig, int]]:
    """What is rendered, and the stride of its frames."""
    for preset, frames, pace, seeds, stride in QUICK_SCENES if quick else SCENES:
        for seed in seeds:
            for clutter in ClutterLevel:
                yield SyntheticConfig(preset=preset, clutter=clutter, seed=seed, frames=frames, pace=pace), stride


if __name__ == "__main__":
    sys.exit(main())

"""Learns what the mapper has to know of the HOG model that is shipped: factors/evidence_hog.json.

uv run python benchmarks/hog_evidence.py --write            about a quarter of an hour on one core
uv run python benchmarks/hog_evidence.py -o FILE.json       the same, somewhere else

The scenes are rendered ones of seeds that no benchmark uses, nor the training of the templates: there they are surer
than they should be.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numba
from learning_script import run_script
from suite import Scene
from suite_job import is_rendered, render, scene_folder

from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.detectors.detector import Detector
from thingmap.detectors.spec import make_detector
from thingmap.factors.evidence_model import SHIPPED_HOG
from thingmap.mapper.learning.existence import learn_existence
from thingmap.mapper.learning.known_scene import KnownScene, open_known_scene
from thingmap.mapper.learning.learn import collect_samples, learn

# preset, frames, seeds of each level of clutter
SCENES = ((Preset.TABLETOP, 150, (50, 51, 52)), (Preset.SURVEY, 37, (10, 11, 12)))
QUICK_SCENES = ((Preset.TABLETOP, 6, (50,)),)
NAME = "HOG templates of the synthetic world"


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, learn, write; 2 for a user's mistake."""
    return run_script(arguments, __doc__, SHIPPED_HOG, learn_hog)


def learn_hog(folder: Path, output: Path, quick: bool = False) -> None:
    """Scores and rates from true poses, then how sure to be of what they add up to."""
    numba.set_num_threads(1)
    scenes = list(_scenes(folder, quick))
    samples = collect_samples(scenes)
    first = learn(samples, NAME)
    found = learn_existence(scenes, first.model, samples.classes, on_frame=_say)
    found.model.save(output)
    print(f"{found.summary()}; {output}", file=sys.stderr)


def _scenes(folder: Path, quick: bool) -> Iterator[tuple[KnownScene, Detector]]:
    for preset, frames, seeds in QUICK_SCENES if quick else SCENES:
        for seed in seeds:
            for clutter in ClutterLevel:
                scene = Scene(preset, clutter, seed, frames)
                if not is_rendered(scene, folder):
                    render(scene, folder)
                known = open_known_scene(str(scene_folder(scene, folder)))
                yield known, make_detector("hog", known.sequence)


def _say(frames: int) -> None:
    if frames % 100 == 0:
        print(f"mapped {frames} frames", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())

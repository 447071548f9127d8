"""Learns the evidence model that is shipped, on the synthetic world: factors/evidence_model.json.

uv run python benchmarks/default_model.py --write           about 15 minutes on two cores, 1 GB of scenes
uv run python benchmarks/default_model.py -o FILE.json      the same, somewhere else

The scenes are `synth:survey` of all levels of clutter, and a few of `synth:tabletop`, of seeds that no benchmark uses.
The simulated detector has another seed in every scene, so that no luck of one detector is learned; in every other
scene it is also tried without object parts.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numba

from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.detectors.detector import Detector
from thingmap.detectors.spec import make_detector
from thingmap.factors.evidence_model import SHIPPED
from thingmap.mapper.learning.existence import learn_existence
from thingmap.mapper.learning.known_scene import KnownScene, open_known_scene
from thingmap.mapper.learning.learn import collect_samples, learn

SCENES = ((Preset.SURVEY, 37, 12), (Preset.TABLETOP, 150, 1))  # preset, frames, seeds of each level of clutter
WITHOUT_PARTS = 100  # added to the seed of the detector that has none
NAME = "simulated, a seed a scene, with and without parts"


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, learn, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, metavar="DIR", help="keep scenes there; scenes in it are used again")
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--write", action="store_true", help="replace the model that is shipped")
    group.add_argument("-o", "--output", type=Path, metavar="FILE", help="write it there")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        _learn(options.folder or Path(temporary), SHIPPED if options.write else options.output)
    return 0


def _learn(folder: Path, output: Path) -> None:
    places = [_render(folder, config) for config in _configs()]
    numba.set_num_threads(1)
    scenes = list(_with_detectors(places))
    samples = collect_samples([(scene, detector) for scene, detector in scenes if detector.config.parts])
    first = learn(samples, NAME)
    found = learn_existence(scenes, first.model, samples.classes, on_frame=_say)
    found.model.save(output)
    print(f"{found.summary()}; {output}", file=sys.stderr)


def _configs() -> Iterator[SyntheticConfig]:
    for preset, frames, seeds in SCENES:
        for seed in range(1, seeds + 1):
            for clutter in ClutterLevel:
                yield SyntheticConfig(preset=preset, clutter=clutter, seed=seed, frames=frames)


def _render(folder: Path, config: SyntheticConfig) -> Path:
    place = folder / f"{config.preset}-{config.clutter}-{config.seed}-{config.frames}"
    if not (place / "poses.txt").is_file():  # the last file but one that is written
        write_sequence(SyntheticSequence(config), place, overwrite=True)
    return place


def _with_detectors(places: Sequence[Path]) -> Iterator[tuple[KnownScene, Detector]]:
    for number, place in enumerate(places, start=1):
        specs = [f"simulated?seed={number}&parts=1"]
        if number % 2 == 0:
            specs.append(f"simulated?seed={number + WITHOUT_PARTS}")
        for spec in specs:
            scene = open_known_scene(str(place))
            yield scene, make_detector(spec, scene.sequence)


def _say(frames: int) -> None:
    print(f"mapped {frames} frames", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())

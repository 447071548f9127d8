"""What the graph has to know of the shape-context detector, learned on scenes that no benchmark uses.

Neither are they those that the detector's codebooks were calibrated on: there it is surer than it should be.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from shape_context_detections import detect
from shape_context_job import STEP, mapper_config
from suite import Scene
from suite_job import is_rendered, render, scene_folder

from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.detectors.detector import Detector
from thingmap.detectors.recorded import RecordedDetections
from thingmap.mapper.learning.existence import learn_existence
from thingmap.mapper.learning.known_scene import KnownScene, open_known_scene
from thingmap.mapper.learning.learn import collect_samples, learn

# preset, frames, seeds, every how many frames: those of a survey are far apart by themselves
SCENES = ((Preset.TABLETOP, 150, (3, 7), STEP), (Preset.SURVEY, 37, (9, 10, 11, 12), 1))
QUICK_SCENES = ((Preset.TABLETOP, 20, (3,), STEP),)
NAME = "shape contexts"


def evidence_file(folder: Path, model: Path) -> Path:
    """Where `learn_evidence` leaves what it learned of a detector's model."""
    return folder / "models" / f"evidence-{model.stem}.json"


def learn_evidence(model: Path, folder: Path, quick: bool = False) -> Path:
    """The file of an evidence model learned anew; scenes are rendered if absent.

    Raises:
        UserError: the detector finds nothing to learn from.
    """
    file = evidence_file(folder, model)
    file.parent.mkdir(parents=True, exist_ok=True)
    scenes = list(_scenes(model, folder, quick))
    samples = collect_samples(scenes)
    learned = learn(samples, NAME)
    whole = learn_existence(scenes, learned.model, samples.classes, mapper_config(poses=False))
    whole.model.save(file)
    print(f"{whole.summary()}; {file}", file=sys.stderr, flush=True)
    return file


def _scenes(model: Path, folder: Path, quick: bool) -> Iterator[tuple[KnownScene, Detector]]:
    for preset, frames, seeds, step in QUICK_SCENES if quick else SCENES:
        for seed in seeds:
            for clutter in ClutterLevel:
                scene = Scene(preset, clutter, seed, frames)
                if not is_rendered(scene, folder):
                    render(scene, folder)
                found = detect(scene, model, folder, step)
                print(f"detected in {scene.name}, {found.milliseconds:.0f} ms a frame", file=sys.stderr, flush=True)
                known = open_known_scene(str(scene_folder(scene, folder)), stride=step)
                yield known, RecordedDetections(found.file)

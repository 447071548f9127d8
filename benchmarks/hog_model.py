"""Trains the HOG model that is shipped, on the synthetic world: detectors/hog/models/synthetic.npz.

uv run python benchmarks/hog_model.py --write               about half an hour on two cores, 1.2 GB of scenes
uv run python benchmarks/hog_model.py -o FILE.npz           the same, somewhere else
uv run python benchmarks/hog_model.py --channels rgb        a model of one kind for benchmarks/hog.py, into --folder

Objects are seen in two ways: as they stand in rendered rooms, seen well, and alone on a turntable, many more of each
class, put into those rooms. Backgrounds are the frames of the same rooms, whose objects are known. No seed is one that
a benchmark uses.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from timing import StageLines

from thingmap.datasets.errors import UserError
from thingmap.datasets.object_views.backgrounds import Backgrounds
from thingmap.datasets.object_views.object_view import ObjectViews
from thingmap.datasets.object_views.sequence_views import sequence_views
from thingmap.datasets.object_views.turntable import Turntable, turntable_views
from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.datasets.synthetic.things.models import CLASSES, build_model
from thingmap.datasets.synthetic.things.objects import Model
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.model import shipped_model
from thingmap.detectors.hog.training.config import TrainConfig
from thingmap.detectors.hog.training.train import train

# preset, frames, pace, seeds of each level of clutter, frames from one view and from one background to the next
SCENES = (
    (Preset.TABLETOP, 150, 1.0, 2, 6, 15),
    (Preset.SURVEY, 37, 1.0, 8, 6, 9),
    (Preset.KITCHEN, 112, 8.0, 1, 4, 8),
)
QUICK_SCENES = ((Preset.TABLETOP, 20, 1.0, 1, 5, 5),)
INSTANCES = 12  # of a class on the turntable
# The cameras of the rooms look down by 5 to 30 degrees, from 0.9 to 3 m; only on a walk they come above a thing.
TURNTABLE = Turntable(elevations=(12.0, 20.0, 30.0, 45.0), distances=(0.9, 1.3, 1.8), azimuths=3)
CONFIG = TrainConfig(views=400)
QUICK_CONFIG = TrainConfig(rounds=1, views=30, held_out_views=10, other_views=20, composed_frames=2)
INSTANCE_STREAM = 31  # of chance


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train, write; 2 for a user's mistake."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add, kinds = parser.add_argument, [kind.value for kind in Channels]
    add("--folder", type=Path, metavar="DIR", help="keep scenes and models there; scenes in it are used again")
    add("--channels", choices=kinds, default=Channels.RGBD.value, help="what templates look at (default: rgbd)")
    add("--quick", action="store_true", help="a minute of training, to see whether everything works")
    add("-o", "--out", type=Path, metavar="FILE", help="write the model there too")
    add("--write", action="store_true", help="replace the model that is shipped")
    options = parser.parse_args(arguments)
    if options.write and (options.quick or options.out or options.channels != Channels.RGBD.value):
        parser.error("--write is for the whole training on colour and depth, and takes no --out")
    if not (options.write or options.out or options.folder):
        parser.error("say where the model goes: --write, --out FILE or --folder DIR")
    with tempfile.TemporaryDirectory() as temporary:
        try:
            model = train_model(options.folder or Path(temporary), Channels(options.channels), options.quick)
            target = shipped_model() if options.write else options.out
            if target is not None:
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(model, target)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    return 0


def model_file(folder: Path, channels: Channels, quick: bool = False) -> Path:
    """Where `train_model` leaves its model."""
    return folder / "models" / f"{channels}{'-quick' if quick else ''}.npz"


def train_model(folder: Path, channels: Channels, quick: bool = False) -> Path:
    """The file of a model trained anew, or from where an interrupted training stopped; scenes are rendered if absent.

    Raises:
        UserError: the folder cannot be written, or training lacks something.
    """
    file = model_file(folder, channels, quick)
    checkpoint = file.with_suffix(".npz.part")
    file.parent.mkdir(parents=True, exist_ok=True)
    views, backgrounds, names = material(folder, quick)
    config = replace(QUICK_CONFIG if quick else CONFIG, channels=channels)
    start = time.perf_counter()
    model = train(views, backgrounds, config, StageLines(), checkpoint, names)
    model.save(file)
    checkpoint.unlink(missing_ok=True)
    said = f"{len(views)} views, {len(backgrounds)} backgrounds, {(time.perf_counter() - start) / 60.0:.1f} min"
    print(f"{said}, {file.stat().st_size / 1e6:.2f} MB in {file}", file=sys.stderr, flush=True)
    return file


def material(folder: Path, quick: bool = False) -> tuple[ObjectViews, Backgrounds, tuple[str, ...]]:
    """Views of objects, backgrounds, and names of where they come from."""
    views, backgrounds, names = [], [], []
    for config, view_stride, background_stride in scene_configs(quick):
        sequence = open_sequence(rendered(folder, config))
        views.append(sequence_views(sequence, view_stride))
        backgrounds.append(Backgrounds(sequence, stride=background_stride))
        names.append(scene_name(config))
    count = 3 if quick else INSTANCES
    views.append(turntable_views(models(count), turntable=replace(TURNTABLE, azimuths=1) if quick else TURNTABLE))
    names.append(f"{count} models of each class on a turntable")
    return ObjectViews.joined(views), Backgrounds.joined(backgrounds), tuple(names)


def scene_configs(quick: bool = False) -> Iterator[tuple[SyntheticConfig, int, int]]:
    """What is rendered, and the strides of its views and of its backgrounds."""
    for preset, frames, pace, seeds, view_stride, background_stride in QUICK_SCENES if quick else SCENES:
        for seed in range(1, seeds + 1):
            for clutter in ClutterLevel:
                config = SyntheticConfig(preset=preset, clutter=clutter, seed=seed, frames=frames, pace=pace)
                yield config, view_stride, background_stride


def models(count: int) -> Iterator[Model]:
    """`count` things of every class, none of which stands in a room."""
    for label in CLASSES:
        for k in range(count):
            yield build_model(label, np.random.default_rng([INSTANCE_STREAM, CLASSES.index(label), k]))


def scene_name(config: SyntheticConfig) -> str:
    """Such as "tabletop-high-2-150": whatever the rendering depends on, as the frozen suite names its scenes."""
    pace = "" if config.pace == 1.0 else f"-x{config.pace:g}"
    return f"{config.preset}-{config.clutter}-{config.seed}-{config.frames}{pace}"


def rendered(folder: Path, config: SyntheticConfig) -> Path:
    """The folder of a scene, rendered if it is not there."""
    place = folder / "scenes" / scene_name(config)
    if not (place / "poses.txt").is_file():  # the last file but one that is written
        write_sequence(SyntheticSequence(config), place, overwrite=True)
    return place


if __name__ == "__main__":
    sys.exit(main())

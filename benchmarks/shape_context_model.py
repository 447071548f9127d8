"""Trains the shape-context model that is shipped, on the synthetic world: detectors/shape_context/models/synthetic.npz.

uv run python benchmarks/shape_context_model.py --write          replace the shipped one
uv run python benchmarks/shape_context_model.py -o FILE.npz      the same, somewhere else

Objects are those of hog_model.py on its turntable, each by itself and with its mask; the views that it takes from rooms
have none. What is no object is learned from the frames of the same rooms, and so is what a score is worth there. No
seed is one that a benchmark uses.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from hog_model import INSTANCES, TURNTABLE, models, rendered, scene_configs, scene_name
from timing import StageLines

from thingmap.datasets.errors import UserError
from thingmap.datasets.object_views.backgrounds import Backgrounds
from thingmap.datasets.object_views.object_view import ObjectViews
from thingmap.datasets.object_views.turntable import turntable_views
from thingmap.datasets.open import open_sequence
from thingmap.detectors.shape_context.model import ShapeContextModel, shipped_model
from thingmap.detectors.shape_context.training.config import TrainConfig
from thingmap.detectors.shape_context.training.train import train

CONFIG = TrainConfig()
QUICK_CONFIG = TrainConfig(radii=(0.07, 0.15), entries=400, views=40, held_out_views=12, other_views=20, frames=6)
QUICK_INSTANCES = 3


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train, write; 2 for a user's mistake."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--folder", type=Path, metavar="DIR", help="keep scenes and the model there; scenes in it are used again")
    add("--quick", action="store_true", help="a minute of training, to see whether everything works")
    add("-o", "--out", type=Path, metavar="FILE", help="write the model there too")
    add("--write", action="store_true", help="replace the model that is shipped")
    options = parser.parse_args(arguments)
    if options.write and (options.quick or options.out):
        parser.error("--write is for the whole training, and takes no --out")
    if not (options.write or options.out or options.folder):
        parser.error("say where the model goes: --write, --out FILE or --folder DIR")
    with tempfile.TemporaryDirectory() as temporary:
        try:
            model = train_model(options.folder or Path(temporary), options.quick)
            target = shipped_model() if options.write else options.out
            if target is not None:
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(model, target)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    return 0


def model_file(folder: Path, name: str = "shape-context", quick: bool = False) -> Path:
    """Where `train_model` leaves its model."""
    return folder / "models" / f"{name}{'-quick' if quick else ''}.npz"


def train_model(
    folder: Path, quick: bool = False, config: TrainConfig | None = None, name: str = "shape-context"
) -> Path:
    """The file of a model trained anew, or from where an interrupted training stopped; scenes are rendered if absent.

    Args:
        folder: of scenes and models.
        quick: few views and frames.
        config: None for the shipped model's, or the quick one's.
        name: of the file.

    Raises:
        UserError: the folder cannot be written, or training lacks something.
    """
    file = model_file(folder, name, quick)
    checkpoint = file.with_suffix(".npz.part")
    file.parent.mkdir(parents=True, exist_ok=True)
    views, backgrounds, names = material(folder, quick)
    start = time.perf_counter()
    model = train(views, backgrounds, config or (QUICK_CONFIG if quick else CONFIG), StageLines(), checkpoint, names)
    model.save(file)
    checkpoint.unlink(missing_ok=True)
    said = f"{len(views)} views, {len(backgrounds)} backgrounds, {(time.perf_counter() - start) / 60.0:.1f} min"
    print(f"{said}, {file.stat().st_size / 1e6:.2f} MB in {file}\n{_chosen(model)}", file=sys.stderr, flush=True)
    return file


def material(folder: Path, quick: bool = False) -> tuple[ObjectViews, Backgrounds, tuple[str, ...]]:
    """Views of objects with masks, backgrounds, and names of where they come from."""
    turntable, count = (replace(TURNTABLE, azimuths=1), QUICK_INSTANCES) if quick else (TURNTABLE, INSTANCES)
    backgrounds, names = [], [f"{count} models of each class on a turntable"]
    for config, _, stride in scene_configs(quick):
        backgrounds.append(Backgrounds(open_sequence(rendered(folder, config)), stride=stride))
        names.append(scene_name(config))
    return turntable_views(models(count), turntable=turntable), Backgrounds.joined(backgrounds), tuple(names)


def _chosen(model: ShapeContextModel) -> str:
    """What training chose, in a line."""
    entries = sum(map(len, model.codebooks))
    return (
        f"radius {100 * model.about['radius']:g} cm, {entries} descriptors of classes, rivals {model.about['rivals']}"
    )


if __name__ == "__main__":
    sys.exit(main())

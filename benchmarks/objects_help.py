"""Do objects help the trajectory? The same sequences mapped with and without what objects say about the camera.

uv run python benchmarks/objects_help.py --folder DIR --write         all conditions, 20 scenes each
uv run python benchmarks/objects_help.py --conditions normal --seeds 3 --frames 60
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from objects_help_report import describe
from results import show_section
from suite import FIRST_SEED
from trajectory_job import changed, map_sequence, open_one, render, run_all, scene_folder
from trajectory_measures import measure

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import Preset, SyntheticConfig
from thingmap.mapper.config import MapperConfig

TITLE = "Do objects help?"
SEEDS = 20
WIDTH = 320  # pixels: four times as fast as 640, and features are still plenty
OBJECTS, NO_OBJECTS = {"smoother.joint": True}, {"smoother.joint": False}


@dataclass(frozen=True, slots=True)
class Condition:
    """Where objects may or may not help.

    Attributes:
        name, title: short and stable; for people.
        scene: what differs from `SyntheticConfig`'s defaults.
        both: what differs from the mapper's defaults with and without objects, by dotted name.
        with_objects, without: what differs between the two.
    """

    name: str
    title: str
    scene: Mapping[str, Any]
    both: Mapping[str, Any] = field(default_factory=dict)
    with_objects: Mapping[str, Any] = field(default_factory=lambda: OBJECTS)
    without: Mapping[str, Any] = field(default_factory=lambda: NO_OBJECTS)

    def config(self, objects: bool) -> MapperConfig:
        """Of one of the two mappers.

        Raises:
            UserError: this version's configuration has no such name.
        """
        return changed(MapperConfig(), {**self.both, **(self.with_objects if objects else self.without)})

    def scenes(self, seeds: int, frames: int | None, width: int) -> list[SyntheticConfig]:
        """One a seed, of at most `frames` frames."""
        length = min(self.scene["frames"], frames or self.scene["frames"])
        values = {**self.scene, "frames": length, "width": width}
        return [SyntheticConfig(seed=FIRST_SEED + k, **values) for k in range(seeds)]


TABLETOP = {"preset": Preset.TABLETOP, "frames": 150}
NO_IMAGES = {"visual.enabled": False, "loops.appearance": False, "hybrid.enabled": False}
NO_LINKS = {"loops.enabled": False}
LAPS = {"preset": Preset.LAPS, "frames": 1100}  # a lap of about 1000 frames, and the first keyframes once more
CONDITIONS = (
    Condition("normal", "as it is", TABLETOP),
    Condition("few-features", "few features: nothing from images", TABLETOP, NO_IMAGES),
    Condition("steps", "steps alone: no links by depth, nothing from images", TABLETOP, NO_IMAGES | NO_LINKS),
    Condition("few-objects", "few objects: 3 on the table", {**TABLETOP, "objects": 3}),
    Condition(
        "constellation",
        "nothing from images: loops closed by constellations of things, against none",
        LAPS,
        NO_IMAGES,
        {"loops.constellation": True},
        {"loops.constellation": False},
    ),
)


@dataclass(frozen=True, slots=True)
class Job:
    """A rendered scene to be mapped with or without objects."""

    condition: Condition
    scene: SyntheticConfig
    folder: Path
    objects: bool


def run(job: Job) -> float:
    """ATE in metres."""
    sequence = open_one(scene_folder(job.scene, job.folder), None)
    config = job.condition.config(job.objects)
    return measure(map_sequence(sequence, f"simulated?seed={job.scene.seed}", config), sequence).ate


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, map twice, compare, show; 2 for a user's mistake."""
    options = _options(arguments)
    conditions, left_out = _possible([c for c in CONDITIONS if c.name in options.conditions])
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        scenes = {c.name: c.scenes(options.seeds, options.frames, options.width) for c in conditions}
        wanted = {scene_folder(scene, folder): (scene, folder) for several in scenes.values() for scene in several}
        calls = {
            (c.name, scene.seed, objects): (Job(c, scene, folder, objects),)
            for c in conditions
            for scene in scenes[c.name]
            for objects in (True, False)
        }
        try:
            run_all(render, {place.name: call for place, call in wanted.items()}, min(options.jobs, 1))
            ate = run_all(run, calls, options.jobs)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    pairs = {
        c.title: np.array([[ate[c.name, scene.seed, objects] for objects in (True, False)] for scene in scenes[c.name]])
        for c in conditions
    }
    show_section(TITLE, describe(pairs, left_out), options.write)
    return 0


def _possible(conditions: Sequence[Condition]) -> tuple[list[Condition], list[str]]:
    """The conditions that this version's configuration can be in, and why the others are left out."""
    possible, left_out = [], []
    for condition in conditions:
        try:
            condition.config(True), condition.config(False)
            possible.append(condition)
        except UserError as error:
            left_out.append(f"{condition.title}: {error}")
    return possible, left_out


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add, names = parser.add_argument, [condition.name for condition in CONDITIONS]
    add("--conditions", nargs="+", choices=names, default=names, help="only these (default: all)")
    add("--seeds", type=int, default=SEEDS, metavar="N", help=f"scenes of each condition (default {SEEDS})")
    add("--frames", type=int, metavar="N", help="at most so many frames of each")
    add("--width", type=int, default=WIDTH, metavar="PIXELS", help=f"of rendered images (default {WIDTH})")
    add("--folder", type=Path, metavar="DIR", help="keep rendered scenes there; scenes in it are used again")
    add("--jobs", type=int, default=2, metavar="N", help="at a time, in own processes; 0: in this one (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if min(options.seeds, options.frames or 1) < 1 or options.jobs < 0:
        parser.error("--seeds and --frames count from 1, --jobs from 0")
    if options.write and (options.seeds < SEEDS or options.frames):
        parser.error(f"--write is for {SEEDS} seeds or more, and for whole sequences: without --frames")
    return options


if __name__ == "__main__":
    sys.exit(main())

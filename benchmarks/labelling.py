"""The experiments of Lai et al. on rendered tables: labels of points by each smoothness term, boxes checked by them.

uv run python benchmarks/labelling.py --folder DIR --write     all of it, about an hour on two cores
uv run python benchmarks/labelling.py --quick                  short scenes

Tables at three levels of clutter, of seeds that nothing was tried on. Each is mapped, every 10th frame gives evidence,
and the points are labelled with each term of figure 4: by the detector alone, as in the paper, and with the volumes of
the map's things as evidence besides. Detectors are HOG templates with their probability maps (the paper's), and the
simulated one's boxes. Boxes are checked in frames that no label comes from.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from judging import judge_all
from labelling_folder import Job
from labelling_job import MANY, JudgedScene, judge_scene
from labelling_report import box_table, category_table, clutter_table, f_table, verdicts
from results import show_section
from suite import FIRST_SEED, Scene

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import ClutterLevel, Preset

TITLE = "Labelled points"
DETECTORS = {"HOG maps": "hog", "Simulated boxes": "simulated?seed=1"}
SEEDS, FRAMES, QUICK_FRAMES = 3, 300, 20  # scenes of each level of clutter


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, map, label, judge, show; 2 for a user's mistake."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        try:
            scenes = scenes_of(options.first_seed, options.seeds, options.quick)
            jobs = [Job(s, folder, DETECTORS[name], options.reuse) for name in options.detectors for s in scenes]
            judged = judge_all(judge_scene, jobs, options.jobs, lambda job: f"{job.scene.name}, {job.detector}")
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    parts = [
        describe(name, [one for one in judged if one.job.detector == DETECTORS[name]]) for name in options.detectors
    ]
    note = (
        f"{len(scenes)} tables of seeds from {options.first_seed} on, labelled by every {MANY}th of "
        f"{scenes[0].frames} frames. Macro F is that of the classes of objects, as in the paper's text; with "
        "background it is as its figure 4 has it."
    )
    show_section(TITLE, "\n\n".join([note, *parts]), options.write)
    return 0


def scenes_of(first_seed: int, seeds: int, quick: bool) -> list[Scene]:
    """What is judged: so many of each level of clutter."""
    count, frames = (1, QUICK_FRAMES) if quick else (seeds, FRAMES)
    return [Scene(Preset.TABLETOP, level, first_seed + k, frames) for level in ClutterLevel for k in range(count)]


def describe(name: str, judged: Sequence[JudgedScene]) -> str:
    """Markdown of one detector: whether aims are reached, figure 4, figure 5, clutter, figure 8."""
    return "\n\n".join(
        [
            f"### {name}",
            verdicts(judged),
            f_table(judged),
            "The detector alone, by category (%):",
            category_table(judged, volumes=False),
            "With the map's volumes as evidence:",
            category_table(judged, volumes=True),
            clutter_table(judged),
            "Boxes of frames that no label comes from: as the detector gives them -> those that labels agree with -> "
            "each thing once, its box drawn midway to its points:",
            box_table(judged),
        ]
    )


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--folder", type=Path, metavar="DIR", help="keep scenes, maps and evidence there; scenes are used again")
    add("--reuse", action="store_true", help="take what DIR holds of maps and evidence")
    add("--quick", action="store_true", help="a short scene of each level of clutter")
    add("--jobs", type=int, default=2, metavar="N", help="scenes judged at a time (default 2)")
    add("--seeds", type=int, default=SEEDS, metavar="N", help=f"scenes of each level (default {SEEDS})")
    add("--first-seed", type=int, default=FIRST_SEED, metavar="N", help=f"of the scenes (default {FIRST_SEED})")
    add("--detectors", nargs="+", choices=DETECTORS, default=list(DETECTORS), metavar="NAME", help="only some")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    chosen = options.seeds, options.first_seed, tuple(options.detectors)
    if options.write and (options.quick or chosen != (SEEDS, FIRST_SEED, tuple(DETECTORS))):
        parser.error("--write is for all scenes and detectors")
    if options.jobs < 1 or options.seeds < 1 or options.first_seed < 0:
        parser.error("--jobs and --seeds count from 1, --first-seed from 0")
    return options


if __name__ == "__main__":
    sys.exit(main())

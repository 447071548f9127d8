"""A small synthetic run, mapped once and labelled once, for tests of the whole job."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path
from typing import NamedTuple

from typer.testing import CliRunner

from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.detectors.spec import make_detector
from thingmap.mapper.cli.main import app
from thingmap.mapper.evaluation.inputs.build_case import build_case
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.evaluation.points.label_scores import mean_f, score_labels
from thingmap.mapper.evaluation.points.labelled_points import label_points
from thingmap.mapper.labelling.label_run import LabelJob, LabelReport
from thingmap.mapper.labelling.labelling_config import LabellingConfig
from thingmap.mapper.labelling.mrf_config import MrfConfig, Smoothness
from thingmap.mapper.labelling.voxel_config import VoxelConfig
from thingmap.mapper.map.store import OutputFolder

SYNTH = "synth:tabletop?seed=3&frames=16&width=240&clutter=low"
FRAMES = 16
DETECTOR = "simulated?half_side=6&score_side=7&background_spots=0&chance_rate=0"  # one for small images
CONFIG = LabellingConfig(
    stride=2,
    voxels=VoxelConfig(pixel_step=2),  # images are small
    mrf=MrfConfig(smoothness=Smoothness.COLOUR),
)
LOOKED_AT = FRAMES // 2


class Labelled(NamedTuple):
    """The folder of a run, and what labelling it said."""

    out: Path
    report: LabelReport


@cache
def mapped(base: Path) -> Path:
    """The run's folder, not to be changed; in pytest's temporary folder `base`, for the whole session."""
    out = base / "mapped_to_label"
    arguments = ["run", SYNTH, "-o", str(out), "--odometry", "poses", "--detector", DETECTOR]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    return out


@cache
def labelled(base: Path) -> Labelled:
    """The same, labelled; not to be changed either."""
    out = shutil.copytree(mapped(base), base / "labelled")
    return Labelled(out, label(out))


@cache
def small_sequence():
    return open_sequence(SYNTH)


def label(out, config=CONFIG, sequence=None, detector=None, spec=DETECTOR, should_stop=lambda: False, **options):
    """Label a run with its own sequence and detector, where nothing else is given."""
    detector = detector or make_detector(spec, small_sequence())
    job = LabelJob(OutputFolder.open(out), sequence or small_sequence(), detector, spec, config, **options)
    return job.execute(should_stop=should_stop)


def macro_f(out) -> float:
    """Of the labels, or the boxes of things where there are none."""
    case = build_case(load_run(out), open_truth(SYNTH))
    points = label_points(case)
    return mean_f(score_labels(points.found, points.true, case.truth.classes).objects) or 0.0

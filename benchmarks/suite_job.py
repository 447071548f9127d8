"""One scene, rendered; one scene mapped by one variant, and judged. Each runs in a process of its own."""

from __future__ import annotations

from pathlib import Path

import numba
from suite import SNAPSHOTS, WHOLE, Scene, Variant

from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper.config_file import dump_config
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.evaluate import evaluate_run
from thingmap.mapper.evaluation.reporting.page import render_page
from thingmap.mapper.evaluation.reporting.pictures import take_pictures
from thingmap.mapper.evaluation.reporting.report import Report, read_report, to_report, write_report
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.runner import SequenceRun
from thingmap.mapper.saving import save_run
from thingmap.mapper.snapshots import SnapshotWriter

DETECTOR = "simulated?seed=1"


def is_rendered(scene: Scene, folder: Path) -> bool:
    """Whether the scene is there already, whole: its poses are the last file but one that is written."""
    return (scene_folder(scene, folder) / "poses.txt").is_file()


def render(scene: Scene, folder: Path) -> None:
    """Writes the scene's sequence with its truth, on all cores."""
    write_sequence(SyntheticSequence(scene.config), scene_folder(scene, folder), overwrite=True)


def scene_folder(scene: Scene, folder: Path) -> Path:
    """Where the scene's sequence is."""
    return folder / "scenes" / scene.name


def judge(scene: Scene, variant: Variant, folder: Path) -> None:
    """Maps a rendered scene and evaluates the map.

    The whole mapper runs as the command does, doubtful things written too, since existence is judged by them.
    """
    numba.set_num_threads(1)
    place = scene_folder(scene, folder)
    out = OutputFolder.create(folder / "maps" / variant.name / scene.name, overwrite=True)
    sequence = open_sequence(place)
    mapper = SemanticMapper(make_detector(DETECTOR, sequence), variant.config, source=sequence.name)
    run = SequenceRun(sequence, mapper, SnapshotWriter(out, mapper, SNAPSHOTS.get(scene.preset, ())))
    report = run.execute()
    command = {"sequence": scene.name, "detector": DETECTOR, "variant": variant.name}
    save_run(out, mapper, report, config=dump_config(variant.config), command=command, include_doubtful=True)
    detector = DETECTOR if variant == WHOLE else "none"  # single views are the same for all
    truth = open_truth(place)
    judged = to_report(evaluate_run(out.path, truth, EvaluationConfig(), detector))
    page = None
    if variant == WHOLE:
        pictures = take_pictures((case for result in judged.results for case in result.worst), truth.sequence)
        page = render_page(judged, pictures)
    write_report(judged, page, report_folder(scene, variant, folder))


def report_folder(scene: Scene, variant: Variant, folder: Path) -> Path:
    """Where `judge` leaves its report."""
    return folder / "reports" / variant.name / scene.name


def read_judgement(scene: Scene, variant: Variant, folder: Path) -> Report:
    """The report that `judge` left."""
    return read_report(report_folder(scene, variant, folder))

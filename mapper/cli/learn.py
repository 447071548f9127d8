"""`thingmap learn`: what a detector does when objects are hidden, from sequences whose objects are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .progress import FrameProgress
from .sources import DatasetOption, MaxFramesOption, StrideOption, skipped_line

if TYPE_CHECKING:
    from ...detectors.detector import Detector
    from ..learning.existence import LearnedExistence
    from ..learning.known_scene import KnownScene
    from ..learning.learn import Learned


def learn(
    sequences: Annotated[
        list[str], typer.Argument(metavar="SEQUENCE...", help="Sequences with poses: folders, synth:PRESET, ...")
    ],
    detector: Annotated[
        list[str],
        typer.Option(metavar="SPEC", help="simulated, recorded:FILE, onnx:MODEL, ...; one, or one for each sequence."),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="appearance.json to write.")],
    truth: Annotated[
        list[str] | None,
        typer.Option(metavar="TRUTH", help="Truth of the objects, for each sequence in order, where it has none."),
    ] = None,
    dataset: DatasetOption = None,
    stride: StrideOption = 1,
    max_frames: MaxFramesOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE and its page.")] = False,
    scores_only: Annotated[
        bool, typer.Option("--scores-only", help="Do not map the sequences to learn how sure to be; quicker.")
    ] = False,
) -> None:
    """Learn how a detector's scores and misses depend on what is hidden, and how sure to be of what it finds.

    FILE gets the model, for `evidence: model:` of a configuration; beside it, a page with the suffix .html shows it.
    """
    from ...datasets.errors import UserError
    from ..evaluation.reporting.report import without_folders
    from ..learning.learn import collect_samples
    from ..learning.learn import learn as fit

    page = _check_output(output, overwrite)
    for name, given in (("--truth", truth or []), ("--detector", detector)):
        if len(given) not in {len(sequences), 0 if name == "--truth" else 1}:
            raise UserError(
                f"{len(sequences)} sequences but {len(given)} of {name}; give it once for each sequence, in order"
            )
    scenes = _open(sequences, truth, detector, dataset, stride, max_frames)
    with FrameProgress("comparing", sum(len(scene.sequence) for scene, _ in scenes)) as progress:
        samples = collect_samples(scenes, on_frame=lambda done: progress.show(done, f"{len(scenes)} sequences"))
    for line in (skipped_line(samples.tally.skipped), *_missing(scenes, detector)):
        if line is not None:
            typer.echo(line, err=True)
    learned = fit(samples, ", ".join(dict.fromkeys(without_folders(spec) for spec in detector)))
    existence = None if scores_only else _learn_existence(scenes, learned)
    if existence is not None:
        learned = replace(learned, model=existence.model)
    _write(learned, existence, output, page)
    _tell(learned)
    if existence is not None:
        typer.echo(existence.summary())
    typer.echo(f"the model is in {output}; open {page}")


def _learn_existence(scenes: list[tuple[KnownScene, Detector]], learned: Learned) -> LearnedExistence:
    """The second stage, which maps the sequences."""
    from ..learning.existence import ROUNDS, learn_existence

    frames = ROUNDS * sum(len(scene.sequence) for scene, _ in scenes if scene.complete)
    with FrameProgress("mapping", frames) as progress:
        mapped = f"{ROUNDS} times {len(scenes)} sequences"
        classes = learned.samples.classes
        return learn_existence(scenes, learned.model, classes, on_frame=lambda done: progress.show(done, mapped))


def _check_output(output: Path, overwrite: bool) -> Path:
    """Where the page goes; raises `UserError` where one of the two must not, or cannot, be written.

    Learning takes minutes: that its place cannot be written to shows before.
    """
    from ...datasets.errors import InputError
    from ..map.atomic import make_folder

    if output.suffix == ".html":
        raise InputError(output, "the name of a JSON file", "the name of its page", "end it in .json")
    page = output.with_suffix(".html")
    for path in (output, page):
        if path.is_dir():
            raise InputError(path, "a file to write", "a folder", "choose another name")
        if path.exists() and not overwrite:
            raise InputError(path, "a new file", "an existing one", "choose another name or add --overwrite")
    make_folder(output.parent)
    return page


def _open(
    sequences: list[str],
    truth: list[str] | None,
    detector: list[str],
    dataset: str | None,
    stride: int,
    max_frames: int | None,
) -> list[tuple[KnownScene, Detector]]:
    """Everything is opened before the first frame is looked at: a mistake in the last one shows at once."""
    from ...detectors.spec import make_detector
    from ..learning.known_scene import open_known_scene

    specs = detector if len(detector) == len(sequences) else detector * len(sequences)
    scenes = []
    for sequence, known, spec in zip(sequences, truth or [None] * len(sequences), specs, strict=True):
        scene = open_known_scene(sequence, known, dataset, stride, max_frames)
        scenes.append((scene, make_detector(spec, scene.sequence)))
    return scenes


def _missing(scenes: list[tuple[KnownScene, Detector]], specs: list[str]) -> list[str]:
    """Recordings that lack frames: those would count as frames without detections."""
    lines = []
    for scene, detector in scenes:
        if missing := getattr(detector, "missing", ()):
            lines.append(
                f"{', '.join(specs)} has nothing for {len(missing)} frames of {scene.name}, which count as empty"
            )
    return lines


def _write(learned: Learned, existence: LearnedExistence | None, output: Path, page: Path) -> None:
    from ..learning.page import render_page
    from ..map.atomic import write_atomic

    write_atomic(page, render_page(learned, existence).encode())
    learned.model.save(output)


def _tell(learned: Learned) -> None:
    """The table a class, what was left out, and whether P_D holds elsewhere."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from ...datasets.truth import PARTS
    from ..evaluation.reporting.terminal import terminal
    from ..evaluation.reporting.text import cell_text
    from ..learning.summary import class_table, notes, templates

    console = terminal()
    for part in templates(learned.samples):
        content = class_table(learned, part)
        table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), show_edge=False)
        for number, name in enumerate((content.title, *content.columns[1:])):
            table.add_column(Text(name), justify="right" if number else "left")
        for row in content.rows:
            table.add_row(*(Text(cell_text(cell)) for cell in row))  # Text: a name may hold what rich takes for markup
        console.print(table)
    for note in notes(learned.samples.tally):
        typer.echo(note)
    for part, result in learned.calibration.items():
        typer.echo(f"P_D of {PARTS[part]} on sequences left out: calibration error {result.ece:.3f}")

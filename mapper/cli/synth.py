"""`thingmap synth`: a rendered sequence with its exact truth, as files."""

from __future__ import annotations

import shlex
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .interrupt import stop_on_interrupt
from .progress import FrameProgress

if TYPE_CHECKING:
    from ...datasets.synthetic.config import SyntheticConfig
    from ...datasets.synthetic.files.writing import Written
    from ...datasets.synthetic.sequence import SyntheticSequence
    from ...datasets.truth import TrueObject


class PresetName(StrEnum):
    """What to render; the values are `synthetic.config.Preset`'s, which takes longer to import."""

    TABLETOP = "tabletop"
    SURVEY = "survey"
    KITCHEN = "kitchen"
    LAPS = "laps"
    WALL = "wall"


class Clutter(StrEnum):
    """How much stands around; the values are `synthetic.config.ClutterLevel`'s."""

    LOW = "low"
    MEDIUM = "medium"
    HIGH = "high"


def synth(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the sequence.")],
    preset: Annotated[PresetName, typer.Option(help="Scene and camera path.")] = PresetName.TABLETOP,
    objects: Annotated[int | None, typer.Option(metavar="N", help="Things of the known classes.")] = None,
    clutter: Annotated[Clutter, typer.Option(help="How much else stands around.")] = Clutter.MEDIUM,
    seed: Annotated[int, typer.Option(metavar="S", help="Of the scene, the path and the noise.")] = 0,
    frames: Annotated[int | None, typer.Option(metavar="N", help="Length; the preset's by default.")] = None,
    width: Annotated[int, typer.Option(metavar="N", help="Pixels; images are 4:3.")] = 640,
    meshes: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of textured OBJ or GLB scans to take as objects.")
    ] = None,
    blur: Annotated[int, typer.Option(metavar="N", help="Renderings averaged for motion blur; 0 for none.")] = 0,
    pace: Annotated[float, typer.Option(metavar="X", help="How many times as fast the camera goes.")] = 1.0,
    without: Annotated[
        str | None,
        typer.Option(metavar="EFFECTS", help="Effects of the depth sensor to leave out: axial,shadow or all."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a sequence written before.")] = False,
) -> None:
    """Render a sequence with its truth.

    DIR gets color/, depth/, intrinsics.json and poses.txt, to map like any recording, and truth/ to judge maps by.
    The same options give the same files.

    Ctrl-C ends after the frame at hand and leaves a shorter sequence.
    """
    from ...datasets.synthetic.files.written_folder import check_target

    check_target(output, overwrite)
    config = _config(preset, without, objects, clutter, seed, frames, width, meshes, blur, pace)
    from ...datasets.synthetic.files.writing import write_sequence
    from ...datasets.synthetic.sequence import SyntheticSequence

    sequence = SyntheticSequence(config)
    note = f"{len(sequence.objects)} objects, {len(sequence.clutter)} of clutter"
    with stop_on_interrupt() as should_stop, FrameProgress("rendering", len(sequence)) as progress:
        written = write_sequence(
            sequence, output, lambda done: progress.show(done, note), should_stop, overwrite=overwrite
        )
    _tell(sequence, written)


def _config(
    preset: str,
    without: str | None,
    objects: int | None,
    clutter: str,
    seed: int,
    frames: int | None,
    width: int,
    meshes: Path | None,
    blur: int,
    pace: float,
) -> SyntheticConfig:
    """The options as a configuration; raises `UserError` where one is outside its limits."""
    from dataclasses import replace

    from ...datasets.synthetic.config import ClutterLevel
    from ...datasets.synthetic.synth import parse_synth

    start = parse_synth(preset if without is None else f"{preset}?without={without}")
    numbers = {"objects": objects, "seed": seed, "frames": frames, "width": width, "blur": blur, "pace": pace}
    return replace(start, clutter=ClutterLevel(clutter), meshes=meshes, **numbers)


def _tell(sequence: SyntheticSequence, written: Written) -> None:
    """What is in the folder, and what to do with it."""
    typer.echo(
        f"{written.frames} frames of {sequence.name}: {len(sequence.objects)} objects{_counts(sequence.objects)} among "
        f"{len(sequence.clutter)} things of clutter; {written.megabytes:.0f} MB in {written.folder}"
    )
    folder = shlex.quote(str(written.folder))
    typer.echo(f"to see what it holds:  thingmap info {folder}")
    typer.echo(f"to map it:             thingmap run {folder} -o OUT")
    typer.echo(f"to judge the map:      thingmap evaluate OUT --truth {folder} -o REPORT")
    if not written.complete:
        typer.echo(f"interrupted; the first {written.frames} frames are a sequence with its truth", err=True)
        raise typer.Exit(130)


def _counts(objects: tuple[TrueObject, ...]) -> str:
    from collections import Counter

    common = Counter(sorted(thing.label for thing in objects)).most_common()
    return " (" + ", ".join(f"{count} {label}" for label, count in common) + ")"

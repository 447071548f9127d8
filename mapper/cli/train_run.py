"""What every training command has: options, a checkpoint from which it goes on after Ctrl-C, a model to write."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .sources import skipped_line
from .stages import StageProgress

if TYPE_CHECKING:
    from ...detectors.hog.model import HogModel
    from ...detectors.shape_context.model import ShapeContextModel

OutputOption = Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="model.npz to write.")]
SeedOption = Annotated[int, typer.Option(min=0, metavar="S", help="Of everything that is drawn.")]
FrameStrideOption = Annotated[int, typer.Option(min=1, metavar="N", help="Take every Nth frame of the backgrounds.")]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace FILE.")]


def check_output(output: Path, overwrite: bool) -> Path:
    """The checkpoint's path; raises `UserError` where the model must not, or cannot, be written."""
    from ...datasets.errors import InputError
    from ..map.atomic import make_folder

    if output.suffix != ".npz":
        raise InputError(output, "a name that ends in .npz", f"{output.suffix or 'no suffix'}", "add .npz")
    if output.is_dir():
        raise InputError(output, "a file to write", "a folder", "choose another name")
    if output.exists() and not overwrite:
        raise InputError(output, "a new file", "an existing one", "choose another name or add --overwrite")
    make_folder(output.parent)
    return output.with_name(output.name + ".part")


def plain_name(spec: str) -> str:
    """A source without the folders that it lies in: models are given to others."""
    from ..evaluation.reporting.report import without_folders

    return without_folders(spec) if spec.startswith(("synth:", "sample:")) else Path(spec).expanduser().resolve().name


@contextmanager
def going_on(checkpoint: Path, step: str) -> Iterator[StageProgress]:
    """Progress of a training that keeps its state after every `step`; Ctrl-C ends the command and says what is kept."""
    try:
        with StageProgress() as stages:
            yield stages
    except KeyboardInterrupt:
        kept = f"the same command goes on from the last {step}, which is in {checkpoint}"
        nothing = f"before the first {step} was done; nothing is kept"
        typer.echo(f"interrupted; {kept}" if checkpoint.exists() else f"interrupted {nothing}", err=True)
        raise typer.Exit(130) from None


def keep(
    model: HogModel | ShapeContextModel, output: Path, checkpoint: Path, skipped: tuple[dict[str, str], ...]
) -> None:
    """Writes the model, and says which views and frames were not used."""
    for one in skipped:
        if line := skipped_line(_by_reason(one)):
            typer.echo(line, err=True)
    model.save(output)
    checkpoint.unlink(missing_ok=True)


def _by_reason(skipped: dict[str, str]) -> dict[str, list[str]]:
    reasons: dict[str, list[str]] = {}
    for name, reason in skipped.items():
        reasons.setdefault(reason, []).append(name)
    return reasons


def tell_use(scheme: str, output: Path) -> None:
    """The command that a model is for."""
    typer.echo(f"to use it:  thingmap run SEQUENCE --detector {shlex.quote(f'{scheme}:{output}')} -o OUT")

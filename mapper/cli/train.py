"""`thingmap train`: detectors of one's own objects."""

from __future__ import annotations

import shlex
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .sources import MaxFramesOption, skipped_line
from .stages import StageProgress

if TYPE_CHECKING:
    from ...detectors.hog.model import HogModel

train = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Train detectors of your own objects.")


class ChannelsName(StrEnum):
    """What a template looks at; the values are `detectors.hog.channels.Channels`', which takes longer to import."""

    RGB = "rgb"
    DEPTH = "depth"
    RGBD = "rgbd"


@train.command()
def hog(
    objects: Annotated[
        list[str],
        typer.Option(
            metavar="DIR",
            help="Views of objects: meshes, PCDs, Washington crops, a COCO folder, a sequence with truth.",
        ),
    ],
    background: Annotated[
        list[str], typer.Option(metavar="SEQUENCE", help="Frames without the objects, or with known ones.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="model.npz to write.")],
    channels: Annotated[ChannelsName, typer.Option(help="What templates look at.")] = ChannelsName.RGBD,
    rounds: Annotated[int, typer.Option(min=0, metavar="N", help="Rounds of hard-negative mining, at most.")] = 10,
    seed: Annotated[int, typer.Option(min=0, metavar="S", help="Of everything that is drawn.")] = 0,
    stride: Annotated[int, typer.Option(min=1, metavar="N", help="Take every Nth frame of the backgrounds.")] = 10,
    max_frames: MaxFramesOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE.")] = False,
) -> None:
    """Train sliding-window templates on colour and depth, for whole objects and their halves.

    --objects and --background may be given several times. FILE is for --detector hog:FILE.

    After every round the state is kept in FILE.part: after Ctrl-C the same command goes on from there, and gives the
    model that it would have given.
    """
    from ...datasets.object_views.backgrounds import open_backgrounds
    from ...datasets.object_views.object_view import ObjectViews
    from ...datasets.object_views.open import open_object_views
    from ...detectors.hog.channels import Channels
    from ...detectors.hog.training.config import TrainConfig
    from ...detectors.hog.training.svm import check_installed
    from ...detectors.hog.training.train import train as learn

    check_installed()
    checkpoint = _check_output(output, overwrite)
    views = ObjectViews.joined(open_object_views(spec) for spec in objects)
    backgrounds = open_backgrounds(background, stride, max_frames)
    config = TrainConfig(channels=Channels(channels.value), rounds=rounds, seed=seed)
    sources = tuple(_plain_name(spec) for spec in (*objects, *background))
    try:
        with StageProgress() as stages:
            model = learn(views, backgrounds, config, stages.show, checkpoint, sources)
    except KeyboardInterrupt:
        typer.echo(_interrupted(checkpoint), err=True)
        raise typer.Exit(130) from None
    for skipped in (views.skipped, backgrounds.skipped):
        if line := skipped_line(_by_reason(skipped)):
            typer.echo(line, err=True)
    model.save(output)
    checkpoint.unlink(missing_ok=True)
    _tell(model, output)


def _check_output(output: Path, overwrite: bool) -> Path:
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


def _plain_name(spec: str) -> str:
    """A source without the folders that it lies in: models are given to others."""
    from ..evaluation.reporting.report import without_folders

    return without_folders(spec) if spec.startswith(("synth:", "sample:")) else Path(spec).expanduser().resolve().name


def _by_reason(skipped: dict[str, str]) -> dict[str, list[str]]:
    reasons: dict[str, list[str]] = {}
    for name, reason in skipped.items():
        reasons.setdefault(reason, []).append(name)
    return reasons


def _interrupted(checkpoint: Path) -> str:
    if checkpoint.exists():
        return f"interrupted; the same command goes on from the last round, which is in {checkpoint}"
    return "interrupted before the first round was done; nothing is kept"


def _tell(model: HogModel, output: Path) -> None:
    """What was learned, and how to use it."""
    counts = model.about["settings"]["counts"]
    for label, row in counts["classes"].items():
        windows = ", ".join(f"{columns} x {rows}" for rows, columns in row["windows"])
        typer.echo(f"{label}: {row['positives']} positives of {row['views']} views; window of {windows} cells")
    size = output.stat().st_size / 1e6
    typer.echo(f"{len(model.templates)} templates after {model.about['rounds_done']} rounds; {size:.1f} MB in {output}")
    typer.echo(f"to use it:  thingmap run SEQUENCE --detector {shlex.quote(f'hog:{output}')} -o OUT")

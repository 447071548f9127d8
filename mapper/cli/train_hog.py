"""`thingmap train hog`: sliding-window templates."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .sources import MaxFramesOption
from .train_run import (
    FrameStrideOption,
    OutputOption,
    OverwriteOption,
    SeedOption,
    check_output,
    going_on,
    keep,
    plain_name,
    tell_use,
)

if TYPE_CHECKING:
    from ...detectors.hog.model import HogModel


class ChannelsName(StrEnum):
    """What a template looks at; the values are `detectors.hog.channels.Channels`', which takes longer to import."""

    RGB = "rgb"
    DEPTH = "depth"
    RGBD = "rgbd"


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
    output: OutputOption,
    channels: Annotated[ChannelsName, typer.Option(help="What templates look at.")] = ChannelsName.RGBD,
    rounds: Annotated[int, typer.Option(min=0, metavar="N", help="Rounds of hard-negative mining, at most.")] = 10,
    seed: SeedOption = 0,
    stride: FrameStrideOption = 10,
    max_frames: MaxFramesOption = None,
    overwrite: OverwriteOption = False,
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
    checkpoint = check_output(output, overwrite)
    views = ObjectViews.joined(open_object_views(spec) for spec in objects)
    backgrounds = open_backgrounds(background, stride, max_frames)
    config = TrainConfig(channels=Channels(channels.value), rounds=rounds, seed=seed)
    sources = tuple(plain_name(spec) for spec in (*objects, *background))
    with going_on(checkpoint, "round") as stages:
        model = learn(views, backgrounds, config, stages.show, checkpoint, sources)
    keep(model, output, checkpoint, (views.skipped, backgrounds.skipped))
    _tell(model, output)


def _tell(model: HogModel, output: Path) -> None:
    """What was learned, and how to use it."""
    counts = model.about["settings"]["counts"]
    for label, row in counts["classes"].items():
        windows = ", ".join(f"{columns} x {rows}" for rows, columns in row["windows"])
        typer.echo(f"{label}: {row['positives']} positives of {row['views']} views; window of {windows} cells")
    size = output.stat().st_size / 1e6
    typer.echo(f"{len(model.templates)} templates after {model.about['rounds_done']} rounds; {size:.1f} MB in {output}")
    tell_use("hog", output)

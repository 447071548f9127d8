"""`thingmap train shape-context`: codebooks of contours that vote."""

from __future__ import annotations

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
    from ...detectors.shape_context.model import ShapeContextModel


def shape_context(
    objects: Annotated[
        list[str],
        typer.Option(metavar="DIR", help="Views of objects with depth and mask: meshes, PCDs, Washington crops."),
    ],
    output: OutputOption,
    background: Annotated[
        list[str] | None,
        typer.Option(metavar="SEQUENCE", help="Frames without the objects, or with known ones: what is no object."),
    ] = None,
    seed: SeedOption = 0,
    stride: FrameStrideOption = 10,
    max_frames: MaxFramesOption = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Train codebooks of contours for things without texture, which vote for the middle of an object.

    --objects and --background may be given several times; views without depth or mask are skipped. FILE is for
    --detector shape-context:FILE.

    After every class the state is kept in FILE.part: after Ctrl-C the same command goes on from there, and gives the
    model that it would have given.
    """
    from ...datasets.object_views.backgrounds import open_backgrounds
    from ...datasets.object_views.object_view import ObjectViews
    from ...datasets.object_views.open import open_object_views
    from ...detectors.shape_context.training.config import TrainConfig
    from ...detectors.shape_context.training.train import train as learn

    checkpoint = check_output(output, overwrite)
    views = ObjectViews.joined(open_object_views(spec) for spec in objects)
    backgrounds = open_backgrounds(background or (), stride, max_frames)
    sources = tuple(plain_name(spec) for spec in (*objects, *(background or ())))
    with going_on(checkpoint, "class") as stages:
        model = learn(views, backgrounds, TrainConfig(seed=seed), stages.show, checkpoint, sources)
    keep(model, output, checkpoint, (views.skipped, backgrounds.skipped))
    _tell(model, output)


def _tell(model: ShapeContextModel, output: Path) -> None:
    """What was learned, and how to use it."""
    for label, row in model.about["classes"].items():
        area = row["separation"][f"{model.about['radius']:g}"]
        typer.echo(
            f"{label}: {row['entries']} descriptors of {row['views']} views, by which {100 * area:.1f} % of pairs with "
            "other things are in the right order"
        )
    typer.echo(f"radius of descriptors: {100 * model.about['radius']:g} cm")
    samples = model.about["calibration"]
    typer.echo(f"calibrated with {samples['background']} {samples['background_is']} for background", nl=False)
    typer.echo("" if samples["background_is"] == "proposals of frames" else "; --background gives truer probabilities")
    typer.echo(f"{output.stat().st_size / 1e6:.1f} MB in {output}")
    tell_use("shape-context", output)

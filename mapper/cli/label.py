"""`thingmap label`: what each point of a map is."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .interrupt import stop_on_interrupt
from .sources import DatasetOption, choose_detector, skipped_line
from .stages import StageProgress

if TYPE_CHECKING:
    from ..labelling.instances import Instances, ThingPoints
    from ..labelling.label_run import LabelReport
    from ..labelling.labelling_config import LabellingConfig
    from ..labelling.mrf_config import Smoothness
    from ..map.store import OutputFolder

NAMED = 5  # things and segments named on the screen
BOUND_SWEEPS = 20  # of the lower bound, with --bound


def label(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote.")],
    smoothness: Annotated[
        str | None,
        typer.Option(
            metavar="TERM",
            help="What it costs that neighbours differ: normals (little where surfaces meet inwards), colour, potts "
            "(always the same) or none; normals by default.",
        ),
    ] = None,
    fast: Annotated[bool, typer.Option("--fast", help="Mean field in place of graph cuts.")] = False,
    stride: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Look at every Nth mapped frame; 10 by default.")
    ] = None,
    sequence: Annotated[
        str | None, typer.Option(metavar="SEQUENCE", help="What was mapped, where it is elsewhere now.")
    ] = None,
    dataset: DatasetOption = None,
    detector: Annotated[
        str | None, typer.Option(metavar="SPEC", help="simulated, hog, onnx:MODEL, ...; the run's own by default.")
    ] = None,
    volumes: Annotated[
        bool, typer.Option("--volumes/--no-volumes", help="Whether the boxes of the map's things are evidence too.")
    ] = True,
    bound: Annotated[bool, typer.Option("--bound", help="Say how far the labels are from the best at most.")] = False,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="YAML over the defaults.")] = None,
    again: Annotated[bool, typer.Option("--again", help="Look at all frames again.")] = False,
) -> None:
    """Label every point of a map.

    OUT gets labels.ply, a point for each voxel with its class and its thing, and counts of points in map.json. What was
    gathered stays in voxels.npz: the next time only frames that are new are looked at, and with other options for the
    labels none.

    Ctrl-C ends after the frame at hand; the next time goes on from there.
    """
    from ...detectors.spec import make_detector
    from ..labelling.label_run import LabelJob
    from ..map.store import OutputFolder
    from ..mapped_sequence import mapped_command, open_mapped_sequence

    source = OutputFolder.open(folder)
    settings = _settings(config, smoothness, fast, stride, volumes, bound)
    asked = mapped_command(source)
    frames = open_mapped_sequence(source, sequence, dataset)
    spec = choose_detector(detector or asked.get("detector"), str(sequence or asked.get("sequence")), frames)
    job = LabelJob(source, frames, make_detector(spec, frames), f"{frames.name}, {spec}", settings, again)
    with stop_on_interrupt() as should_stop, StageProgress() as progress:
        report = job.execute(lambda done, total: progress.show("looking at frames", done, total), should_stop)
    _tell(source, report)
    if report.stopped:
        raise typer.Exit(130)


def _settings(
    config: Path | None, smoothness: str | None, fast: bool, stride: int | None, volumes: bool, bound: bool
) -> LabellingConfig:
    """The configuration file over the defaults, with the command line over it."""
    from ..config_file import load_config
    from ..labelling.labelling_config import LabellingConfig

    settings = load_config(config, LabellingConfig)
    mrf = replace(settings.mrf, fast=fast or settings.mrf.fast)
    if smoothness is not None:
        mrf = replace(mrf, smoothness=_term(smoothness))
    if bound:
        mrf = replace(mrf, bound_sweeps=max(BOUND_SWEEPS, mrf.bound_sweeps))
    sources = settings.sources if volumes else replace(settings.sources, volumes=0.0)
    return replace(settings, mrf=mrf, sources=sources, stride=stride or settings.stride)


def _term(name: str) -> Smoothness:
    from ...datasets.errors import UserError
    from ..labelling.mrf_config import Smoothness

    try:
        return Smoothness(name)
    except ValueError:
        raise UserError(f"--smoothness {name}: there are {', '.join(Smoothness)}; choose one of them") from None


def _tell(folder: OutputFolder, report: LabelReport) -> None:
    """What was done, in a few lines."""
    skipped = skipped_line(report.skipped)
    if skipped:
        typer.echo(skipped, err=True)
    if report.anew:
        typer.echo("voxels that were there did not fit (other frames, poses or numbers): all frames looked at again")
    if report.labels is None or report.points is None:
        typer.echo(f"interrupted; {report.frames} frames are in {folder.voxels_file}, the next time goes on", err=True)
        return
    known = report.frames - report.added
    typer.echo(f"{report.added} frames looked at" + (f", {known} known from before" if known else ""))
    typer.echo(", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in report.seconds.items()))
    labels = report.labels
    gap = "" if labels.gap is None else f", at most {100.0 * labels.gap:.2g} % above the least there can be"
    stopped = "" if labels.settled else ", not settled"
    typer.echo(f"energy {labels.energy:.6g} over {report.voxels} voxels and {labels.pairs} pairs{gap}{stopped}")
    counts = ", ".join(f"{name} {count}" for name, count in report.points.items())
    typer.echo(f"points: {counts}; they are in {folder.labels_file}")
    if report.instances is not None:
        _tell_instances(report.instances)


def _tell_instances(instances: Instances) -> None:
    """Where the map's things and the points do not fit."""
    things = instances.things
    bare = [thing.id for thing in things if not thing.points]
    typer.echo(
        f"{len(things) - len(bare)} of {len(things)} things have points" + (f"; none: {_some(bare)}" if bare else "")
    )
    told = [_sizes(thing) for thing in things if thing.size is not None and thing.size.estimate is not None]
    if told:
        typer.echo(f"{len(told)} have their place and size from their points: {_some(told)}")
    if instances.loose:
        loose = [f"{segment.label} of {segment.points}" for segment in instances.loose]
        typer.echo(f"{len(loose)} segments of points are no thing of the map's: {_some(loose)}")


def _sizes(thing: ThingPoints) -> str:
    assert thing.size is not None
    box, points = (" x ".join(f"{100.0 * x:.0f}" for x in size) for size in (thing.size.volume, thing.size.extent))
    turned = "" if thing.box is None else f", turned by {math.degrees(thing.box.yaw):.0f} degrees"
    return f"{thing.id} ({box} cm, points {points} cm{turned})"


def _some(names: list[str]) -> str:
    return ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")

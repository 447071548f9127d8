"""`thingmap run`: a sequence becomes a map."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .sources import DatasetOption, MaxFramesOption, SequenceArgument, StrideOption, choose_detector

if TYPE_CHECKING:
    from ..config import MapperConfig


class Odometry(StrEnum):
    """Where camera motion comes from; the values are `OdometrySource`'s, which takes longer to import."""

    KISS_ICP = "kiss-icp"
    POSES = "poses"


def run(
    sequence: SequenceArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="Folder for the map.")],
    detector: Annotated[
        str | None,
        typer.Option(metavar="SPEC", help="simulated, recorded:FILE, onnx:MODEL, ...; the sequence's own by default."),
    ] = None,
    odometry: Annotated[Odometry | None, typer.Option(help="Camera motion from depth, or the given poses.")] = None,
    dataset: DatasetOption = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="YAML over the defaults.")] = None,
    stride: StrideOption = 1,
    max_frames: MaxFramesOption = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Of everything random.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the files of an earlier run.")] = False,
    include_doubtful: Annotated[bool, typer.Option("--all", help="Write things that probably are not there.")] = False,
    snapshots: Annotated[
        str | None, typer.Option(metavar="N,N,...", help="Write the map after so many frames too, for `evaluate`.")
    ] = None,
) -> None:
    """Map a sequence.

    OUT gets map.json, trajectory.txt, keyframes.npz, cloud.ply, config.yaml, report.json and ledger.npz.

    Ctrl-C ends the run after the frame at hand and writes what is mapped so far.
    """
    from ...datasets.errors import UserError
    from ...datasets.open import open_sequence
    from ...detectors.spec import make_detector
    from ..config_file import dump_config
    from ..map.store import OutputFolder
    from ..mapper import SemanticMapper
    from ..snapshots import parse_snapshot_frames
    from .job import MappingJob

    OutputFolder.check(output, overwrite)
    settings = _settings(config, seed, odometry)
    frames = open_sequence(sequence, dataset=dataset, stride=stride, max_frames=max_frames)
    if settings.odometry.source.value == Odometry.POSES and frames.poses is None:
        raise UserError(f"{sequence}: the sequence has no poses; use --odometry {Odometry.KISS_ICP}")
    spec = choose_detector(detector, sequence, frames)
    detect = make_detector(spec, frames)
    MappingJob(
        sequence=frames,
        mapper=SemanticMapper(detect, settings, source=frames.name, gravity=frames.gravity),
        detector=detect,
        spec=spec,
        folder=OutputFolder.create(output, overwrite),
        config=dump_config(settings),
        command={
            "sequence": sequence,
            "dataset": dataset,
            "detector": spec,
            "stride": stride,
            "max_frames": max_frames,
        },
        include_doubtful=include_doubtful,
        snapshots=parse_snapshot_frames(snapshots) if snapshots is not None else (),
    ).execute()


def _settings(config: Path | None, seed: int | None, odometry: Odometry | None) -> MapperConfig:
    """The configuration file with the command line over it."""
    from ..config import MapperConfig, OdometrySource
    from ..config_file import load_config

    settings = load_config(config, MapperConfig)
    if seed is not None:
        settings = replace(settings, seed=seed)
    if odometry is not None:
        settings = replace(settings, odometry=replace(settings.odometry, source=OdometrySource(odometry.value)))
    return settings

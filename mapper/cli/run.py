"""`thingmap run`: a sequence becomes a map."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .sources import DatasetOption, MaxFramesOption, SequenceArgument, StrideOption, choose_detector

if TYPE_CHECKING:
    from ...datasets.sequence import Sequence
    from ...detectors.detector import Detector
    from ..config import MapperConfig, OdometryConfig
    from ..mapper import SemanticMapper
    from ..multiview.track_judge import TrackJudge


class Inference(StrEnum):
    """How things are found."""

    INCREMENTAL = "incremental"
    BATCH = "batch"
    TRACKS = "tracks"


SHIPPED = "shipped"  # name of the judge that comes with thingmap
DEFAULT_VIEWS = 12  # of batch inference; the most in Meger et al., Clutter, figure 8


def run(
    sequence: SequenceArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="Folder for the map.")],
    detector: Annotated[
        str | None,
        typer.Option(metavar="SPEC", help="simulated, recorded:FILE, onnx:MODEL, ...; the sequence's own by default."),
    ] = None,
    odometry: Annotated[
        str | None,
        typer.Option(
            metavar="SOURCE",
            help="Camera motion: kiss-icp or small-gicp from depth, the sequence's own poses, or a file "
            "of another system with rows stamp tx ty tz qx qy qz qw; kiss-icp by default.",
        ),
    ] = None,
    dataset: DatasetOption = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="YAML over the defaults.")] = None,
    inference: Annotated[
        Inference,
        typer.Option(
            help="One graph, frame by frame; batch: over a fixed set of views at the end; tracks: no objects in the "
            "graph, but detections linked by their places in space and Bayes' rule over views (best with masks)."
        ),
    ] = Inference.INCREMENTAL,
    views: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help=f"Views of batch inference, evenly spread; {DEFAULT_VIEWS} by default."),
    ] = None,
    judge: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help=f"Of tracks: what was learned of them decides, not Bayes' rule; {SHIPPED}: that for shape-context.",
        ),
    ] = None,
    stride: StrideOption = 1,
    max_frames: MaxFramesOption = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Of everything random.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the files of an earlier run.")] = False,
    include_doubtful: Annotated[bool, typer.Option("--all", help="Write things that probably are not there.")] = False,
    snapshots: Annotated[
        str | None, typer.Option(metavar="N,N,...", help="Write the map after so many frames too, for `evaluate`.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Watch it in a window; needs the extra `view`.")] = False,
    serve: Annotated[
        int | None,
        typer.Option(min=1024, max=65534, metavar="PORT", help="Watch it in a browser, on this machine's PORT."),
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Record the live view, to be opened with `rerun FILE.rrd`.")
    ] = None,
) -> None:
    """Map a sequence.

    OUT gets map.json, evidence.npz, trajectory.txt, keyframes.npz, cloud.ply, config.yaml, report.json and ledger.npz;
    with --inference tracks and a detector that has masks also labels.ply, the cloud with a class for every point.

    Ctrl-C ends the run after the frame at hand and writes what is mapped so far.
    """
    from ...datasets.errors import UserError
    from ...datasets.open import open_sequence
    from ...detectors.spec import make_detector
    from ..config_file import dump_config
    from ..evidence_choice import with_evidence_of
    from ..lidar_config import default_config
    from ..map.store import OutputFolder
    from ..snapshots import parse_snapshot_frames
    from .job import MappingJob
    from .live import live_targets, watching

    if views is not None and inference is not Inference.BATCH:
        raise UserError(
            f"--views {views}: only of use with --inference {Inference.BATCH}; add it, or leave out --views"
        )
    if judge is not None and inference is not Inference.TRACKS:
        raise UserError(
            f"--judge {judge}: only of use with --inference {Inference.TRACKS}; add it, or leave out --judge"
        )
    OutputFolder.check(output, overwrite)
    live = live_targets(view, serve, save, overwrite)
    frames = open_sequence(sequence, dataset=dataset, stride=stride, max_frames=max_frames)
    settings = _settings(config, seed, odometry, default_config(frames))
    _check_odometry(settings.odometry, frames, sequence)
    spec = choose_detector(detector, sequence, frames)
    detect = make_detector(spec, frames)
    settings = with_evidence_of(detect, settings)
    mapper = _make_mapper(frames, detect, settings, inference, views, judge)
    MappingJob(
        sequence=frames,
        mapper=mapper,
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
            **_inference_options(inference, views, judge),
        },
        include_doubtful=include_doubtful,
        snapshots=parse_snapshot_frames(snapshots) if snapshots is not None else (),
        live=watching(live, mapper, settings.cloud, frames.name) if live is not None else nullcontext(),
    ).execute()


def _inference_options(inference: Inference, views: int | None, judge: str | None) -> dict[str, str | int]:
    """What the report says of how things were found, unless it is the usual way."""
    match inference:
        case Inference.BATCH:
            return {"inference": inference.value, "views": views or DEFAULT_VIEWS}
        case Inference.TRACKS:
            return {"inference": inference.value, **({"judge": judge} if judge else {})}
    return {}


def _make_mapper(
    frames: Sequence,
    detect: Detector,
    settings: MapperConfig,
    inference: Inference,
    views: int | None,
    judge: str | None,
) -> SemanticMapper:
    about = {"source": frames.name, "gravity": frames.gravity}
    if inference is Inference.BATCH:
        from ..batch.batch_mapper import BatchMapper
        from ..proposals.views import spread_views

        return BatchMapper(detect, settings, views=spread_views(views or DEFAULT_VIEWS, len(frames)), **about)
    if inference is Inference.TRACKS:
        from ..multiview.track_mapper import TrackMapper

        return TrackMapper(detect, settings, judge=_judge(judge), **about)
    from ..mapper import SemanticMapper

    return SemanticMapper(detect, settings, **about)


def _judge(name: str | None) -> TrackJudge | None:
    """What decides about tracks, if not Bayes' rule."""
    from ..multiview.track_judge import load_judge, shipped_judge

    if name is None:
        return None
    return load_judge(shipped_judge() if name == SHIPPED else Path(name))


def _check_odometry(odometry: OdometryConfig, frames: Sequence, sequence: str) -> None:
    """That the poses it takes from elsewhere are there, before a folder is made."""
    from ...datasets.errors import UserError
    from ..config import OdometrySource
    from ..trajectory.odometry.given_odometry import check_trajectory

    if odometry.source is OdometrySource.POSES and frames.poses is None:
        raise UserError(f"{sequence}: the sequence has no poses; use --odometry {OdometrySource.KISS_ICP.value}")
    if odometry.source is OdometrySource.FILE:
        check_trajectory(Path(odometry.path), frames.stamps)


def _settings(config: Path | None, seed: int | None, odometry: str | None, base: MapperConfig) -> MapperConfig:
    """The configuration file over the defaults of this kind of sequence, with the command line over it."""
    from ..config import MapperConfig
    from ..config_file import load_config
    from ..trajectory.odometry.sources import with_source

    settings = load_config(config, MapperConfig, base)
    if seed is not None:
        settings = replace(settings, seed=seed)
    if odometry is not None:
        settings = replace(settings, odometry=with_source(settings.odometry, odometry))
    return settings

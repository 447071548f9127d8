"""`thingmap info`: what a sequence, a map or a file of detections holds."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .sources import DatasetOption, MaxFramesOption, StrideOption

if TYPE_CHECKING:
    import numpy as np

    from ...datasets.lidar import LidarScan
    from ...datasets.sequence import Sequence
    from ..map.object_map import ObjectMap
    from ..map.thing import Thing

Line = tuple[str, str]  # what, and its value
TRIED = 50  # frames, in search of the first that can be used


def info(
    path: Annotated[
        str, typer.Argument(metavar="PATH", help="A sequence, a bag of ROS, the OUT of a run, or a detections.json.")
    ],
    dataset: DatasetOption = None,
    stride: StrideOption = 1,
    max_frames: MaxFramesOption = None,
) -> None:
    """Show what a sequence, a map or a file of detections holds."""
    from ...datasets.open import open_sequence
    from ...datasets.ros.bag import SUFFIXES
    from ..map.map_file import FILE_NAME, SCHEMA
    from ..map.object_map import ObjectMap
    from .tables import print_things

    place = Path(path)
    things: tuple[Thing, ...] = ()
    if (place / FILE_NAME).is_file() or (place.is_file() and _schema(place) == SCHEMA):
        object_map = ObjectMap.load(place)
        lines, things = [*_map_lines(object_map), *_report_lines(place)], object_map.things
    elif place.is_file() and place.suffix.lower() not in SUFFIXES:
        lines = list(_detections_lines(place))
    else:
        for line in _topic_lines(path):  # first: they are wanted most where the sequence cannot be opened
            typer.echo(line)
        sequence = open_sequence(path, dataset=dataset, stride=stride, max_frames=max_frames)
        lines = [("sequence", sequence.name), ("loader", _loader(path, dataset)), *_sequence_lines(sequence)]
    width = max(len(what) for what, _ in lines)
    for what, value in lines:
        typer.echo(f"{what:<{width}}  {value}")
    if things:
        typer.echo()
        print_things(things)


def _schema(file: Path) -> object:
    if file.suffix.lower() != ".json":
        return None
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None  # the reader of detections says what is wrong with it
    return document.get("schema") if isinstance(document, dict) else None


def _topic_lines(path: str) -> Iterator[str]:
    """One line for each topic where the path is a bag."""
    from ...datasets.open import SAMPLE_PREFIX, SYNTH_PREFIX
    from ...datasets.path_options import split_options
    from ...datasets.ros.bag import Bag
    from ...datasets.ros.open import find_bags
    from ...datasets.ros.topics import image_topics

    if path.startswith((SAMPLE_PREFIX, SYNTH_PREFIX)):
        return
    place, _ = split_options(path)
    bags = find_bags(place) if place.exists() else []
    if len(bags) != 1:
        return
    bag = Bag(bags[0])
    images = {image.topic.name: image for image in image_topics(bag)}
    for name, topic in bag.topics.items():
        image = images.get(name)
        of = "" if image is None else f", {image.encoding} {image.size[0]} x {image.size[1]} in {image.frame_id}"
        yield f"topic {name}  {topic.type}, {topic.count} messages{of}"


def _sequence_lines(sequence: Sequence) -> Iterator[Line]:
    import numpy as np

    k = sequence.intrinsics
    yield "frames", str(len(sequence))
    size = f"{k.width} x {k.height}, fx {k.fx:.2f}, fy {k.fy:.2f}, cx {k.cx:.2f}, cy {k.cy:.2f}"
    yield "image", size if k.width > 0 else "none: a LiDAR without a camera"
    if len(sequence):
        seconds = float(sequence.stamps[-1] - sequence.stamps[0])
        rate = f", {(len(sequence) - 1) / seconds:.1f} frames/s" if seconds > 0.0 else ""
        yield "duration", f"{seconds:.2f} s{rate}"
    yield from _bag_lines(sequence)
    yield "poses", "none" if sequence.poses is None else _poses(np.asarray(sequence.poses))
    down = sequence.gravity
    yield "gravity", "unknown" if down is None else "down is " + ", ".join(f"{x:.3f}" for x in down)
    yield from _truth_lines(sequence)
    yield from _depth_lines(sequence)


def _bag_lines(sequence: Sequence) -> Iterator[Line]:
    """Which topics of a bag the frames come from, and what they leave over."""
    from ...datasets.ros.sequence import BagSequence
    from ...datasets.views import Subset

    whole = sequence.sequence if isinstance(sequence, Subset) else sequence
    if isinstance(whole, BagSequence):
        topics, unpaired = whole.topics, whole.unpaired
        yield "colour", f"{topics.color.topic.name}, {unpaired.color} images without depth near their stamp"
        yield "depth", f"{topics.depth.topic.name}, {unpaired.depth} images without colour near their stamp"
        yield "calibration", topics.info + (", distortion is removed" if whole.camera.maps else "")
        yield "accelerometer", "none" if whole.specific_force is None else "in camera axes"


def _truth_lines(sequence: Sequence) -> Iterator[Line]:
    """What is known exactly about the scene, where anything is."""
    from ...datasets.truth import HasClutter, HasTruth

    if isinstance(sequence, HasTruth):
        labels = [thing.label for thing in sequence.objects]
        yield "truth", f"{len(labels)} objects" + _counts(labels)
        if isinstance(sequence, HasClutter):
            yield "clutter", f"{len(sequence.clutter)} things of no class"


def _loader(path: str, dataset: str | None) -> str:
    """Name of the loader that takes this path, and the layout that it knows."""
    from ...datasets.open import LOADERS, SAMPLE_PREFIX, SYNTH_PREFIX
    from ...datasets.path_options import split_options

    if path.startswith((SAMPLE_PREFIX, SYNTH_PREFIX)):
        return "rendered when asked for"
    place, _ = split_options(path)
    able = [loader for loader in LOADERS if not place.is_file() or place.suffix.lower() in loader.suffixes]
    fitting = [loader for loader in able if dataset in (None, loader.dataset) and loader.find(place)]
    return "; ".join(f"{loader.dataset} ({loader.layout})" for loader in fitting) or str(dataset)


def _poses(poses: np.ndarray) -> str:
    import numpy as np

    known = np.isfinite(poses).all(axis=(1, 2))
    steps = np.linalg.norm(np.diff(poses[known, :3, 3], axis=0), axis=1)
    return f"{int(known.sum())} of {len(poses)} frames, path of {steps.sum():.2f} m"


def _depth_lines(sequence: Sequence) -> Iterator[Line]:
    """Of the first frame that can be used; those before it are named."""
    import numpy as np

    from ...datasets.frame import BrokenFrame

    for index in range(min(len(sequence), TRIED)):
        try:
            frame = sequence[index]
        except BrokenFrame as problem:
            yield "broken frame", str(problem)
            continue
        if frame.scan is not None:
            yield f"scan of {frame.name}", _scan(frame.scan)
        if not frame.has_image:
            return
        valid = frame.depth[frame.depth > 0.0]
        share = f"{100.0 * valid.size / frame.depth.size:.0f} % valid"
        if valid.size:
            low, middle, high = np.percentile(valid, (1.0, 50.0, 99.0))
            share += f", {low:.2f} to {high:.2f} m (1 to 99 %), median {middle:.2f} m"
        yield f"depth of {frame.name}", share
        return


def _scan(scan: LidarScan) -> str:
    import numpy as np

    low, middle, high = np.percentile(np.linalg.norm(scan.points, axis=1), (1.0, 50.0, 99.0))
    timed = "points of one moment"
    if scan.times is not None:
        timed = f"taken from {scan.times.min():+.3f} to {scan.times.max():+.3f} s after its stamp"
    return f"{len(scan.points)} points, {low:.2f} to {high:.2f} m (1 to 99 %), median {middle:.2f} m, {timed}"


def _map_lines(object_map: ObjectMap) -> Iterator[Line]:
    yield "map of", object_map.source
    yield "frame", str(object_map.frame)
    yield "up", _up(object_map)
    yield "things", f"{len(object_map)}" + _counts([thing.label for thing in object_map.things])
    yield "classes", f"{len(object_map.classes)}: " + ", ".join(object_map.classes)


def _up(object_map: ObjectMap) -> str:
    import math

    up = object_map.up
    direction = ", ".join(f"{x:.3f}" for x in up.direction)
    return f"{direction} ± {math.degrees(up.std_rad):.1f} degrees, from {up.source}"


def _report_lines(path: Path) -> Iterator[Line]:
    from ..map.store import OutputFolder

    folder = OutputFolder(path)
    if not folder.report_file.is_file():
        return
    report = folder.read_report()
    yield (
        "run",
        (
            f"{report.get('frames_used')} of {report.get('frames_total')} frames, {report.get('keyframes')} keyframes, "
            f"{report.get('seconds')} s, {report.get('frames_per_second')} frames/s"
        ),
    )
    if report.get("skipped"):
        yield "skipped", ", ".join(f"{len(names)} with {problem}" for problem, names in report["skipped"].items())
    if report.get("stopped"):
        yield "stopped", str(report["stopped"])


def _detections_lines(path: Path) -> Iterator[Line]:
    from ...detectors.recorded.formats import read_recording
    from ...detectors.recorded.recording import ReadOptions

    format_, recording = read_recording(path, None, ReadOptions())
    yield "detections", f"format {format_.value}, frames found by {recording.matched_by.value}"
    labels = [recording.classes[k] for found in recording.frames.values() for k in found.class_id]
    yield "frames", str(len(recording.frames))
    yield "boxes", f"{len(labels)}" + _counts(labels)
    yield "classes", f"{len(recording.classes)}: " + ", ".join(recording.classes)


def _counts(labels: list[str]) -> str:
    from collections import Counter

    common = Counter(sorted(labels)).most_common()
    return ": " + ", ".join(f"{count} {label}" for label, count in common) if common else ""

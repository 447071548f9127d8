"""HOG models learned from scans and single clouds, on real images: pictures to look at, hits and false alarms.

uv run python benchmarks/hog_real.py --data ../shared/data --folder DIR --pictures DIR --write

Objects: the scans of `ycb` on a virtual turntable, and the single-view clouds of `uw_objects`, put before backgrounds:
frames of `redkitchen` that show no mug, and rendered rooms whose objects are known. Looked at are every 20th frame of
`redkitchen`, of whose objects the two mugs are known by their place, and the first frames of `uw_scenes_v2`: all but
one without depth, so that only colour can be used there. What these show nobody has annotated; with `--seen FILE`
somebody's list of it, made by looking, is used, else boxes are only counted.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from hog_model import rendered
from hog_real_truth import KnownPoint, Verdict, is_in_view, judge, known_in_frame, read_seen, shows
from results import show_section, table

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.object_views.backgrounds import Backgrounds
from thingmap.datasets.object_views.object_view import ObjectViews, ViewEntry
from thingmap.datasets.object_views.open import open_object_views
from thingmap.datasets.object_views.turntable import Turntable, scan_views
from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.rgbd_scenes_v2 import CAMERA
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.views import Subset, subset, usable_frames
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.model import HogModel, load_model
from thingmap.detectors.hog.training.config import TrainConfig
from thingmap.detectors.hog.training.train import train

CLASSES = ("bowl", "cap", "cereal box", "coffee mug", "soda can")  # in the images, and in the objects
SAME = {"cracker box": "cereal box", "sugar box": "cereal box"}  # a scan's class -> what it looks like
TURNTABLE = Turntable(elevations=(15.0, 30.0, 45.0), distances=(0.8, 1.2, 1.8), azimuths=10)
REPEATS = 10  # times a cloud's view is put before a background, each time at another place
ROOMS = tuple(SyntheticConfig(Preset.TABLETOP, clutter=level, seed=1, frames=150) for level in ClutterLevel)
ROOM_STRIDE, KITCHEN_STRIDE = 15, 4  # frames from one background to the next
CONFIG = TrainConfig(views=200, rounds=5, objects_per_frame=0.2)
STEP = 20  # frames of redkitchen from one that is looked at to the next; backgrounds lie between them
LEAST = (0.1, 0.3, 0.5, 0.7)  # probabilities from which boxes count
COLORS = ((0, 200, 255), (255, 120, 0), (80, 220, 80), (60, 60, 255), (230, 80, 230))  # BGR, by class

Models = Mapping[Channels, HogModel]


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, detect, draw, count; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        models = {channels: _model(options, channels) for channels in (Channels.RGB, Channels.RGBD)}
        kitchen = describe_kitchen(models, options.data / "redkitchen", options.pictures)
        scenes = describe_scenes(models, options.data / "uw_scenes_v2", options.seen, options.pictures)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    show_section("HOG detector on real images", f"{_sources(models)}\n\n{kitchen}\n\n{scenes}", options.write)
    return 0


def _model(options: argparse.Namespace, channels: Channels) -> HogModel:
    """Of the folder, or trained now."""
    file = options.folder / "models" / f"real-{channels}.npz"
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        views, backgrounds = material(options.data, options.folder)
        config, checkpoint, start = replace(CONFIG, channels=channels), file.with_suffix(".npz.part"), time.time()
        model = train(views, backgrounds, config, checkpoint=checkpoint, sources=("ycb", "uw_objects"))
        model.save(file)
        checkpoint.unlink(missing_ok=True)
        print(f"{channels}: trained in {(time.time() - start) / 60.0:.1f} min, {file}", file=sys.stderr, flush=True)
    return load_model(file)


def material(data: Path, folder: Path) -> tuple[ObjectViews, Backgrounds]:
    """Views of the objects, and backgrounds that show none of them unnamed."""
    clouds = open_object_views(data / "uw_objects")
    views = ObjectViews.joined([scan_views(data / "ycb", TURNTABLE), *[clouds] * REPEATS])
    called = [_called(entry, SAME[entry.label]) if entry.label in SAME else entry for entry in views.entries]
    chosen = ObjectViews([entry for entry in called if entry.label in CLASSES], views.skipped)
    rooms = [Backgrounds(open_sequence(rendered(folder, room)), stride=ROOM_STRIDE) for room in ROOMS]
    return chosen, Backgrounds.joined([*rooms, *_empty_kitchen(data / "redkitchen")])


def _called(entry: ViewEntry, label: str) -> ViewEntry:
    return replace(entry, label=label, read=lambda: replace(entry.read(), label=label))


def _empty_kitchen(folder: Path) -> Iterator[Backgrounds]:
    """Frames, none of which is looked at later, with no known object of the classes in view."""
    sequence, truth = open_sequence(folder), open_truth(folder)
    assert sequence.poses is not None
    for k in range(STEP // 2, len(sequence), KITCHEN_STRIDE):
        pose = sequence.poses[k]
        if k % STEP and np.isfinite(pose).all() and not is_in_view(pose, sequence.intrinsics, truth, CLASSES):
            yield Backgrounds(Subset(sequence, range(k, k + 1)))


def describe_kitchen(models: Models, folder: Path, pictures: Path | None) -> str:
    """Markdown: hits and false alarms in a recorded kitchen."""
    truth = open_truth(folder)
    assert truth.sequence is not None
    frames = list(usable_frames(subset(truth.sequence, STEP), lambda broken: None))
    known = [known_in_frame(frame, truth, CLASSES) for frame in frames]
    rows = []
    for channels, model in models.items():
        found = _detect(model, frames)
        rows += _rows(channels, found, known)
        _draw(pictures, f"kitchen-{channels}", frames, found, known)
    return (
        f"`redkitchen`, {len(frames)} frames. Known are the places of the two mugs, to 0.08 and 0.10 m; a mug "
        "counts where it is in the image and not hidden. Every other box of the five classes is taken to be false: no "
        "bowl, cap, cereal box or can is known to be in that kitchen.\n\n" + table(_HEAD, rows)
    )


def describe_scenes(models: Models, folder: Path, seen: Path | None, pictures: Path | None) -> str:
    """Markdown: the single images of RGB-D Scenes v2, the one with depth apart."""
    points = read_seen(seen) if seen else {}
    pair = [open_sequence(folder / "imgs" / "scene_01")[0]]
    first = [_color_frame(file) for file in sorted((folder / "first_frames").glob("*-color.png"))]
    texts = []
    for title, frames, kinds in (
        ("`uw_scenes_v2`, the one frame with depth", pair, tuple(models)),
        (f"`uw_scenes_v2`, {len(first)} first frames, colour only", first, (Channels.RGB,)),
    ):
        known = [points.get(_scene(frame), []) for frame in frames]
        rows = []
        for channels in kinds:
            found = _detect(models[channels], frames)
            rows += _rows(channels, found, known)
            _draw(pictures, f"scenes-{len(frames)}-{channels}", frames, found, known)
        told = (
            "objects as somebody saw them in the images"
            if seen
            else "nobody has said what they show: boxes are counted"
        )
        texts.append(f"{title}; {told}.\n\n" + table(_HEAD, rows))
    return "\n\n".join(texts)


_HEAD = ("model", "probability from", "objects", "found", "false a frame", "false by class")


def _rows(channels: Channels, found: Sequence[Detections], known: Sequence[Sequence[KnownPoint]]) -> list[Sequence]:
    return [_row(channels, least, judge(found, known, least, CLASSES)) for least in LEAST]


def _row(channels: Channels, least: float, verdict: Verdict) -> Sequence:
    by_class = ", ".join(f"{label} {count}" for label, count in verdict.false.items() if count)
    false = f"{sum(verdict.false.values()) / verdict.images:.2f}"
    return channels.value, f"{least:.1f}", verdict.known, verdict.hits, false, by_class or "-"


def _detect(model: HogModel, frames: Sequence[Frame]) -> list[Detections]:
    detector = HogDetector(model, confidence=min(LEAST))
    return [detector(frame) for frame in frames]


def _color_frame(file: Path) -> Frame:
    """An image without depth, from the camera of RGB-D Scenes v2."""
    color = cv2.imread(str(file))
    if color is None:
        raise InputError(file, "an image", "none that can be read", "give the data as they came")
    nothing = np.zeros(color.shape[:2], dtype=np.float32)
    return Frame(0, file.stem, 0.0, np.ascontiguousarray(color[:, :, ::-1]), nothing, CAMERA)


def _scene(frame: Frame) -> str:
    """scene_02 of scene_02_00000-color; frames of `imgs` are called by their number alone, and there is one."""
    return frame.name[:8] if frame.name.startswith("scene_") else "scene_01"


def _draw(
    folder: Path | None,
    name: str,
    frames: Sequence[Frame],
    found: Sequence[Detections],
    known: Sequence[Sequence[KnownPoint]],
) -> None:
    """A picture a frame: boxes of whole objects, thick where they show what is known, crosses at what is known."""
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for number, (frame, boxes, points) in enumerate(zip(frames, found, known, strict=True)):
        image = np.ascontiguousarray(frame.color[:, :, ::-1])
        for point in points:
            cv2.drawMarker(image, tuple(int(v) for v in point.xy), (255, 255, 255), cv2.MARKER_CROSS, 12, 1)
        for n in np.flatnonzero((boxes.part == Part.WHOLE) & (boxes.confidence >= min(LEAST)))[::-1]:
            label = boxes.classes[boxes.class_id[n]]
            color = COLORS[CLASSES.index(label)]
            x0, y0, x1, y1 = (int(v) for v in boxes.xyxy[n])
            right = any(shows(boxes.xyxy[n], label, point) for point in points)
            cv2.rectangle(image, (x0, y0), (x1, y1), color, 3 if right else 1)
            text = f"{label} {boxes.confidence[n]:.2f}"
            cv2.putText(image, text, (x0, max(y0 - 3, 10)), cv2.FONT_HERSHEY_SIMPLEX, 0.4, color, 1, cv2.LINE_AA)
        cv2.imwrite(str(folder / f"{name}-{number:03d}.jpg"), image)


def _sources(models: Models) -> str:
    """What the models were learned from."""
    counts = next(iter(models.values())).about["settings"]["counts"]
    views = ", ".join(f"{label} {row['views']}" for label, row in counts["classes"].items())
    return (
        f"Learned from rendered views of the scans of `ycb` and from the single clouds of `uw_objects` ({REPEATS} "
        f"times, each time put somewhere else): {views}. Backgrounds: {counts['frames']} frames of rendered rooms, "
        "and of `redkitchen` where none of its mugs is in view."
    )


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--data", type=Path, required=True, metavar="DIR", help="with ycb, uw_objects, redkitchen and uw_scenes_v2")
    add("--folder", type=Path, required=True, metavar="DIR", help="keep rooms and models there; those in it are used")
    add("--pictures", type=Path, metavar="DIR", help="draw every image there")
    add("--seen", type=Path, metavar="FILE", help="JSON: what the images of uw_scenes_v2 show")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())

"""What there is to know of tracks of the shape-context detector, learned on rendered tables that no benchmark uses.

uv run python benchmarks/shape_context_judge.py -o judge.json

Every 5th frame of 36 tables, rendered as they are needed: 10 to 20 minutes on one core. Poses are the true ones.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shape_context_boxes import JUDGED, class_numbers, truth_of
from shape_context_job import STEP, mapper_config
from suite import Scene

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.detectors.boxes import box_ious
from thingmap.detectors.shape_context.detector import ShapeContextDetector
from thingmap.detectors.shape_context.model import shipped_model
from thingmap.mapper.evaluation.boxes.image_boxes import EDGE, TrueBoxes
from thingmap.mapper.multiview.track_judge import TrackJudge, fit_judge
from thingmap.mapper.multiview.track_mapper import TrackMapper

SEEDS, FRAMES = (3, 7, *range(50, 60)), 150  # not those of the thresholds, nor of the detector's training
QUICK_SEEDS, QUICK_FRAMES = (3,), 20


@dataclass(frozen=True, slots=True, eq=False)
class KnownTracks:
    """N tracks: (N, F) features, (N,) true class of the detector's, the number of classes for none, and (N,) weight."""

    features: np.ndarray
    label: np.ndarray
    weight: np.ndarray


def main() -> int:
    """Learn and write; 2 for a user's mistake."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="FILE", help="where the judge goes")
    parser.add_argument("--model", type=Path, metavar="FILE", help="of the detector; by default the shipped one")
    parser.add_argument("--quick", action="store_true", help="three short tables, to see whether everything works")
    options = parser.parse_args()
    try:
        judge_of(options.model or shipped_model(), options.quick).save(options.out)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def judge_file(folder: Path, model: Path) -> Path:
    """Where `learn_judge` leaves what it learned of a detector's tracks."""
    return folder / "models" / f"judge-{model.stem}.json"


def learn_judge(model: Path, folder: Path, quick: bool = False) -> Path:
    """The file of a judge learned anew.

    Raises:
        UserError: the model cannot be read, or the file not be written.
    """
    file = judge_file(folder, model)
    file.parent.mkdir(parents=True, exist_ok=True)
    judge_of(model, quick).save(file)
    return file


def judge_of(model: Path, quick: bool) -> TrackJudge:
    """Learned of this detector's tracks on `SEEDS` at all levels of clutter."""
    detector = ShapeContextDetector(model, confidence=0.0)
    seeds, frames = (QUICK_SEEDS, QUICK_FRAMES) if quick else (SEEDS, FRAMES)
    scenes = [Scene(Preset.TABLETOP, level, seed, frames) for seed in seeds for level in ClutterLevel]
    return fitted([known_tracks(scene, detector) for scene in scenes], detector.classes, [s.name for s in scenes])


def fitted(known: Iterable[KnownTracks], classes: tuple[str, ...], names: list[str]) -> TrackJudge:
    """The judge that these tracks teach."""
    several = list(known)
    features, label, weight = (
        np.concatenate([getattr(one, name) for one in several]) for name in ("features", "label", "weight")
    )
    return fit_judge(features, label, weight, classes, f"{len(names)} sequences ({', '.join(names[:3])}, ...)")


def known_tracks(scene: Scene, detector: ShapeContextDetector) -> KnownTracks:
    """The tracks of one scene; they count by the views in which they were what they mostly are."""
    spec = f"synth:{scene.preset}?clutter={scene.clutter}&seed={scene.seed}&frames={scene.frames}"
    sequence, truth = open_sequence(spec, stride=STEP), open_truth(spec)
    mapper = TrackMapper(detector, mapper_config(poses=True), source=scene.name)
    for frame in sequence:
        mapper.process_frame(frame)
    number, views = class_numbers(detector.classes, truth), []
    for keyframe in range(len(sequence)):  # every frame is one
        xyxy, tracks = mapper.image_tracks(keyframe)
        views.append((tracks, shown(xyxy, truth_of(truth, keyframe * STEP), number)))
    features = mapper.track_features()
    votes = np.zeros((len(features), len(detector.classes) + 1))
    for tracks, classes in views:
        np.add.at(votes, (tracks[tracks >= 0], classes[tracks >= 0]), 1.0)
    print(f"{scene.name}: {len(votes)} tracks", file=sys.stderr, flush=True)
    return KnownTracks(features, votes.argmax(axis=1), votes.max(axis=1) / len(views))


def shown(xyxy: np.ndarray, true: TrueBoxes, number: np.ndarray) -> np.ndarray:
    """(N,) which of the detector's K classes each of (N, 4) boxes shows, K for none.

    Args:
        xyxy: pixels, from the image's outer edges.
        true: the objects.
        number: (K,) of the detector's classes among the truth's.
    """
    overlap = np.maximum(box_ious(xyxy - EDGE, true.whole), np.nan_to_num(box_ious(xyxy - EDGE, true.visible)))
    if overlap.size == 0:
        return np.full(len(xyxy), len(number))
    of_number = {int(k): row for row, k in enumerate(number)}
    best = np.array([of_number.get(int(k), len(number)) for k in true.class_id[overlap.argmax(axis=1)]])
    return np.where(overlap.max(axis=1) >= JUDGED.box_iou, best, len(number))


if __name__ == "__main__":
    sys.exit(main())

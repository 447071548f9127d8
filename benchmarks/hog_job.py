"""One held-out scene seen by one HOG model: boxes matched by the evaluator's rules, and scores at true boxes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from suite import Scene
from suite_job import scene_folder

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.datasets.truth import FrameTruth
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.hog.candidates import Candidates, corner_boxes, scored_levels
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.model import HogModel, load_model
from thingmap.detectors.hog.pyramid import build_pyramid
from thingmap.detectors.hog.score_vectors import score_vectors
from thingmap.detectors.hog.scoring import Scorer
from thingmap.detectors.parts import part_box
from thingmap.mapper.evaluation.boxes.image_boxes import (
    EDGE,
    FoundBoxes,
    TrueBoxes,
    clip_boxes,
    found_boxes,
    true_boxes,
)
from thingmap.mapper.evaluation.boxes.matching import NOTHING, Matches, match_boxes
from thingmap.mapper.evaluation.config import EvaluationConfig

CONFIDENCE = 0.01  # of boxes: curves need doubtful ones too
JUDGED = EvaluationConfig()


@dataclass(frozen=True, slots=True)
class Job:
    """A scene in a folder, every how many frames it is looked at, by which model; `sights` if those are wanted."""

    scene: Scene
    step: int
    model: Path
    folder: Path
    sights: bool


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """N objects in frames, each whole in the image: what hides them, and what each template makes of them.

    Attributes:
        occlusion: (N, 5) by `Part`, hidden share of the object, and of its halves.
        found: (N, 5) probability of the box that found it, 0 where none did.
        score: (N, 5) probability of its class by the best window at its place.
    """

    occlusion: np.ndarray
    found: np.ndarray
    score: np.ndarray

    @classmethod
    def joined(cls, several: Sequence[Sights]) -> Sights:
        """All of them."""
        none = np.zeros((0, len(Part)))
        return cls(
            *(np.concatenate([none, *(getattr(s, name) for s in several)]) for name in ("occlusion", "found", "score"))
        )


@dataclass(frozen=True, slots=True, eq=False)
class JudgedScene:
    """What one model made of one scene.

    Attributes:
        job: which.
        matches: by part, the boxes of every frame looked at.
        sights: of all these frames; None if they were not wanted.
        milliseconds: of the detector, the median of its frames.
    """

    job: Job
    matches: dict[Part, list[Matches]]
    sights: Sights | None
    milliseconds: float


def judge_scene(job: Job) -> JudgedScene:
    """Detect in every `job.step`-th frame, and match.

    Raises:
        UserError: the scene has no truth by frame, or the model does not know its classes.
    """
    truth, model = open_truth(scene_folder(job.scene, job.folder)), load_model(job.model)
    _check(truth, model, job)
    assert truth.sequence is not None and truth.frame_truth is not None
    detector = HogDetector(replace(model, second_stage=None), confidence=CONFIDENCE)
    matches: dict[Part, list[Matches]] = {part: [] for part in Part}
    sights, seconds = [], []
    for number in range(0, len(truth.sequence), job.step):
        seen = truth.frame_truth(number)
        if seen is None:
            continue
        frame = truth.sequence[number]
        start = time.perf_counter()
        found = detector(frame)
        seconds.append(time.perf_counter() - start)
        for part in Part:
            matches[part].append(_match(found, seen, truth, part, JUDGED.min_visibility, number))
        if job.sights:
            sights.append(_sights(found, seen, truth, frame, model))
    together = Sights.joined(sights) if job.sights else None
    return JudgedScene(job, matches, together, 1e3 * float(np.median(seconds)))


def _check(truth: GroundTruth, model: HogModel, job: Job) -> None:
    if truth.frame_truth is None or truth.sequence is None:
        raise UserError(f"{job.scene.name}: nothing is known of its frames; remove its folder to render it again")
    if truth.classes != CLASSES:  # tables name classes by their numbers in the truth
        found = ", ".join(truth.classes)
        raise UserError(f"{job.scene.name}: expected the classes {', '.join(CLASSES)}, found {found}; render it again")
    unknown = sorted(set(CLASSES) - set(model.classes))
    if unknown:
        raise UserError(f"{job.model}: expected a model of the synthetic classes, but it lacks {', '.join(unknown)}")


def _match(
    found: Detections, seen: FrameTruth, truth: GroundTruth, part: Part, min_visibility: float, frame: int
) -> Matches:
    """Boxes of one part against that part of the true objects."""
    return match_boxes(boxes_of(found, truth, part), part_of(seen, truth, part, min_visibility), JUDGED.box_iou, frame)


def boxes_of(found: Detections, truth: GroundTruth, part: Part) -> FoundBoxes:
    """The detector's boxes of one part, each once: as its best class."""
    assert truth.intrinsics is not None
    own = found.select(found.part == part)
    known = np.array([truth.classes.index(name) if name in truth.classes else -1 for name in own.classes])
    class_id = known[own.class_id]
    kept = class_id >= 0
    return found_boxes(own.xyxy[kept] - EDGE, class_id[kept], own.confidence[kept], truth.intrinsics)


def part_of(seen: FrameTruth, truth: GroundTruth, part: Part, min_visibility: float) -> TrueBoxes:
    """The true objects, or one half of each: its box is that half of the whole box, cut to the image.

    Objects are fair by what is seen of that half.
    """
    assert truth.intrinsics is not None
    whole = true_boxes(seen, truth, truth.intrinsics, min_visibility)
    if part == Part.WHOLE:
        return whole
    rows = _rows(seen, truth)
    half = clip_boxes(part_box(seen.xyxy[rows], part), truth.intrinsics)
    visibility = seen.part_visibility[rows, part]
    nowhere = np.full_like(half, np.nan)
    return replace(whole, whole=half, visible=nowhere, visibility=visibility, fair=visibility >= min_visibility)


def _rows(seen: FrameTruth, truth: GroundTruth) -> np.ndarray:
    """The frame's rows that are objects of the truth's classes, as `true_boxes` takes them."""
    known = {thing.id for thing in truth.objects}
    return np.array([row for row, id_ in enumerate(seen.object_id) if int(id_) in known], dtype=np.int64)


def _sights(found: Detections, seen: FrameTruth, truth: GroundTruth, frame: Frame, model: HogModel) -> Sights:
    """What every template says about every object whose whole box is in the image."""
    rows = _rows(seen, truth)
    by_part = []
    for part in Part:
        match = _match(found, seen, truth, part, 0.0, frame.index)
        best = np.zeros(len(rows))
        hits = match.object_row != NOTHING
        best[match.object_row[hits]] = match.found.score[hits]
        by_part.append(best)
    k = frame.intrinsics
    boxes = seen.xyxy[rows] + EDGE
    inside = (boxes[:, :2] >= 0.0).all(axis=1) & (boxes[:, 2:] <= (k.width, k.height)).all(axis=1)
    labels = {thing.id: thing.label for thing in truth.objects}
    class_id = np.array([model.classes.index(labels[int(seen.object_id[row])]) for row in rows], dtype=np.int64)
    scores = scores_at(boxes[inside], class_id[inside], frame, model)
    return Sights(1.0 - seen.part_visibility[rows][inside], np.stack(by_part, axis=1)[inside], scores)


def scores_at(xyxy: np.ndarray, class_id: np.ndarray, frame: Frame, model: HogModel) -> np.ndarray:
    """(N, 5) by `Part`, probability of the object's own class at its (N, 4) box, or at that half of it.

    The best window counts whose box overlaps that by half; where there is none, the one that overlaps it most.
    """
    k = frame.intrinsics
    focal = float(np.sqrt(k.fx * k.fy))
    depth = frame.depth if model.channels.use_depth else None
    pyramid = build_pyramid(frame.color, depth, focal, model.channels, model.pyramid)
    levels = scored_levels(pyramid, Scorer(model.templates), corner_boxes(model.templates))
    result = np.zeros((len(xyxy), len(Part)))
    for part in Part:
        if not len(xyxy):
            continue
        what = np.full(len(xyxy), part, dtype=np.int64)
        there = Candidates(class_id, what, part_box(xyxy, part), np.ones(len(xyxy)))
        every = score_vectors(there, levels, model.templates, len(model.classes), 1.0)  # 1: nothing is suppressed
        result[:, part] = np.nan_to_num(every[np.arange(len(xyxy)), class_id])
    return result

"""What the occlusion benchmark compares: mappers, and the detector alone. All are judged in the same next views.

The protocol `meger` of `thingmap evaluate` judges the map of views 1 to N in view N + 1. The detector alone is judged
in that view by the same matching and ignore rules, its confidence being the score; unlike the maps, it has seen it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from suite import Variant

from thingmap.datasets.frame import BrokenFrame, Frame
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.onnx.suppression import suppress
from thingmap.detectors.parts import whole_box
from thingmap.mapper.evaluation.boxes.image_boxes import detected_boxes, frame_boxes
from thingmap.mapper.evaluation.boxes.matching import match_boxes, scored
from thingmap.mapper.evaluation.boxes.outcomes import ALL, Outcomes, read_outcomes
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.inputs.build_case import build_case
from thingmap.mapper.evaluation.inputs.case import Case, MappedRun, Snapshot
from thingmap.mapper.evaluation.protocols import meger
from thingmap.mapper.evaluation.result import NotEvaluated
from thingmap.mapper.evaluation.things.matching import match_ranked
from thingmap.mapper.evaluation.uncertainty.claims import class_claims, existence_claims
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.up_direction import UpDirection
from thingmap.mapper.mapper import SemanticMapper

VIEWS = tuple(range(2, 13))  # Explicit Occlusion, figure 6, has 2 to 6; Clutter, VI-C, has 3, 7, 10 and 12
JUDGED = EvaluationConfig(path_lengths=(), explicit_lengths=VIEWS)
BATCH_VIEWS = (4, 7, 12)
PART_OVERLAP = 0.5  # intersection over union above which the lesser of two boxes is taken for the same object


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """What all methods are given: a scene's frames, the detections in each, and the truth; `name` is the sequence's."""

    name: str
    frames: Sequence[Frame]
    detections: Sequence[Detections]
    truth: GroundTruth


@dataclass(frozen=True, slots=True, eq=False)
class Claims:
    """What final maps say of their things, doubtful ones too.

    Attributes:
        existence: (N,) of every thing, and
        stands: (N,) bool, whether it stands for an object.
        probability: (M,) of the likeliest class, of the things that do, and
        right: (M,) bool, whether the object is of that class.
    """

    existence: np.ndarray
    stands: np.ndarray
    probability: np.ndarray
    right: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """Outcomes by number of views and class; claims of the map of all frames where they were asked for."""

    outcomes: Outcomes
    claims: Claims | None = None


@dataclass(frozen=True, slots=True)
class Method:
    """One of what is compared: a short stable `name`, a `title` for tables, and how it does in a scene."""

    name: str
    title: str
    judge: Callable[[Material], Judgement]


def map_views(
    make_mapper: Callable[[], SemanticMapper], views: Sequence[int], claims: bool, material: Material
) -> Judgement:
    """A mapper after each of these numbers of views; with `claims` it goes on through all frames."""
    mapper, snapshots, mapped = make_mapper(), [], 0
    last = len(material.frames) if claims else max(VIEWS) + 1  # the last of the maps is judged in one view more
    for frame, found in zip(material.frames[:last], material.detections, strict=False):
        try:
            mapper.process_frame(frame, found)
        except BrokenFrame:  # left out, as `thingmap run` does
            continue
        mapped += 1
        if mapped in views:
            object_map = mapper.object_map(include_doubtful=True)  # first: a batch mapper moves the cameras too
            stamps, poses = mapper.trajectory()
            snapshots.append(Snapshot(mapped, float(stamps[-1]), poses[-1], object_map))
    case = _case(material, mapper.object_map(include_doubtful=True), *mapper.trajectory(), snapshots)
    return Judgement(read_outcomes(meger.evaluate(case)), _claims(case) if claims else None)


def map_batch(material: Material) -> Judgement:
    """The batch mapper, which infers all volumes anew for each number of views: a few of them are enough."""
    from thingmap.mapper.batch.batch_mapper import BatchMapper

    return map_views(partial(BatchMapper, views=range(max(VIEWS))), BATCH_VIEWS, False, material)


def detect_next_view(parts: bool, material: Material) -> Judgement:
    """The detector alone in the views that the maps are judged in; with `parts` its boxes of parts count too."""
    truth, outcomes = material.truth, Outcomes()
    assert truth.poses is not None and truth.intrinsics is not None
    up = UpDirection(np.array([0.0, 0.0, 1.0]) if truth.up is None else truth.up, 0.0, "truth")
    nothing = ObjectMap((), (), material.name, MapFrame.DATASET, up)
    case = _case(material, nothing, truth.stamps, truth.poses, ())
    for views in VIEWS:
        true = frame_boxes(case, views) if views < len(material.frames) else None
        if true is not None:
            found = as_wholes(material.detections[views]) if parts else material.detections[views]
            boxes = detected_boxes(found, case, truth.intrinsics)
            match = match_boxes(boxes, true, JUDGED.box_iou, views)
            outcomes |= {(views, label): scored([match], k) for k, label in enumerate(truth.classes)}
            outcomes[views, ALL] = scored([match])
    return Judgement(outcomes)


def as_wholes(found: Detections) -> Detections:
    """Parts as the whole objects that they imply, and of boxes that then overlap by `PART_OVERLAP` the best."""
    xyxy = whole_box(found.xyxy, found.part)
    wholes = replace(found, xyxy=xyxy, part=np.full(len(found), Part.WHOLE), mask=None)
    return wholes.select(suppress(xyxy, found.confidence, PART_OVERLAP, len(found)))


def _case(
    material: Material, object_map: ObjectMap, stamps: np.ndarray, poses: np.ndarray, snapshots: Sequence[Snapshot]
) -> Case:
    """What the evaluator would read from a run's folder; raises `UserError` where map and truth do not fit."""

    def no_cloud() -> tuple[np.ndarray, None]:
        raise NotEvaluated("the benchmark keeps no clouds")

    run = MappedRun(Path(material.name), object_map, stamps, poses, {}, tuple(snapshots), None, no_cloud)
    return build_case(run, material.truth, JUDGED)


def _claims(case: Case) -> Claims:
    """As the protocol `honesty` takes them."""
    matching = match_ranked(case)
    posterior, true_class = class_claims(case, matching)
    rows, named = np.arange(len(posterior)), posterior.argmax(axis=1)
    return Claims(*existence_claims(matching), posterior[rows, named], named == true_class)


def _mapper(variant: Variant, claims: bool = False) -> Method:
    make = partial(SemanticMapper, config=variant.config)
    return Method(variant.name, variant.title, partial(map_views, make, VIEWS, claims))


FULL = _mapper(Variant("full", "full"), claims=True)
DETECTOR_ALONE = Method("detector", "(a) detector", partial(detect_next_view, False))
NO_OCCLUSION = _mapper(Variant("no-occlusion", "(b) no occlusion", "evidence", "occlusion", False))
NO_DEPTH = _mapper(Variant("no-depth", "(c) no depth", "evidence", "depth", False))
NO_PARTS = _mapper(Variant("no-parts", "(d) no parts", "evidence", "parts", False))
WITH_PARTS = Method("detector-parts", "(a) and its parts", partial(detect_next_view, True))
BATCH = Method("batch", "batch", map_batch)
METHODS = (FULL, DETECTOR_ALONE, NO_OCCLUSION, NO_DEPTH, NO_PARTS, WITH_PARTS, BATCH)
ALWAYS = METHODS[:-1]  # unless others are asked for

"""One scene labelled with every smoothness term, with and without volumes, from many frames and from few; and its boxes
checked against the labels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numba
import numpy as np
from labelling_folder import Job, gather, mapped

from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.sequence import Sequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper.evaluation.boxes.curves import Scored
from thingmap.mapper.evaluation.boxes.image_boxes import check_boxes, detected_boxes, frame_boxes
from thingmap.mapper.evaluation.boxes.matching import match_boxes, scored
from thingmap.mapper.evaluation.inputs.build_case import build_case
from thingmap.mapper.evaluation.inputs.case import Case, MappedRun
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.evaluation.points.labelled_points import label_points
from thingmap.mapper.labelling.instances import find_instances
from thingmap.mapper.labelling.labelling import Labels, label_voxels
from thingmap.mapper.labelling.labelling_config import LabellingConfig
from thingmap.mapper.labelling.mrf_config import Smoothness
from thingmap.mapper.labelling.validation import Validator
from thingmap.mapper.labelling.volumes_evidence import weighted_volumes
from thingmap.mapper.labelling.voxels import Voxels

MANY, FEW = 10, 80  # frames from one that is looked at to the next (Lai et al., IV-B)
BETWEEN = MANY // 2  # boxes are checked in the frames in the middle between those that labels come from
LEAST = 0.02  # probability from which on boxes are looked at: "detectors with a low threshold" (IV-C)
TERMS = (Smoothness.NONE, Smoothness.POTTS, Smoothness.COLOUR, Smoothness.NORMALS)


class Variant(NamedTuple):
    """A way to label: whether the map's volumes are evidence too, the term, and every how many frames are looked at."""

    volumes: bool
    term: Smoothness
    stride: int = MANY


VARIANTS = tuple(
    [Variant(volumes, term) for volumes, term in product((False, True), TERMS)]
    + [Variant(volumes, Smoothness.NORMALS, FEW) for volumes in (False, True)]
)
CHECKED = Variant(True, Smoothness.NORMALS)  # whose labels boxes are checked against


class Points(NamedTuple):
    """(N,) int8 labels of a cloud's points, found and true: indices into the truth's classes, `NO_OBJECT` for none."""

    found: np.ndarray
    true: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class JudgedScene:
    """What became of one scene.

    Attributes:
        job: which.
        classes: of the truth.
        points: of every variant.
        before: boxes of the frames between, as the detector gives them.
        agreed: those of them that the labels of `CHECKED` agree with (Lai et al., IV-C).
        after: the same where things are found once and drawn midway to their points, as `--validate` does.
    """

    job: Job
    classes: tuple[str, ...]
    points: Mapping[Variant, Points]
    before: Scored
    agreed: Scored
    after: Scored


def judge_scene(job: Job) -> JudgedScene:
    """Map, gather, label in all ways, check boxes.

    Raises:
        UserError: the scene or the detector cannot be used.
    """
    numba.set_num_threads(1)
    out = mapped(job)
    run, sequence, truth = load_run(out.path), open_sequence(job.place), open_truth(job.place)
    config, points, checked = LabellingConfig(), {}, None
    for stride in (MANY, FEW):
        voxels = gather(job, run, sequence, replace(config, stride=stride))
        for variant in VARIANTS:
            if variant.stride == stride:
                labels = label_by(variant, voxels, run, config)
                points[variant] = judge_points(voxels, labels.label, run, job)
                if variant == CHECKED:
                    own = find_instances(voxels, labels, run.object_map, config).number
                    checked = voxels.points, labels.of_points(own)
    assert checked is not None
    order = np.argsort(run.stamps, kind="stable")
    poses = run.stamps[order], run.poses[order]
    validator = Validator(*checked, run.object_map.classes, *poses)
    return JudgedScene(job, truth.classes, points, *check_detections(job, build_case(run, truth), sequence, validator))


def label_by(variant: Variant, voxels: Voxels, run: MappedRun, config: LabellingConfig) -> Labels:
    """Labels of the voxels, indices into the map's classes."""
    more = weighted_volumes(voxels.points, run.object_map, config) if variant.volumes else None
    return label_voxels(voxels, replace(config.mrf, smoothness=variant.term), more)


def judge_points(voxels: Voxels, label: np.ndarray, run: MappedRun, job: Job) -> Points:
    """As `thingmap evaluate` judges a labelled cloud."""
    labelled = replace(run, cloud=lambda: (voxels.points, label))
    points = label_points(build_case(labelled, open_truth(job.place)))
    return Points(points.found.astype(np.int8), points.true.astype(np.int8))


def check_detections(job: Job, case: Case, sequence: Sequence, validator: Validator) -> tuple[Scored, Scored, Scored]:
    """Boxes of the frames between, all classes together: before, those that labels agree with, and validated."""
    check_boxes(case.truth)
    assert case.truth.intrinsics is not None
    detector = make_detector(_with_low_threshold(job.detector), sequence)
    before, agreed, after = [], [], []
    for index, row in zip(case.truth_index.tolist(), case.run_index.tolist(), strict=True):
        true = frame_boxes(case, index) if index % MANY == BETWEEN else None
        if true is None:
            continue
        frame = sequence[index]
        found = detector(frame)
        validated = validator.validate(found, frame, case.run.poses[row])
        agreeing = found.select(validated.agrees)
        for matches, some in ((before, found), (agreed, agreeing), (after, validated.detections)):
            boxes = detected_boxes(some, case, case.truth.intrinsics)
            matches.append(match_boxes(boxes, true, case.config.box_iou, index))
    return scored(before), scored(agreed), scored(after)


def _with_low_threshold(spec: str) -> str:
    name = "min_score" if spec.startswith("simulated") else "confidence"
    return f"{spec}{'&' if '?' in spec else '?'}{name}={LEAST}"

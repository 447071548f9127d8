"""One scene by the shape-context detector: by single views, by tracks as the paper's, by the full graph.

All of them get the same detections, of the same frames, each of which is a keyframe.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
from shape_context_boxes import BACKGROUND, JUDGED, Called, class_numbers, judge_called, truth_of
from shape_context_detections import detect
from suite import Scene
from suite_job import scene_folder

from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.sequence import Sequence
from thingmap.detectors.recorded import RecordedDetections
from thingmap.factors.evidence_model import load_evidence_model
from thingmap.mapper.config import KeyframeConfig, MapperConfig, OdometryConfig, OdometrySource
from thingmap.mapper.config_file import dump_config
from thingmap.mapper.evaluation.boxes.image_boxes import EDGE, found_boxes
from thingmap.mapper.evaluation.boxes.matching import Matches, match_boxes
from thingmap.mapper.evaluation.boxes.projection import projected_boxes
from thingmap.mapper.evaluation.inputs.build_case import build_case
from thingmap.mapper.evaluation.inputs.case import Case
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.evaluation.points.labelled_points import LabelledPoints, label_points
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.multiview.track_judge import load_judge
from thingmap.mapper.multiview.track_mapper import TrackMapper
from thingmap.mapper.runner import SequenceRun
from thingmap.mapper.saving import save_run

STEP = JUDGED.frame_step
KEYFRAMES = KeyframeConfig(max_gap=1, lost_gap=1)  # every frame that the mapper is given


class Mode(StrEnum):
    """What makes something of the detections."""

    SINGLE = "single view"
    TRACKS_POSES = "tracks, true poses"
    TRACKS = "tracks"
    JUDGED_POSES = "judged tracks, true poses"
    JUDGED = "judged tracks"
    GRAPH_POSES = "graph, true poses"
    GRAPH = "graph"

    @property
    def has_poses(self) -> bool:
        """Whether the true poses are given."""
        return self in (Mode.TRACKS_POSES, Mode.JUDGED_POSES, Mode.GRAPH_POSES)


TRACKS, GRAPHS = (Mode.TRACKS_POSES, Mode.TRACKS), (Mode.GRAPH_POSES, Mode.GRAPH)
JUDGES = (Mode.JUDGED_POSES, Mode.JUDGED)


@dataclass(frozen=True, slots=True)
class Job:
    """A rendered scene in a folder, the detector's model, and what graph and judge know of the detector.

    `believed` are thresholds, from which a thing of a graph labels points; None where no points are labelled.
    """

    scene: Scene
    folder: Path
    model: Path
    evidence: Path
    judge: Path
    believed: Mapping[Mode, float | None] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JudgedScene:
    """What became of one scene.

    Attributes:
        job: which.
        classes: of the truth.
        matches: of every mode, the boxes of every frame.
        called: of the modes that say something of every proposal, the same.
        points: of every mapper, labelled points; none where the job wants none.
        milliseconds: of the detector, the median of its frames.
    """

    job: Job
    classes: tuple[str, ...]
    matches: Mapping[Mode, list[Matches]]
    called: Mapping[Mode, list[Called]]
    points: Mapping[Mode, LabelledPoints]
    milliseconds: float


def judge_scene(job: Job) -> JudgedScene:
    """Detect, map six times, and match.

    Raises:
        UserError: the scene has no truth by frame, or a model cannot be read.
    """
    numba.set_num_threads(1)
    found = detect(job.scene, job.model, job.folder, STEP)
    place = scene_folder(job.scene, job.folder)
    truth, sequence = open_truth(place), open_sequence(place, stride=STEP)
    detector = RecordedDetections(found.file)
    matches: dict[Mode, list[Matches]] = {}
    called: dict[Mode, list[Called]] = {}
    points: dict[Mode, LabelledPoints] = {}
    matches[Mode.SINGLE], called[Mode.SINGLE] = _single_views(detector, sequence, truth)
    for mode in (*TRACKS, *JUDGES, *GRAPHS):
        mapped = _map(mode, job, sequence, detector, truth)
        if isinstance(mapped.mapper, TrackMapper) and mode in JUDGES:
            matches[mode] = _drawn(mapped.mapper, detector.classes, mapped.case)
        elif isinstance(mapped.mapper, TrackMapper):
            matches[mode], called[mode] = _tracked(mapped.mapper, detector.classes, mapped.case)
        else:
            matches[mode] = _projected(mapped.case)
        if job.believed is not None:
            points[mode] = label_points(mapped.case)
    return JudgedScene(job, truth.classes, matches, called, points, found.milliseconds)


class _Mapped(NamedTuple):
    mapper: SemanticMapper
    case: Case


def _map(mode: Mode, job: Job, sequence: Sequence, detector: RecordedDetections, truth: GroundTruth) -> _Mapped:
    """One mapper over the frames; its output folder is read back as the evaluator does."""
    about = {"source": sequence.name, "gravity": sequence.gravity}
    if mode in (*TRACKS, *JUDGES):
        judge = load_judge(job.judge) if mode in JUDGES else None
        mapper = TrackMapper(detector, mapper_config(mode.has_poses), judge=judge, **about)
    else:
        model = load_evidence_model(job.evidence)
        mapper = SemanticMapper(detector, mapper_config(mode.has_poses), model=model, **about)
    report = SequenceRun(sequence, mapper).execute()
    out = OutputFolder.create(job.folder / "maps" / mode.replace(", ", "-").replace(" ", "-") / job.scene.name, True)
    save_run(out, mapper, report, config=dump_config(mapper.config), include_doubtful=True)
    believed = (job.believed or {}).get(mode)
    judged = JUDGED if believed is None else replace(JUDGED, believed=believed)
    return _Mapped(mapper, build_case(load_run(out.path), truth, judged))


def mapper_config(poses: bool) -> MapperConfig:
    """Of all mappers here: every frame is a keyframe."""
    source = OdometrySource.POSES if poses else MapperConfig().odometry.source
    return MapperConfig(keyframes=KEYFRAMES, odometry=OdometryConfig(source=source))


def _single_views(
    detector: RecordedDetections, sequence: Sequence, truth: GroundTruth
) -> tuple[list[Matches], list[Called]]:
    """Every proposal as its likeliest class, by the probability of that."""
    number = class_numbers(detector.classes, truth)
    both = []
    for frame in sequence:
        found, index = detector(frame), frame.index * STEP
        both.append(judge_called(found.xyxy, number[found.class_id], found.confidence, truth, index))
    return [match for match, _ in both], [called for _, called in both]


def _tracked(mapper: TrackMapper, classes: tuple[str, ...], case: Case) -> tuple[list[Matches], list[Called]]:
    """Every proposal as what its track turned out to be in the end ("assigned to all views in the track").

    Ranked by what its views say on average: posteriors are 1 for most tracks, wrong ones among them.
    """
    number, labels, scores = class_numbers(classes, case.truth), mapper.track_labels(), mapper.track_scores()
    both = []
    for index, row in zip(case.truth_index.tolist(), case.run_index.tolist(), strict=True):
        xyxy, tracks = mapper.image_tracks(row)  # every frame is a keyframe
        class_id = np.array([labels[t][0] if t in labels else BACKGROUND for t in tracks.tolist()], dtype=np.int64)
        score = np.array([scores.get(t, 0.0) for t in tracks.tolist()], dtype=np.float64)
        both.append(judge_called(xyxy, np.where(class_id >= 0, number[class_id], BACKGROUND), score, case.truth, index))
    return [match for match, _ in both], [called for _, called in both]


def _drawn(mapper: TrackMapper, classes: tuple[str, ...], case: Case) -> list[Matches]:
    """Judged tracks in every frame that shows or could show them, as their likeliest class by the probability of it."""
    number, k, matches = class_numbers(classes, case.truth), case.truth.intrinsics, []
    assert k is not None
    for index, row in zip(case.truth_index.tolist(), case.run_index.tolist(), strict=True):
        drawn = mapper.drawn_tracks(row)  # every frame is a keyframe
        known = number[drawn.class_id] != BACKGROUND
        boxes = found_boxes(drawn.xyxy[known] - EDGE, number[drawn.class_id[known]], drawn.score[known], k)
        matches.append(match_boxes(boxes, truth_of(case.truth, index), JUDGED.box_iou, index))
    return matches


def _projected(case: Case) -> list[Matches]:
    """The things of the final map in every frame, from the poses that the run estimated, as `protocols.georgakis`."""
    k = case.truth.intrinsics
    assert k is not None
    matches = []
    for index, row in zip(case.truth_index.tolist(), case.run_index.tolist(), strict=True):
        claimed = projected_boxes(case.things, case.run.object_map, case.run.poses[row], case.truth.classes, k)
        matches.append(match_boxes(claimed, truth_of(case.truth, index), JUDGED.box_iou, index))
    return matches

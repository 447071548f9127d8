"""The shape-context benchmarks: what they count is right, and one tiny scene goes through all mappers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shape_context
import shape_context_ablation
import shape_context_judge
import shape_context_model
import shape_context_speed
from shape_context_boxes import Called
from shape_context_detections import detect
from shape_context_job import Job, JudgedScene, Mode, judge_scene
from shape_context_report import (
    Row,
    Share,
    background_share,
    box_row,
    level_table,
    point_row,
    result_table,
    threshold_at,
    thresholds,
    verdicts,
)
from suite import FIRST_SEED, Scene
from suite_job import scene_folder

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.detectors.recorded import RecordedDetections
from thingmap.detectors.shape_context.calibration import FEATURES, Calibration
from thingmap.detectors.shape_context.codebook import Codebook
from thingmap.detectors.shape_context.config import LENGTH, Context, VotingConfig
from thingmap.detectors.shape_context.detector import ShapeContextDetector
from thingmap.detectors.shape_context.model import ShapeContextModel, load_model
from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.evaluation.boxes.image_boxes import TrueBoxes, found_boxes
from thingmap.mapper.evaluation.boxes.matching import Matches, match_boxes, scored
from thingmap.mapper.multiview.track_evidence import feature_count
from thingmap.mapper.multiview.track_judge import TrackJudge

FRAMES, SEED = 11, 5
SCENE = Scene(Preset.TABLETOP, ClutterLevel.LOW, SEED, FRAMES)
CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One small scene, a model that knows nothing but votes, and what a mapper believes of any detector."""
    folder = tmp_path_factory.mktemp("shape_context")
    config = SyntheticConfig(Preset.TABLETOP, objects=8, clutter=ClutterLevel.LOW, seed=SEED, frames=FRAMES, width=320)
    write_sequence(SyntheticSequence(config), scene_folder(SCENE, folder))
    random_model().save(folder / "model.npz")
    generic_evidence_model().save(folder / "evidence.json")
    random_judge().save(folder / "judge.json")
    return folder


@pytest.fixture(scope="module")
def judged(folder: Path) -> JudgedScene:
    """The scene after all mappers."""
    files = folder / "model.npz", folder / "evidence.json", folder / "judge.json"
    return judge_scene(Job(SCENE, folder, *files, dict.fromkeys(Mode, 0.5)))


def random_model() -> ShapeContextModel:
    rng, count = np.random.default_rng(3), len(CLASSES)
    books = []
    for _ in range(count):
        bins = rng.random((40, LENGTH)) ** 4
        offsets = rng.normal(0.0, 0.02, (40, 2))
        books.append(
            Codebook(bins / bins.sum(axis=1, keepdims=True), offsets, np.full((40, 2), 0.12), 0.1, 50.0, 30.0, 1 / 400)
        )
    calibration = Calibration(np.ones((count, len(FEATURES))), np.ones(count))
    return ShapeContextModel(tuple(sorted(CLASSES)), tuple(books), {}, calibration, VotingConfig(), {})


def random_judge() -> TrackJudge:
    """Believes what views say on average, and is as sure of classes as of background."""
    count, wide = len(CLASSES), feature_count(len(CLASSES))
    weights = np.zeros((count + 1, wide))
    weights[np.arange(count), np.arange(count)] = 1.0
    return TrackJudge(tuple(sorted(CLASSES)), np.zeros(wide), np.ones(wide), weights, np.zeros(count + 1), "nothing")


def test_one_scene_goes_through_all_mappers(judged: JudgedScene) -> None:
    assert set(judged.matches) == set(Mode) and set(judged.points) == set(Mode) - {Mode.SINGLE}
    single = judged.matches[Mode.SINGLE]
    for mode in Mode:
        assert [match.frame for match in judged.matches[mode]] == [0, 5, 10]
        for match, first in zip(judged.matches[mode], single, strict=True):
            np.testing.assert_array_equal(match.true.object_id, first.true.object_id)
    assert sum(len(match.true) for match in single) > 3
    # tracks say something of the very boxes that single views do
    for view, track in zip(judged.called[Mode.SINGLE], judged.called[Mode.TRACKS_POSES], strict=True):
        np.testing.assert_array_equal(view.is_background, track.is_background)
    boxes = {tuple(box) for match in single for box in match.found.xyxy.round(6)}
    assert {tuple(box) for match in judged.matches[Mode.TRACKS] for box in match.found.xyxy.round(6)} <= boxes
    drawn, seen = (sum(len(m.found) for m in judged.matches[mode]) for mode in (Mode.JUDGED_POSES, Mode.TRACKS_POSES))
    assert drawn > seen > 0  # into frames without a proposal too, and what is likeliest background with a low score
    for points in judged.points.values():
        assert len(points.found) == len(points.true) > 1000
    assert judged.points[Mode.TRACKS].by_run and not judged.points[Mode.GRAPH].by_run
    text = shape_context.describe([replace_level(judged, level) for level in ClutterLevel], thresholds([judged]))
    assert "| single view" in text and "| points, graph" in text and "medium" in text


def replace_level(judged: JudgedScene, level: ClutterLevel) -> JudgedScene:
    return replace(judged, job=replace(judged.job, scene=replace(judged.job.scene, clutter=level)))


def test_detections_on_file_are_those_of_the_detector(folder: Path) -> None:
    found = detect(SCENE, folder / "model.npz", folder, 5)
    detector = ShapeContextDetector(folder / "model.npz", confidence=0.0)
    recorded = RecordedDetections(found.file)
    sequence = open_sequence(scene_folder(SCENE, folder), stride=5)
    assert len(sequence) == 3 and found.milliseconds > 0.0
    recorded.check_against(sequence.names)
    for frame in sequence:
        fresh, kept = detector(frame), recorded(frame)
        np.testing.assert_allclose(kept.scores, fresh.scores)
        assert kept.mask is not None and fresh.mask is not None
        np.testing.assert_array_equal(kept.mask, fresh.mask)
        scored = detector.score(frame)
        assert len(fresh) == scored.looked_at.sum()


def match_of(class_id: list[int], scores: list[float], right: list[bool]) -> Matches:
    """Boxes of which some are exactly on one object each."""
    boxes = np.array([[20.0 * k, 0.0, 20.0 * k + 10.0, 10.0] for k in range(len(scores))])
    there = np.array(right)
    true, fair = boxes[there], np.ones(int(there.sum()), dtype=bool)
    objects = TrueBoxes(np.arange(len(true)), np.array(class_id)[there], true, true, fair * 1.0, fair)
    return match_boxes(found_boxes(boxes, np.array(class_id), np.array(scores), CAMERA), objects, 0.5)


def scene_of(matches: dict[Mode, Matches], called: Called | None = None) -> JudgedScene:
    of_single = {} if called is None else {Mode.SINGLE: [called]}
    several = {mode: [match] for mode, match in matches.items()}
    return JudgedScene(Job(SCENE, Path(), Path(), Path(), Path()), ("a", "b"), several, of_single, {}, 1.0)


def test_shares_are_those_above_the_threshold() -> None:
    match = match_of([0, 0, 1, 1], [0.9, 0.3, 0.8, 0.7], [True, True, True, False])
    judged = [scene_of({Mode.SINGLE: match}, Called(np.array([True, True, False]), np.array([0.1, 0.6, 0.2])))]
    assert thresholds(judged) == {Mode.SINGLE: 0.3}
    row = box_row(judged, Mode.SINGLE, 0.5)
    assert row.by_class == {"a": Share(1.0, 0.5), "b": Share(0.5, 1.0)}
    assert row.mean == Share(0.75, 0.75) and row.f1 == pytest.approx(0.75)
    assert row.background == Share(0.5, 0.5) and row.whole_mean == Share(2.0 / 3.0, 2.0 / 3.0)
    silent = box_row(judged, Mode.SINGLE, None)
    assert silent.by_class["a"] == Share(None, 0.0) and silent.mean == Share(0.0, 0.0)
    assert silent.background == Share(2.0 / 3.0, 1.0)


def test_judged_tracks_are_as_precise_as_single_views_and_some() -> None:
    single = match_of([0, 0], [0.9, 0.8], [False, True])  # precision 0.5
    claims = match_of([0] * 6, [0.9, 0.8, 0.7, 0.6, 0.5, 0.4], [True, True, False, False, True, False])
    found = thresholds([scene_of({Mode.SINGLE: single, Mode.JUDGED: claims})])
    assert found[Mode.SINGLE] == 0.8 and found[Mode.JUDGED] == 0.5  # 3 of 5; at 0.4 it is 3 of 6: no better by a margin
    ranked = scored([claims])
    assert threshold_at(ranked, 1.0) == 0.8 and threshold_at(ranked, 0.5) == 0.4
    never = match_of([0, 0], [0.9, 0.8], [False, False])
    assert threshold_at(scored([never]), 0.1) is None


def test_what_a_box_shows() -> None:
    boxes = np.array([[0.0, 0.0, 10.0, 10.0], [50.0, 0.0, 60.0, 10.0]])
    both, number = np.ones(2, dtype=bool), np.array([1, 0])  # the detector's first class is the truth's second
    true = TrueBoxes(np.arange(2), np.array([1, 2]), boxes - 0.5, boxes - 0.5, both * 1.0, both)
    proposals = np.concatenate([boxes, boxes[:1] + 7.0])
    assert shape_context_judge.shown(proposals, true, number).tolist() == [0, 2, 2]  # the truth's third is none of both
    nothing = TrueBoxes(np.empty(0, int), np.empty(0, int), boxes[:0], boxes[:0], np.empty(0), np.empty(0, bool))
    assert shape_context_judge.shown(boxes, nothing, number).tolist() == [2, 2]


def test_a_judge_is_learned_of_a_short_scene(folder: Path) -> None:
    detector = ShapeContextDetector(folder / "model.npz", confidence=0.0)
    known = shape_context_judge.known_tracks(Scene(Preset.TABLETOP, ClutterLevel.LOW, SEED, 6), detector)
    count = len(detector.classes)
    assert len(known.features) == len(known.label) == len(known.weight) > 5
    assert known.label.max() == count and known.label.min() < count and known.weight.max() == 1.0
    judge = shape_context_judge.fitted([known, known], detector.classes, ["one", "two"])
    assert judge.classes == detector.classes and "2 sequences (one, two" in judge.learned_from


def test_background_is_what_is_not_called_an_object() -> None:
    frames = [Called(np.array([True, False]), np.array([0.0, 0.9])), Called(np.array([True]), np.array([0.5]))]
    assert background_share(frames, 0.5) == Share(1.0, 0.5)
    assert background_share(frames, 0.6) == Share(1.0, 1.0)
    assert background_share(frames, 0.95) == Share(2.0 / 3.0, 1.0)


def test_verdicts_compare_recall_precision_and_the_graph() -> None:
    def row(precision: float, recall: float) -> Row:
        return Row({"a": Share(precision, recall)}, None)

    rows = {
        Mode.SINGLE: row(0.8, 0.6),
        Mode.TRACKS_POSES: row(0.9, 0.8),
        Mode.TRACKS: row(0.7, 0.9),
        Mode.JUDGED_POSES: row(0.81, 0.7),
        Mode.JUDGED: row(0.85, 0.75),
        Mode.GRAPH_POSES: row(0.9, 0.9),
        Mode.GRAPH: row(0.7, 0.8),
    }
    poses, own, judged_poses, judged, graph_poses, graph = verdicts(rows).split("\n")
    assert "judged tracks, true poses: recall +10.0" in judged_poses and "does NOT reach" in judged_poses
    assert "judged tracks: recall +15.0" in judged and ": reaches 15" in judged
    assert "+20.0" in poses and ": reaches 15" in poses
    assert "+10.0 points" in graph_poses and "at least as good" in graph_poses
    assert "+30.0" in own and "precision -10.0" in own and "does NOT reach" in own
    assert "-10.0 points" in graph and "NOT as good" in graph
    shown = result_table({"x": rows[Mode.SINGLE]})
    assert "80.0 / 60.0" in shown and "| -" in shown
    assert level_table({"low": rows, "high": rows}).count("90.0 / 80.0") == 2


def test_points_of_all_scenes_count_together(judged: JudgedScene) -> None:
    points = judged.points[Mode.GRAPH]
    perfect = replace(judged, points={Mode.GRAPH: replace(points, found=points.true)})
    row = point_row([perfect], Mode.GRAPH)
    assert row.mean == Share(1.0, 1.0) and row.background == Share(1.0, 1.0) and len(row.by_class) > 1
    both = point_row([perfect, judged], Mode.GRAPH)
    assert both.mean.recall is not None and both.mean.recall < 1.0


def test_variants_leave_out_one_part_each(folder: Path) -> None:
    given = shape_context_ablation.variants(VotingConfig())
    assert list(given) == [shape_context_ablation.FULL, *shape_context_ablation.WITHOUT]
    assert not given["without pruning"].prune and not given["without radius scaling"].scale_radius
    assert given["contexts of the image"] == replace(VotingConfig(), context=Context.IMAGE)
    matches = shape_context_ablation.judge_scene(shape_context_ablation.Job(SCENE, folder, folder / "model.npz", 10))
    assert set(matches) == set(given) and all(len(several) == 2 for several in matches.values())
    full = matches[shape_context_ablation.FULL][0]
    assert len(full.found) > 0 and len(np.unique(full.found.class_id)) > 1


def test_parts_that_help_are_told_from_those_that_do_not() -> None:
    good, bad = match_of([0, 0], [2.0, 1.0], [True, True]), match_of([0, 0], [2.0, 1.0], [False, True])
    matches = {name: [bad] for name in shape_context_ablation.WITHOUT} | {shape_context_ablation.FULL: [good]}
    text = shape_context_ablation.describe(matches, ("a", "b"))
    assert text.count("+50.0 points") == 3 and text.count("it helps") == 3
    matches["without pruning"] = [good]
    assert "equation (1): +0.0 points of mean AP; it does NOT help" in shape_context_ablation.describe(matches, ("a",))


def test_stages_are_timed_and_limits_named(folder: Path) -> None:
    model = shape_context_speed.of_classes(load_model(folder / "model.npz"), shape_context_speed.CLASSES)
    assert model.classes == shape_context_speed.CLASSES and len(model.codebooks) == 5
    with pytest.raises(UserError, match="zebra"):
        shape_context_speed.of_classes(model, ("zebra",))
    times: shape_context_speed.Times = {}
    frame = open_sequence(scene_folder(SCENE, folder))[0]
    assert shape_context_speed.time_stages(ShapeContextDetector(model), frame, times, 1) > 0
    first, *_, last = times
    assert (first, last) == (shape_context_speed.PROPOSALS, shape_context_speed.WHOLE)
    assert all(len(ms) == 1 and ms[0] >= 0.0 for ms in times.values())
    slow = times | {shape_context_speed.WHOLE: [501.0], shape_context_speed.PROPOSALS: [60.0]}
    text = shape_context_speed.describe(model, slow, (320, 240), 10.0)
    assert "501 ms, NOT within the limit of 500" in text and "60 ms, within the limit of 60" in text


@pytest.mark.parametrize(
    ("command", "wrong"),
    [
        (shape_context, ["--write", "--quick"]),
        (shape_context, ["--write", "--own-model"]),
        (shape_context, ["--jobs", "0"]),
        (shape_context_ablation, ["--write", "--quick"]),
        (shape_context_speed, ["--repeats", "0"]),
        (shape_context_model, []),
        (shape_context_model, ["--write", "--quick"]),
        (shape_context_model, ["--write", "--out", "x.npz"]),
    ],
)
def test_options_that_make_no_sense_are_refused(command, wrong: list[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        command.main(wrong)
    assert stopped.value.code == 2


def test_judged_scenes_are_held_out() -> None:
    assert all(scene.seed >= FIRST_SEED for scene in shape_context.held_out_scenes())
    chosen = {scene.seed for scene in shape_context.threshold_scenes()}
    assert max(chosen) < FIRST_SEED and max(shape_context_judge.SEEDS) < FIRST_SEED
    assert not chosen & set(shape_context_judge.SEEDS)
    assert {scene.clutter for scene in shape_context.held_out_scenes(quick=True)} == set(ClutterLevel)

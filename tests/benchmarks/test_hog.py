"""The HOG benchmarks: what they count is right, and all of it runs on one tiny scene."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import hog
import hog_model
import hog_real
import numpy as np
import pytest
from hog_job import Job, JudgedScene, Sights, boxes_of, judge_scene, part_of, scores_at
from hog_painted import PaintJob, around, background, paint_scene, painted, painted_table, seen_well
from hog_real_truth import KnownPoint, is_in_view, judge, known_in_frame, read_seen, shows
from hog_report import (
    OPPOSITE,
    halves_table,
    mean_precision,
    occlusion_table,
    part_table,
    precision_table,
    threshold_at,
    trend_lines,
)
from hypothesis import given
from hypothesis import strategies as st
from suite import FIRST_SEED, Scene
from suite_job import scene_folder

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.datasets.truth import TrueObject
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.hog.model import load_model, shipped_model
from thingmap.detectors.parts import part_box
from thingmap.mapper.evaluation.boxes.curves import Scored
from thingmap.mapper.evaluation.boxes.image_boxes import TrueBoxes, found_boxes
from thingmap.mapper.evaluation.boxes.matching import Matches, match_boxes

FRAMES, WIDTH, SEED = 6, 320, 5
CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)


def small(preset: Preset = Preset.TABLETOP, frames: int = FRAMES) -> SyntheticConfig:
    return SyntheticConfig(preset, objects=10, clutter=ClutterLevel.LOW, seed=SEED, frames=frames, width=WIDTH)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One small scene, by the name of the suite's scene and by that of its configuration."""
    folder = tmp_path_factory.mktemp("hog")
    write_sequence(SyntheticSequence(small()), folder / "scenes" / hog_model.scene_name(small()))
    return folder


@pytest.fixture(scope="module")
def models(folder: Path) -> dict[str, Path]:
    """One for each kind of channels, hardly trained."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hog_model, "scene_configs", lambda quick: iter([(small(), 1, 2)]))
        config = replace(hog_model.QUICK_CONFIG, views=6, held_out_views=3, cells=24, random_windows=5)
        patch.setattr(hog_model, "QUICK_CONFIG", config)
        table = replace(hog_model.TURNTABLE, elevations=(20.0,), distances=(1.0,), azimuths=2)
        patch.setattr(hog_model, "TURNTABLE", table)
        return {name: hog_model.train_model(folder, kind, quick=True) for kind, name in hog.MODELS.items()}


@pytest.fixture(scope="module")
def judged(folder: Path, models: dict[str, Path]) -> JudgedScene:
    return judge_scene(Job(SCENE, 2, models["RGB-D"], folder, True))


SCENE = Scene(Preset.TABLETOP, ClutterLevel.LOW, SEED, FRAMES)


def test_training_scenes_have_all_levels_of_clutter_and_no_seed_of_a_benchmark() -> None:
    configs = [config for config, _, _ in hog_model.scene_configs()]
    assert {config.preset for config in configs} == {Preset.TABLETOP, Preset.SURVEY, Preset.KITCHEN}
    assert all(0 < config.seed < FIRST_SEED for config in configs)
    assert {config.clutter for config in configs} == set(ClutterLevel)
    names = [hog_model.scene_name(config) for config in configs]
    assert len(names) == len(set(names))
    assert all(scene.seed >= FIRST_SEED for scene, _ in hog._scenes(False, FIRST_SEED))


def test_models_of_a_class_differ_and_are_the_same_every_time() -> None:
    first, again = list(hog_model.models(2)), list(hog_model.models(2))
    assert [model.label for model in first] == [label for label in CLASSES for _ in range(2)]
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.size, other.size)
    assert all(not np.array_equal(first[k].size, first[k + 1].size) for k in range(0, len(first), 2))


def test_a_model_knows_the_classes_and_its_sources(models: dict[str, Path]) -> None:
    for kind, name in hog.MODELS.items():
        model = load_model(models[name])
        assert (model.channels, set(model.classes)) == (kind, set(CLASSES))
        assert model.about["settings"]["sources"] == ["tabletop-low-5-6", "3 models of each class on a turntable"]
    assert not list(models["RGB"].parent.glob("*.part"))


def test_a_scene_is_judged_frame_by_frame(judged: JudgedScene) -> None:
    assert set(judged.matches) == set(Part)
    assert all([match.frame for match in several] == [0, 2, 4] for several in judged.matches.values())
    assert judged.sights is not None and judged.milliseconds > 0.0
    assert len(judged.sights.score) > 5
    for values in (judged.sights.occlusion, judged.sights.found, judged.sights.score):
        assert values.shape == (len(judged.sights.score), 5) and (values >= 0.0).all() and (values <= 1.0).all()
    assert np.ptp(judged.sights.score) > 0.0
    hits = sum(int((match.outcome == 1).sum()) for match in judged.matches[Part.WHOLE])
    assert (judged.sights.found[:, Part.WHOLE] > 0.0).sum() >= hits * 0.5  # objects at the image's edge are left out


def test_a_model_of_other_classes_is_refused(folder: Path, models: dict[str, Path], tmp_path: Path) -> None:
    whole = load_model(models["RGB"])
    only = replace(whole, classes=("cup", *whole.classes[1:]))
    only.save(tmp_path / "other.npz")
    with pytest.raises(UserError, match="lacks"):
        judge_scene(Job(SCENE, 2, tmp_path / "other.npz", folder, False))


def test_halves_are_judged_by_halves(folder: Path) -> None:
    truth = open_truth(scene_folder(SCENE, folder))
    assert truth.frame_truth is not None and truth.intrinsics is not None
    seen = truth.frame_truth(0)
    assert seen is not None
    whole, left = (part_of(seen, truth, part, 0.25) for part in (Part.WHOLE, Part.LEFT))
    np.testing.assert_array_equal(whole.object_id, left.object_id)
    inside = (whole.whole[:, 0] > 0) & (whole.whole[:, 2] < truth.intrinsics.width - 1)
    np.testing.assert_allclose(left.whole[inside], part_box(whole.whole[inside], Part.LEFT))
    assert np.isnan(left.visible).all()
    # Exact boxes of left halves, in a model's own order of classes, all find their halves; they are no wholes.
    classes = tuple(reversed(truth.classes))
    class_id = [classes.index(truth.classes[k]) for k in left.class_id[left.fair]]
    exact = Detections.from_best_class(classes, left.whole[left.fair] + 0.5, class_id, np.full(left.fair.sum(), 0.9))
    exact = replace(exact, part=np.full(len(exact), Part.LEFT))
    match = match_boxes(boxes_of(exact, truth, Part.LEFT), left, 0.5)
    assert (match.outcome == 1).all() and len(match.outcome) == left.fair.sum() > 3
    assert len(boxes_of(exact, truth, Part.WHOLE)) == 0


def test_scores_are_asked_for_at_the_object(folder: Path, models: dict[str, Path]) -> None:
    truth, model = open_truth(scene_folder(SCENE, folder)), load_model(models["RGB"])
    assert truth.sequence is not None
    frame = truth.sequence[0]
    box = np.array([[100.0, 80.0, 150.0, 130.0]])
    both = scores_at(np.concatenate([box, box + 60.0]), np.array([0, 1]), frame, model)
    np.testing.assert_allclose(scores_at(box, np.array([0]), frame, model), both[:1])
    assert not np.allclose(scores_at(box, np.array([1]), frame, model), both[:1])
    assert scores_at(np.zeros((0, 4)), np.zeros(0, dtype=np.int64), frame, model).shape == (0, 5)


def noise_frame(seed: int) -> Frame:
    rng = np.random.default_rng(seed)
    color = rng.integers(0, 256, (60, 80, 3), dtype=np.uint8)
    depth = rng.uniform(0.8, 3.0, (60, 80)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = 0.0  # no reading
    return Frame(0, "0", 0.0, color, depth, Intrinsics(80, 60, 70.0, 70.0, 39.5, 29.5), np.eye(4))


def pixels_in(box: np.ndarray) -> np.ndarray:
    """(60, 80) bool: the pixels whose centres are in a box, or on its upper or left edge."""
    y, x = np.mgrid[:60, :80] + 0.5
    return (x >= box[0]) & (x < box[2]) & (y >= box[1]) & (y < box[3])


@given(
    corner=st.tuples(st.floats(0.0, 40.0), st.floats(0.0, 30.0)),
    size=st.tuples(st.floats(4.0, 40.0), st.floats(4.0, 30.0)),
    half=st.sampled_from(list(OPPOSITE)),
    share=st.floats(0.0, 1.0),
    seed=st.integers(0, 100),
)
def test_one_half_is_painted_over_and_nothing_else(corner, size, half: Part, share: float, seed: int) -> None:
    frame, box = noise_frame(seed), np.array([*corner, corner[0] + size[0], corner[1] + size[1]])
    patch = background(frame, box, np.zeros((0, 4)), np.random.default_rng(seed))
    after = painted(frame, box, half, share, patch)
    opposite, own = pixels_in(part_box(box, half)), pixels_in(part_box(box, OPPOSITE[half]))
    changed = after.depth != frame.depth
    assert not (changed & own).any() and not (changed & ~pixels_in(box)).any()
    np.testing.assert_array_equal(after.color[~changed], frame.color[~changed])
    inside = frame.depth[pixels_in(box)]
    assert (after.depth[changed] < inside[inside > 0.0].min()).all() and (after.depth[changed] > 0.0).all()
    # A strip from the far side on, whole lines of pixels, as many as the share says.
    axis = 0 if half in (Part.LEFT, Part.RIGHT) else 1
    lines, side = np.flatnonzero(changed.any(axis=axis)), np.flatnonzero(opposite.any(axis=axis))
    assert abs(len(lines) - share * len(side)) <= 0.5
    first = 0 if half in (Part.LEFT, Part.TOP) else len(side) - len(lines)
    np.testing.assert_array_equal(lines, side[first : first + len(lines)])
    assert changed.sum() * len(side) == opposite.sum() * len(lines)


def test_all_of_a_half_is_painted_with_the_patch() -> None:
    frame, box = noise_frame(0), np.array([10.0, 10.0, 30.0, 26.0])
    patch = np.full((16, 20, 3), 7, dtype=np.uint8)
    for half in OPPOSITE:
        after = painted(frame, box, half, 1.0, patch)
        there = pixels_in(part_box(box, half))
        assert there.sum() == 160 and (after.color[there] == 7).all() and np.ptp(after.depth[there]) == 0.0
    blind = replace(frame, depth=np.zeros_like(frame.depth))
    np.testing.assert_array_equal(painted(blind, box, Part.TOP, 1.0, patch).depth, blind.depth)


def test_background_shows_no_object_where_there_is_room() -> None:
    frame, box = noise_frame(0), np.array([10.0, 10.0, 30.0, 26.0])
    objects = np.array([box, [0.0, 30.0, 80.0, 60.0], [0.0, 0.0, 50.0, 30.0]])
    colors = frame.color.copy()
    colors[:] = 0
    colors[:30, 50:] = 9
    for seed in range(5):
        patch = background(replace(frame, color=colors), box, objects, np.random.default_rng(seed))
        assert patch.shape == (16, 20, 3) and (patch == 9).mean() > 0.6


def test_what_is_around_an_object_is_looked_at_like_the_image(folder: Path, models: dict[str, Path]) -> None:
    truth, model = open_truth(scene_folder(SCENE, folder)), load_model(models["RGB-D"])
    assert truth.sequence is not None
    there = seen_well(truth, 2)
    assert len(there) > 3 and {sitter.frame for sitter in there} <= {0, 2, 4}
    apart = []
    for sitter in there[:6]:
        frame = truth.sequence[sitter.frame]
        cut, corner = around(frame, sitter.box)
        x, y = corner
        height, width = cut.depth.shape
        np.testing.assert_array_equal(cut.color, frame.color[y : y + height, x : x + width])
        assert (cut.intrinsics.width, cut.intrinsics.height) == (width, height)
        point = np.array([[0.1, -0.1, 2.0]])
        np.testing.assert_allclose(cut.intrinsics.project(point) + corner, frame.intrinsics.project(point))
        class_id = np.array([model.classes.index(sitter.label)])
        whole = scores_at(sitter.box[None], class_id, frame, model)
        apart.append(scores_at(sitter.box[None] - np.tile(corner, 2), class_id, cut, model) - whole)
    assert np.abs(apart).mean() < 0.15  # the grids of cells differ


def test_halves_of_a_scene_are_painted_over(folder: Path, models: dict[str, Path]) -> None:
    job = PaintJob(SCENE, 2, models["RGB-D"], folder, 3)
    scores = paint_scene(job)
    assert scores.shape == (3, 4, 5, 5) and (scores >= 0.0).all() and (scores <= 1.0).all()
    np.testing.assert_array_equal(scores, paint_scene(job))
    np.testing.assert_array_equal(scores[:, 1:, 0], scores[:, :1, 0].repeat(3, axis=1))
    for row, half in enumerate(OPPOSITE):
        own = np.abs(scores[:, row, 1, half] - scores[:, row, 0, half]).mean()
        other = np.abs(scores[:, row, 1, OPPOSITE[half]] - scores[:, row, 0, OPPOSITE[half]]).mean()
        assert own > other  # a quarter of the half, on the far side of what the other template looks at
    assert paint_scene(replace(job, most=0)).shape == (0, 4, 5, 5)


def test_the_table_of_painted_halves_tells_templates_apart() -> None:
    scores = np.full((2, 4, 5, 5), 0.5)
    scores[..., Part.WHOLE] = 0.9
    for row, half in enumerate(OPPOSITE):
        scores[:, row, 4, half], scores[:, row, 4, OPPOSITE[half]] = 0.1, 0.4
    shown = {row[1]: row[2:6] for row in cells(painted_table([scores[:1], scores[1:]]))}
    assert shown["0 %"] == shown["75 %"] == ["8", "0.50", "0.50", "0.90"]
    assert shown["100 %"] == ["8", "0.10", "0.40", "0.90"]
    assert "No object" in painted_table([scores[:0]])


def match_of(class_id: list[int], scores: list[float], right: list[bool]) -> Matches:
    """Boxes of which some are exactly on one object each."""
    boxes = np.array([[20.0 * k, 0.0, 20.0 * k + 10.0, 10.0] for k in range(len(scores))])
    there = np.array(right)
    true = boxes[there]
    visible = np.ones(len(true))
    thing = TrueBoxes(
        np.arange(len(true)), np.array(class_id)[there], true, true, visible, np.ones(len(true), dtype=bool)
    )
    return match_boxes(found_boxes(boxes, np.array(class_id), np.array(scores), CAMERA), thing, 0.5)


def scene_of(match: Matches, sights: Sights | None = None) -> JudgedScene:
    job = Job(SCENE, 1, Path("m.npz"), Path(), False)
    return JudgedScene(job, {part: [match] for part in Part}, sights, 10.0)


def test_mean_precision_is_that_of_the_classes_there_are() -> None:
    perfect, half = match_of([0, 0], [0.9, 0.8], [True, True]), match_of([1, 1], [0.9, 0.8], [False, True])
    assert mean_precision([perfect], ("a", "b", "c")) == 1.0
    assert mean_precision([perfect, half], ("a", "b", "c")) == pytest.approx(0.75)
    assert mean_precision([], ("a",)) is None
    groups = {"one": {"RGB": [scene_of(half)], "RGB-D": [scene_of(perfect)]}}
    shown = precision_table(groups, ("a", "b"))
    assert "| **1.000**" in shown and "| one    | a        | 0 " in shown
    assert part_table(groups, "RGB-D", ("a", "b")).count("1.000") == 5


def test_the_threshold_lets_so_many_false_boxes_through() -> None:
    claims = Scored(np.array([0.9, 0.8, 0.7, 0.6, 0.5]), np.array([True, False, False, True, False]), 2, 2)
    assert threshold_at(claims, 0.5) == 0.8
    assert threshold_at(claims, 1.0) == 0.6
    assert threshold_at(claims, 0.0) == 0.9
    assert threshold_at(replace(claims, right=np.zeros(5, dtype=bool)), 0.0) == np.inf


def test_tables_tell_what_occlusion_does() -> None:
    count = 30  # of objects that are seen, and of those whose left half is hidden
    occlusion = np.zeros((2 * count, 5))
    occlusion[count:, [Part.WHOLE, Part.TOP, Part.BOTTOM]] = 0.5
    occlusion[count:, Part.LEFT] = 0.95
    score = np.full((2 * count, 5), 0.8)
    score[count:] = (0.3, 0.2, 0.2, 0.05, 0.8)
    sights = Sights(occlusion, np.where(score > 0.5, score, 0.0), score)
    judged = [scene_of(match_of([0, 0], [0.7, 0.4], [False, False]), sights)]
    halves = {row[1]: row[2:6] for row in cells(halves_table(judged))}
    assert halves["0 to 10 %"] == ["120", "0.80", "0.80", "0.80"]
    assert halves["90 to 100 %"] == ["30", "0.05", "0.80", "0.30"]
    assert halves["30 to 50 %"] == ["0", "-", "-", "-"]
    trend = trend_lines(judged)
    assert "scores 0.80 and is NOT best" in trend and "keeps 100 %" in trend and "which keeps 38 %" in trend
    assert "no verdict" in trend_lines([scene_of(match_of([0], [0.5], [True]))])
    whole = {row[1]: row[2:13] for row in cells(occlusion_table(judged))}
    assert whole["0 to 10 %"] == ["30", *["1.00"] * 5, *["0.80"] * 5]
    assert whole["50 to 70 %"] == ["30", "0.00", "0.00", "0.00", "0.00", "1.00", "0.30", "0.20", "0.20", "0.05", "0.80"]


def test_all_of_it_runs_and_says_whether_the_aim_is_reached(
    folder: Path, models: dict[str, Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(hog, "LEVELS", (ClutterLevel.LOW,))
    monkeypatch.setattr(hog, "QUICK_SCENES", ((Preset.TABLETOP, FRAMES, 1, 3),))
    shipped = shipped_model().read_bytes() if shipped_model().is_file() else None
    arguments = ["--quick", "--folder", str(folder), "--first-seed", str(SEED), "--jobs", "1"]
    assert hog.main(arguments) == 0
    shown = capsys.readouterr().out
    assert shown.count("## HOG detector: ") == 2 and "- tabletop, low: " in shown
    assert "RGB-D is" in shown and "0.70." in shown
    assert [row[2] for row in cells(shown) if row[1:2] == ["75 %"]] == [str(4 * hog.QUICK_PAINTED)]
    assert shipped == (shipped_model().read_bytes() if shipped_model().is_file() else None)


@pytest.mark.parametrize(
    ("command", "wrong"),
    [
        (hog, ["--write", "--quick"]),
        (hog, ["--write", "--first-seed", "3"]),
        (hog, ["--jobs", "0"]),
        (hog_model, []),
        (hog_model, ["--write", "--quick"]),
        (hog_model, ["--write", "--channels", "rgb"]),
        (hog_model, ["--write", "--out", "x.npz"]),
        (hog_real, []),
    ],
)
def test_options_that_make_no_sense_are_refused(command, wrong: list[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        command.main(wrong)
    assert stopped.value.code == 2


def found(*boxes: tuple[str, float, list[float]], part: Part = Part.WHOLE) -> Detections:
    classes = hog_real.CLASSES
    xyxy = [box for *_, box in boxes]
    ids = [classes.index(label) for label, *_ in boxes]
    one = Detections.from_best_class(classes, xyxy, ids, [score for _, score, _ in boxes])
    return replace(one, part=np.full(len(one), part))


def test_boxes_count_once_and_by_class_place_and_size() -> None:
    mug = KnownPoint("coffee mug", np.array([100.0, 100.0]), 20.0, 40.0)
    on = [80.0, 80.0, 120.0, 120.0]
    assert shows(np.array(on), "coffee mug", mug) and not shows(np.array(on), "bowl", mug)
    assert not shows(np.array(on) + 30.0, "coffee mug", mug)
    assert not shows(np.array([0.0, 0.0, 200.0, 200.0]), "coffee mug", mug)
    assert shows(np.array([0.0, 0.0, 200.0, 200.0]), "coffee mug", replace_known(mug))
    boxes = found(("coffee mug", 0.9, on), ("coffee mug", 0.8, on), ("bowl", 0.7, on), ("bowl", 0.2, on))
    verdict = judge([boxes, found(("cap", 0.9, on), part=Part.TOP)], [[mug], [mug]], 0.5, hog_real.CLASSES)
    assert (verdict.images, verdict.known, verdict.hits) == (2, 2, 1)
    assert {label: count for label, count in verdict.false.items() if count} == {"coffee mug": 1, "bowl": 1}


def replace_known(point: KnownPoint) -> KnownPoint:
    """As somebody would name it by looking: no distance, no size."""
    return KnownPoint(point.label, point.xy)


def test_a_known_object_is_asked_for_where_it_can_be_seen() -> None:
    thing = TrueObject(0, "cup", np.array([0.1, 0.0, 2.0]), np.full(3, np.nan), 0.0)
    truth = GroundTruth("kitchen", ("cup",), (thing,), tolerance={0: 0.08})
    depth = np.full((480, 640), 2.0, dtype=np.float32)
    frame = Frame(0, "0", 0.0, np.zeros((480, 640, 3), dtype=np.uint8), depth, CAMERA, np.eye(4))
    (point,) = known_in_frame(frame, truth, hog_real.CLASSES)
    assert point.label == "coffee mug" and point.reach == pytest.approx(20.0) and point.side == pytest.approx(25.0)
    np.testing.assert_allclose(point.xy, [344.5, 239.5])
    assert known_in_frame(frame, truth, ("bowl",)) == []
    assert known_in_frame(replace(frame, depth=depth - 0.5), truth, hog_real.CLASSES) == []
    assert len(known_in_frame(replace(frame, depth=depth * 0.0), truth, hog_real.CLASSES)) == 1
    away = np.diag([-1.0, 1.0, -1.0, 1.0])
    assert known_in_frame(replace(frame, T_world_camera=away), truth, hog_real.CLASSES) == []
    assert is_in_view(np.eye(4), CAMERA, truth, hog_real.CLASSES)
    assert not is_in_view(away, CAMERA, truth, hog_real.CLASSES)
    assert not is_in_view(np.eye(4), CAMERA, truth, ("bowl",))


def test_what_somebody_saw_is_read(tmp_path: Path) -> None:
    file = tmp_path / "seen.json"
    file.write_text(json.dumps({"scene_02": {"mug": [[10, 20]], "bowl": []}, "scene_05": {}}))
    seen = read_seen(file)
    assert [point.label for point in seen["scene_02"]] == ["coffee mug"] and seen["scene_05"] == []
    file.write_text('{"scene_02": [1, 2]}')
    with pytest.raises(InputError):
        read_seen(file)
    with pytest.raises(InputError):
        read_seen(tmp_path / "none.json")


def test_only_known_classes_are_learned_from_real_objects(
    real_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hog_real, "ROOMS", ())
    views, backgrounds = hog_real.material(real_data, tmp_path)
    assert set(views.labels) == set(hog_real.CLASSES)
    box = next(entry for entry in views.entries if "cracker" in entry.instance)
    assert entry_label(box) == "cereal box"
    kitchen = [int(name.split("-")[-1]) for name in backgrounds.names if name.startswith("redkitchen")]
    assert len(kitchen) > 5 and not any(number % hog_real.STEP == 0 for number in kitchen)


def entry_label(entry) -> str:
    assert entry.label == entry.read().label
    return entry.label


def cells(table: str) -> list[list[str]]:
    """Of every line of a Markdown table; the first and the last are empty."""
    return [[cell.strip() for cell in line.split("|")] for line in table.split("\n")]

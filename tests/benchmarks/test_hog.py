"""The HOG benchmark: what it judges is right, and all of it runs on one tiny scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import hog
import hog_model
import hog_real
import numpy as np
import pytest
from hog_job import Job, JudgedScene, boxes_of, judge_scene, part_of, scores_at
from suite import FIRST_SEED
from suite_job import scene_folder
from tiny_hog import FRAMES, SCENE, SEED, cells

from thingmap.datasets.errors import UserError
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.hog.model import load_model, shipped_model
from thingmap.detectors.parts import part_box
from thingmap.mapper.evaluation.boxes.matching import match_boxes


@pytest.fixture(scope="module")
def judged(hog_folder: Path, hog_models: dict[str, Path]) -> JudgedScene:
    return judge_scene(Job(SCENE, 2, hog_models["RGB-D"], hog_folder, True))


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


def test_a_model_knows_the_classes_and_its_sources(hog_models: dict[str, Path]) -> None:
    for kind, name in hog.MODELS.items():
        model = load_model(hog_models[name])
        assert (model.channels, set(model.classes)) == (kind, set(CLASSES))
        assert model.about["settings"]["sources"] == ["tabletop-low-5-6", "3 models of each class on a turntable"]
    assert not list(hog_models["RGB"].parent.glob("*.part"))


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


def test_a_model_of_other_classes_is_refused(hog_folder: Path, hog_models: dict[str, Path], tmp_path: Path) -> None:
    whole = load_model(hog_models["RGB"])
    only = replace(whole, classes=("cup", *whole.classes[1:]))
    only.save(tmp_path / "other.npz")
    with pytest.raises(UserError, match="lacks"):
        judge_scene(Job(SCENE, 2, tmp_path / "other.npz", hog_folder, False))


def test_halves_are_judged_by_halves(hog_folder: Path) -> None:
    truth = open_truth(scene_folder(SCENE, hog_folder))
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


def test_scores_are_asked_for_at_the_object(hog_folder: Path, hog_models: dict[str, Path]) -> None:
    truth, model = open_truth(scene_folder(SCENE, hog_folder)), load_model(hog_models["RGB"])
    assert truth.sequence is not None
    frame = truth.sequence[0]
    box = np.array([[100.0, 80.0, 150.0, 130.0]])
    both = scores_at(np.concatenate([box, box + 60.0]), np.array([0, 1]), frame, model)
    np.testing.assert_allclose(scores_at(box, np.array([0]), frame, model), both[:1])
    assert not np.allclose(scores_at(box, np.array([1]), frame, model), both[:1])
    assert scores_at(np.zeros((0, 4)), np.zeros(0, dtype=np.int64), frame, model).shape == (0, 5)


def test_all_of_it_runs_and_says_whether_the_aim_is_reached(
    hog_folder: Path, hog_models: dict[str, Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(hog, "LEVELS", (ClutterLevel.LOW,))
    monkeypatch.setattr(hog, "QUICK_SCENES", ((Preset.TABLETOP, FRAMES, 1, 3),))
    shipped = shipped_model().read_bytes() if shipped_model().is_file() else None
    arguments = ["--quick", "--folder", str(hog_folder), "--first-seed", str(SEED), "--jobs", "1"]
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

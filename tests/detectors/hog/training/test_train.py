from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.boxes import box_ious
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.model import HogModel
from thingmap.detectors.hog.training.train import train


def assert_same(a: HogModel, b: HogModel) -> None:
    assert a.classes == b.classes and a.about == b.about
    for one, other in zip(a.templates, b.templates, strict=True):
        np.testing.assert_array_equal(one.weights, other.weights)
        assert (one.bias, one.scale_weight, one.platt, one.box) == (
            other.bias,
            other.scale_weight,
            other.platt,
            other.box,
        )


@pytest.fixture(scope="module")
def model(make_views, make_backgrounds, small) -> HogModel:
    return train(make_views(), make_backgrounds(), small, sources=("cards", "walls"))


def test_five_templates_a_class(model):
    assert model.classes == ("cross", "disc")
    assert [(t.class_id, t.part) for t in model.templates] == [(c, part) for c in (0, 1) for part in Part]
    whole, top, _, left, _ = (t.weights.shape[:2] for t in model.templates[:5])
    assert top == (whole[0] // 2, whole[1]) and left == (whole[0], whole[1] // 2)
    assert all(t.platt[0] < 0.0 for t in model.templates)


def test_what_it_is_made_from_is_told(model):
    settings = model.about["settings"]
    assert settings["sources"] == ["cards", "walls"] and settings["seed"] == 0
    disc = settings["counts"]["classes"]["disc"]
    assert disc["views"] == 8 and disc["positives"] == 16 and disc["instances_held_out"] == 1
    assert 0 < model.about["negatives"]["disc"]["whole"] <= 150


def test_the_two_best_boxes_are_the_two_objects(model, make_frame_with):
    detector = HogDetector(model, parts=False)
    right = 0
    for seed in range(500, 510):
        scene = make_frame_with(seed, "disc", "cross")
        height, width = scene.color.shape[:2]
        camera = Intrinsics(width, height, scene.focal, scene.focal, width / 2, height / 2)
        found = detector(Frame(0, scene.name, 0.0, scene.color, scene.depth, camera)).select(slice(0, 2))
        overlap = box_ious(found.xyxy, scene.xyxy)
        same = np.array(found.classes)[found.class_id][:, None] == np.array(scene.labels)[None]
        right += int(((overlap >= 0.5) & same).any(axis=0).sum())
    assert right >= 17, right  # of 20


def test_the_number_of_workers_and_the_room_for_images_change_nothing(model, make_views, make_backgrounds, small):
    other = train(make_views(), make_backgrounds(), replace(small, workers=1, memory=1_000), sources=("cards", "walls"))
    assert_same(model, other)


def test_another_seed_gives_another_model(model, make_views, make_backgrounds, small):
    other = train(make_views(), make_backgrounds(), replace(small, seed=1), sources=("cards", "walls"))
    assert not np.array_equal(model.templates[0].weights, other.templates[0].weights)


def stop_in(stage: str):
    def on_progress(now: str, done: int, total: int) -> None:
        if now == stage and done == total // 2:
            raise KeyboardInterrupt

    return on_progress


def test_an_interrupted_training_goes_on_to_the_same_model(model, make_views, make_backgrounds, small, tmp_path: Path):
    path = tmp_path / "model.npz.part"
    with pytest.raises(KeyboardInterrupt):
        train(make_views(), make_backgrounds(), small, stop_in("round 2: mining"), path, ("cards", "walls"))
    assert path.exists()
    stages: list[str] = []
    again = train(make_views(), make_backgrounds(), small, lambda *now: stages.append(now[0]), path, ("cards", "walls"))
    assert "round 1: mining" not in stages and "round 2: mining" in stages
    assert_same(model, again)
    at_the_end = train(make_views(), make_backgrounds(), small, checkpoint=path, sources=("cards", "walls"))
    assert_same(model, at_the_end)


def test_the_checkpoint_of_another_training_is_refused(make_views, make_backgrounds, small, tmp_path: Path):
    path = tmp_path / "model.npz.part"
    train(make_views(), make_backgrounds(), replace(small, rounds=1), checkpoint=path)
    with pytest.raises(InputError, match=r"another training \(rounds, seed differ\).*remove it"):
        train(make_views(), make_backgrounds(), replace(small, rounds=2, seed=4), checkpoint=path)
    path.write_bytes(b"PK nothing")
    with pytest.raises(InputError, match="the checkpoint of this training"):
        train(make_views(), make_backgrounds(), small, checkpoint=path)


def test_a_round_without_anything_new_ends_a_template(make_views, make_backgrounds, small):
    stages: dict[str, int] = {}
    config = replace(small, rounds=40, cost=1.0, cache=5000)
    model = train(make_views(), make_backgrounds(), config, lambda *now: stages.update({now[0]: now[2]}))
    fitted = [total for stage, total in stages.items() if stage.endswith(": learning")]
    assert fitted[0] == 10 and fitted[-1] < 10
    assert model.about["rounds_done"] < 40


def test_colour_alone_needs_no_depth(make_views, make_backgrounds, small):
    rgb = replace(small, channels=Channels.RGB, rounds=1)
    model = train(make_views(depth=False), make_backgrounds(depth=False), rgb)
    assert model.channels is Channels.RGB and model.templates[0].weights.shape[2] == 31
    for views, backgrounds in (
        (make_views(depth=False), make_backgrounds()),
        (make_views(), make_backgrounds(depth=False)),
    ):
        with pytest.raises(UserError, match="--channels rgb"):
            train(views, backgrounds, small)


def test_broken_frames_and_views_are_counted_and_left_out(make_views, make_backgrounds, small):
    backgrounds = make_backgrounds(broken=(2, 9))
    train(make_views(), backgrounds, replace(small, rounds=1))
    assert backgrounds.skipped == {"wall 2": "torn", "wall 9": "torn"}
    with pytest.raises(UserError, match="no frame of the backgrounds"):
        train(make_views(), make_backgrounds(4, broken=(0, 1, 2, 3)), small)


def test_one_view_and_one_frame_are_enough_to_run(make_views, make_backgrounds, small):
    model = train(make_views(1, ("disc",)), make_backgrounds(1), small)
    assert model.classes == ("disc",) and model.about["settings"]["counts"]["frames"] == 1


def test_objects_of_a_size_that_is_never_searched_are_a_mistake(make_views, make_backgrounds, small):
    with pytest.raises(UserError, match="no view of 'cross' has a size at which it could be found"):
        train(make_views(), make_backgrounds(), replace(small, cells=200))

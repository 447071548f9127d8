from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.object_views.object_view import ObjectViews
from thingmap.detectors.boxes import box_ious
from thingmap.detectors.shape_context.calibration import FEATURES
from thingmap.detectors.shape_context.detector import ShapeContextDetector
from thingmap.detectors.shape_context.model import ShapeContextModel
from thingmap.detectors.shape_context.training.radius import TIE
from thingmap.detectors.shape_context.training.train import train

SOURCES = ("cards", "walls")


@pytest.fixture(scope="module")
def model(make_views, make_backgrounds, small) -> ShapeContextModel:
    return train(make_views(), make_backgrounds(), small, sources=SOURCES)


def saved(model: ShapeContextModel, folder: Path) -> bytes:
    model.save(folder / "saved.npz")
    return (folder / "saved.npz").read_bytes()


def test_discs_and_crosses_are_told_apart_and_triangles_are_neither(model, make_frame_with, as_frame):
    detector = ShapeContextDetector(model, confidence=0.5)
    right = wrong = 0
    for seed in range(500, 510):
        scene = make_frame_with(seed, "disc", "cross", "triangle")
        found = detector(as_frame(scene))
        same = np.array(found.classes)[found.class_id][:, None] == np.array(scene.labels)[None]
        hit = (box_ious(found.xyxy, scene.xyxy) >= 0.5) & same
        right, wrong = right + int(hit.any(axis=0).sum()), wrong + int((~hit.any(axis=1)).sum())
    assert right >= 19 and wrong <= 2, (right, wrong)  # of 20, and of 10 triangles


def test_what_it_is_made_from_is_told(model):
    settings, disc = model.about["settings"], model.about["classes"]["disc"]
    assert settings["sources"] == list(SOURCES) and settings["seed"] == 0 and "memory" not in settings
    assert (disc["views"], disc["held_out_views"], disc["instances_held_out"], disc["entries"]) == (8, 2, 1, 200)
    assert list(disc["separation"]) == ["0.05", "0.1", "0.2"] and model.about["radius"] in (0.05, 0.1, 0.2)
    calibration = model.about["calibration"]
    assert calibration["background_is"] == "proposals of frames"
    assert calibration["objects"] == {"cross": 6, "disc": 6} and calibration["background"] >= 7


def test_the_radius_is_the_one_that_separates_best_on_average(model):
    rows = [model.about["classes"][label]["separation"] for label in model.classes]
    means = {radius: np.mean([row[radius] for row in rows]) for radius in rows[0]}
    assert means[f"{model.about['radius']:g}"] == pytest.approx(max(means.values()), abs=TIE + 1e-4)
    assert {book.radius for book in model.codebooks} == set(model.rivals) == {model.about["radius"]}
    assert model.about["rivals"] == {f"{radius:g}": len(bins) for radius, bins in model.rivals.items()}


def test_the_same_input_gives_the_same_bytes_whatever_memory_there_is(
    model, make_views, make_backgrounds, small, tmp_path: Path
):
    again = train(make_views(), make_backgrounds(), replace(small, memory=1_000), sources=SOURCES)
    assert saved(again, tmp_path) == saved(model, tmp_path)


def test_an_interrupted_training_goes_on_to_the_same_model(model, make_views, make_backgrounds, small, tmp_path: Path):
    path = tmp_path / "model.npz.part"

    def stop_in_the_second_class(stage: str, done: int, total: int) -> None:
        if stage == "disc: radius":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(make_views(), make_backgrounds(), small, stop_in_the_second_class, path, SOURCES)
    stages: list[str] = []
    again = train(make_views(), make_backgrounds(), small, lambda *now: stages.append(now[0]), path, SOURCES)
    assert "cross: radius" not in stages and "disc: radius" in stages
    assert saved(again, tmp_path) == saved(model, tmp_path)
    at_the_end = train(make_views(), make_backgrounds(), small, checkpoint=path, sources=SOURCES)
    assert saved(at_the_end, tmp_path) == saved(model, tmp_path)


def test_the_checkpoint_of_another_training_is_refused(make_views, make_backgrounds, small, tmp_path: Path):
    path = tmp_path / "model.npz.part"
    train(make_views(), make_backgrounds(), small, checkpoint=path)
    with pytest.raises(InputError, match=r"another training \(entries, names, seed differ\).*remove it"):
        train(make_views(8), make_backgrounds(), replace(small, entries=9, seed=4), checkpoint=path)
    path.write_bytes(b"PK nothing")
    with pytest.raises(InputError, match="the checkpoint of this training"):
        train(make_views(), make_backgrounds(), small, checkpoint=path)


def test_without_backgrounds_other_classes_stand_for_them(make_views, make_backgrounds, small):
    model = train(make_views(), make_backgrounds(0), small)
    assert model.about["calibration"] == {
        "objects": {"cross": 2, "disc": 2},
        "background": 4,
        "background_is": "objects of other classes",
    }
    assert not model.rivals and (model.calibration.weights[:, FEATURES.index("contour")] == 0.0).all()


def test_frames_that_show_nothing_are_as_good_as_none(make_views, make_backgrounds, small):
    model = train(make_views(), make_backgrounds(3, things=()), small)
    assert model.about["calibration"]["background_is"] == "objects of other classes"


def test_one_class_is_told_from_the_background(make_views, make_backgrounds, small):
    model = train(make_views(6, ("disc",)), make_backgrounds(4), small)
    assert model.classes == ("disc",) and model.about["classes"]["disc"]["separation"]["0.1"] > 0.9
    for backgrounds, lacking in ((make_backgrounds(0), "give --background"), (make_backgrounds(3, things=()), "other")):
        with pytest.raises(UserError, match=f"'disc' alone.*{lacking}"):
            train(make_views(6, ("disc",)), backgrounds, small)


def test_views_that_cannot_be_used_are_counted_and_left_out(make_views, make_backgrounds, small, tmp_path: Path):
    def some() -> ObjectViews:
        other = ("disc", "cross"), {"mask": False}
        return ObjectViews.joined([make_views(), make_views(3, other[0], **other[1])])

    views, path = some(), tmp_path / "model.npz.part"
    model = train(views, make_backgrounds(broken=(2, 5)), small, checkpoint=path)
    assert set(views.skipped.values()) == {"no mask of the object"}
    used = sum(row["views"] + row["held_out_views"] for row in model.about["classes"].values())
    assert used + len(views.skipped) * 2 >= 20
    resumed = some()
    train(resumed, make_backgrounds(broken=(2, 5)), small, checkpoint=path)
    assert resumed.skipped == views.skipped


def test_broken_frames_are_counted(make_views, make_backgrounds, small):
    backgrounds = make_backgrounds(broken=(2, 5))
    train(make_views(), backgrounds, small)
    assert backgrounds.skipped == {"wall 2": "torn", "wall 5": "torn"}
    with pytest.raises(UserError, match="no frame of the backgrounds can be used"):
        train(make_views(), make_backgrounds(3, broken=(0, 1, 2)), small)


@pytest.mark.parametrize("lacking", ["depth", "mask"])
def test_objects_without_depth_or_mask_are_a_mistake_said_at_once(make_views, make_backgrounds, small, lacking):
    stages: list[str] = []
    with pytest.raises(UserError, match=rf"no view of 'cross'.*8 of 8: no {lacking}.*leave the class out"):
        train(make_views(**{lacking: False}), make_backgrounds(), small, lambda *now: stages.append(now[0]))
    assert not stages


def test_backgrounds_without_depth_are_a_mistake(make_views, make_backgrounds, small):
    with pytest.raises(UserError, match="the background has no depth"):
        train(make_views(), make_backgrounds(depth=False), small)


def test_objects_without_edges_enough_are_a_mistake(make_views, make_backgrounds, small):
    with pytest.raises(UserError, match="too sparse for a descriptor"):
        train(make_views(), make_backgrounds(), replace(small, radii=(1e-4,)))


def test_one_view_of_each_is_enough_to_run(make_views, make_backgrounds, small):
    model = train(make_views(1), make_backgrounds(1), small)
    assert model.classes == ("cross", "disc")

"""A map in the truth's axes and words, and the maps that do not fit."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import UserError
from thingmap.datasets.folder_truth import FolderWithTruth
from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.inputs.build_case import build_case
from thingmap.mapper.evaluation.inputs.placing import restrict_classes
from thingmap.mapper.map.boxes import box_corners


class Rendered(FolderWithTruth):
    """A folder with truth of which nothing is read."""

    def __post_init__(self) -> None:
        pass


def calling(run, names: dict[str, str]):
    """The run with other names for its classes."""
    things = [
        replace(
            thing,
            label=names.get(thing.label, thing.label),
            class_posterior={names.get(name, name): p for name, p in thing.class_posterior.items()},
        )
        for thing in run.object_map.things
    ]
    classes = tuple(names.get(name, name) for name in run.object_map.classes)
    return replace(run, object_map=replace(run.object_map, things=tuple(things), classes=classes))


def test_a_perfect_map_lies_on_the_truth(scene_truth, perfect_run) -> None:
    case = build_case(perfect_run(scene_truth), scene_truth)
    assert len(case.things) == 8 and case.notes == ()
    for placed, true in zip(case.things, scene_truth.objects, strict=True):
        assert placed.label == true.label
        np.testing.assert_allclose(placed.position, true.position, atol=1e-9)
        assert np.angle(np.exp(1j * (placed.yaw - true.yaw))) == pytest.approx(0.0, abs=1e-9)
        assert placed.belief == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_boxes_are_the_same_whatever_the_axes_of_the_map(scene_truth, perfect_run, seed: int) -> None:
    motion = np.eye(4)
    motion[:3, :3] = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    poses = motion @ scene_truth.poses  # another world, in which up is anywhere
    moved = replace(
        scene_truth,
        poses=poses,
        up=motion[:3, :3] @ scene_truth.up,
        objects=tuple(replace(t, position=motion[:3, :3] @ t.position) for t in scene_truth.objects),
    )
    case = build_case(perfect_run(scene_truth), moved)
    for placed, thing in zip(case.things, case.run.object_map.things, strict=True):
        corners = box_corners(placed.position, thing.size, placed.yaw, case.R_truth_upright)
        of_map = case.alignment.apply(thing.corners(case.run.object_map.R_world_upright))
        np.testing.assert_allclose(corners, of_map, atol=1e-9)


def test_up_is_the_maps_where_the_truth_does_not_know(scene_truth, perfect_run) -> None:
    case = build_case(perfect_run(scene_truth), replace(scene_truth, up=None))
    np.testing.assert_allclose(case.up, [0.0, 0.0, 1.0], atol=1e-9)
    assert case.things[4].yaw == pytest.approx(scene_truth.objects[4].yaw)


def test_case_of_letters_does_not_matter(scene_truth, perfect_run) -> None:
    case = build_case(calling(perfect_run(scene_truth), {"cup": "Cup"}), scene_truth)
    assert [placed.label for placed in case.things] == [true.label for true in scene_truth.objects]
    assert case.to_truth_label("CUP") == "cup" and case.to_truth_label("car") is None


def test_unknown_classes_are_refused_with_both_remedies(scene_truth, perfect_run) -> None:
    run = calling(perfect_run(scene_truth), {"cup": "coffee mug", "bowl": "dish"})
    with pytest.raises(UserError, match=r"bowl, cup.*coffee mug.*--alias.*--classes 'cereal box,soda can'"):
        build_case(run, scene_truth)


def test_an_alias_is_the_first_remedy(scene_truth, perfect_run) -> None:
    run = calling(perfect_run(scene_truth), {"cup": "coffee mug"})
    case = build_case(run, scene_truth, EvaluationConfig(aliases={"Coffee Mug": "CUP"}))
    assert [placed.label for placed in case.things] == [true.label for true in scene_truth.objects]
    assert case.to_truth_label("coffee mug") == "cup"


@pytest.mark.parametrize(("alias", "complaint"), [({"mug": "cup"}, "no class 'mug'"), ({"cup": "mug"}, "class 'mug'")])
def test_an_alias_of_no_use_is_refused(scene_truth, perfect_run, alias: dict[str, str], complaint: str) -> None:
    with pytest.raises(UserError, match=complaint):
        build_case(perfect_run(scene_truth), scene_truth, EvaluationConfig(aliases=alias))


def test_labels_that_mean_the_same_add_up(scene_truth, perfect_run, change_things) -> None:
    run = perfect_run(scene_truth)
    thing = run.object_map.things[4]
    posterior = {"mug": 0.5, "cup": 0.3, "bowl": 0.2}
    torn = replace(thing, label="mug", probability=0.5, existence=0.9, class_posterior=posterior)
    run = change_things(run, [torn])
    run = replace(run, object_map=replace(run.object_map, classes=(*run.object_map.classes, "mug")))
    placed = build_case(run, scene_truth, EvaluationConfig(aliases={"mug": "cup"})).things[0]
    assert placed.label == "cup"
    assert placed.probability == pytest.approx(0.8) and placed.belief == pytest.approx(0.72)


def test_things_the_truth_has_no_word_for_are_left_out_and_counted(scene_truth, perfect_run, change_things) -> None:
    run = perfect_run(scene_truth)
    chair = replace(run.object_map.things[0], label="chair", class_posterior={"chair": 1.0}, probability=1.0)
    chairs = [replace(chair, id=f"chair-{k}") for k in range(2)]
    run = change_things(run, [*run.object_map.things, *chairs])
    run = replace(run, object_map=replace(run.object_map, classes=(*run.object_map.classes, "chair")))
    case = build_case(run, scene_truth)
    assert len(case.things) == 8
    assert any("2 things" in note and "2 chair" in note for note in case.notes)


def test_a_map_made_without_a_detector_lacks_things_not_words(scene_truth, perfect_run, change_things) -> None:
    run = change_things(perfect_run(scene_truth), [])
    case = build_case(replace(run, object_map=replace(run.object_map, classes=())), scene_truth)
    assert case.things == ()


def test_what_was_mapped_beyond_the_truth_is_noted(scene_truth, perfect_run) -> None:
    shorter = replace(scene_truth, stamps=scene_truth.stamps[:30], poses=scene_truth.poses[:30])
    run = perfect_run(scene_truth)
    run = replace(run, report={**run.report, "stopped": "interrupted at frame 40"})
    notes = " ".join(build_case(run, shorter).notes)
    assert "10 of 40 mapped frames" in notes and "interrupted at frame 40" in notes


def test_a_map_of_a_sequence_of_another_name_is_noted(scene_truth, perfect_run) -> None:
    run = perfect_run(scene_truth)
    (note,) = build_case(run, replace(scene_truth, name="kitchen", sequence=object())).notes
    assert "made of eight boxes" in note and "that of kitchen" in note
    rendered = Rendered(**{field.name: None for field in fields(Rendered)} | {"source": "eight boxes"})
    for truth in (
        replace(scene_truth, sequence=object()),
        replace(scene_truth, name="truth.json"),
        replace(scene_truth, name="folder", sequence=rendered),  # from the line of which the map was made
    ):
        assert build_case(run, truth).notes == ()


def test_restricting_leaves_other_classes_unlabelled(scene_truth, perfect_run) -> None:
    truth = replace(scene_truth, tolerance={0: 0.1, 4: 0.2}, false_detections=scene_truth.objects[:1])
    only = restrict_classes(truth, ("Soda can", "cup"))
    assert only.classes == ("cup", "soda can")
    assert [thing.id for thing in only.objects] == [4, 5, 6, 7]
    assert only.tolerance == {4: 0.2} and only.false_detections == ()
    seen, points = only.frame_truth(0), only.point_truth()
    assert seen.object_id.tolist() == [4, 5, 6, 7] and seen.part_visibility.shape == (4, 5)
    whole = truth.point_truth()
    np.testing.assert_array_equal(points.class_id == 0, whole.class_id == 2)
    np.testing.assert_array_equal(points.class_id == 1, whole.class_id == 3)
    assert set(points.object_id) == {NO_OBJECT, 4, 5, 6, 7}
    assert len(build_case(perfect_run(scene_truth), only).things) == 4


def test_restricting_to_what_is_not_there_is_refused(scene_truth) -> None:
    with pytest.raises(UserError, match=r"no class chair; it has bowl"):
        restrict_classes(scene_truth, ("cup", "chair"))

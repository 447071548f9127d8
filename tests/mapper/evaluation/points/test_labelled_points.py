"""Points and their labels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.truth import NO_OBJECT, PointTruth
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.points.labelled_points import LIFT, MARGIN, label_points
from thingmap.mapper.evaluation.result import NotEvaluated


@pytest.mark.parametrize("labelled", [True, False])
def test_labels_of_a_perfect_map_are_true(labelled, perfect_run, scene_truth, make_case):
    points = label_points(make_case(perfect_run(scene_truth, labelled=labelled), scene_truth))
    assert points.by_run is labelled
    assert points.left_out == 0
    assert len(points.true) == len(scene_truth.point_truth().points)
    np.testing.assert_array_equal(points.found, points.true)
    assert set(points.true.tolist()) == {NO_OBJECT, 0, 1, 2, 3}


def test_labels_of_the_run_are_read_in_its_own_classes(perfect_run, scene_truth, make_case):
    """The map knows more classes, in another order and by other names; what the truth does not know is background."""
    run = perfect_run(scene_truth)
    points, _ = run.cloud()
    own = ("teapot", "CUP", "Tin", "cereal box", "bowl")
    labels = np.array([NO_OBJECT, 0, 1, 2, 3, 4])
    run = replace(run, object_map=replace(run.object_map, classes=own, things=()), cloud=lambda: (points[:6], labels))
    case = make_case(run, scene_truth, config=EvaluationConfig(aliases={"tin": "soda can"}))
    found = label_points(case).found
    assert [scene_truth.classes[k] if k >= 0 else None for k in found] == [
        None,
        None,
        "cup",
        "soda can",
        "cereal box",
        "bowl",
    ]


def one_thing(perfect_run, scene_truth, make_case, points_in_box, things=None):
    """Labels of points given in the first cup's own upright axes, relative to its bottom's middle."""
    cup = scene_truth.objects[4]
    cosine, sine = np.cos(cup.yaw), np.sin(cup.yaw)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    world = np.asarray(points_in_box) @ turn.T + cup.position - [0.0, 0.0, cup.size[2] / 2]
    truth = replace(scene_truth, point_truth=lambda: PointTruth(world, np.full(len(world), NO_OBJECT), None))
    run = perfect_run(truth)
    T = np.linalg.inv(truth.poses[0])
    run = replace(run, cloud=lambda: (world @ T[:3, :3].T + T[:3, 3], None))
    case = make_case(run, truth)
    case = replace(case, things=tuple(things(case.things[4])) if things else case.things)
    return [truth.classes[k] if k >= 0 else None for k in label_points(case).found]


def test_boxes_are_wider_by_a_margin_and_begin_above_the_support(perfect_run, scene_truth, make_case):
    x, _, z = scene_truth.objects[4].size / [2, 2, 1]
    points = [
        [x + 0.9 * MARGIN, 0.0, 0.05],
        [x + 1.1 * MARGIN, 0.0, 0.05],
        [0.0, 0.0, z + 0.9 * MARGIN],
        [0.0, 0.0, z + 1.1 * MARGIN],
        [0.0, 0.0, 1.1 * LIFT],
        [0.0, 0.0, 0.9 * LIFT],
    ]
    assert one_thing(perfect_run, scene_truth, make_case, points) == ["cup", None, "cup", None, "cup", None]


def test_the_smallest_box_wins_and_doubtful_ones_do_not_count(perfect_run, scene_truth, make_case):
    def things(cup):
        around = replace(cup, label="bowl", thing=replace(cup.thing, id="big", size=cup.thing.size * 3.0))
        doubtful = replace(
            cup, label="soda can", thing=replace(cup.thing, id="small", size=cup.thing.size * 0.9, existence=0.4)
        )
        return doubtful, cup, around

    points = [[0.0, 0.0, 0.05], [0.09, 0.0, 0.05], [0.5, 0.0, 0.05]]
    assert one_thing(perfect_run, scene_truth, make_case, points, things) == ["cup", "bowl", None]
    assert one_thing(perfect_run, scene_truth, make_case, points, lambda cup: things(cup)[::-1]) == [
        "cup",
        "bowl",
        None,
    ]


def test_points_far_from_the_truth_are_left_out(perfect_run, scene_truth, make_case):
    run = perfect_run(scene_truth)
    points, _ = run.cloud()
    up = run.object_map.up.direction
    moved = np.concatenate([points, points[:100] + 5.0 * up, points[:50] + 0.02 * up])
    result = label_points(make_case(replace(run, cloud=lambda: (moved, None)), scene_truth))
    assert result.left_out == 100
    assert len(result.true) == len(points) + 50
    assert "100 of" in " ".join(result.notes(0.03))


@pytest.mark.parametrize(("distance", "judged"), [(0.0299, 1), (0.0301, 0)])
def test_near_means_within_the_distance_of_the_evaluator(perfect_run, scene_truth, make_case, distance, judged):
    lonely = PointTruth(np.array([[5.0, 5.0, 5.0], [7.0, 7.0, 7.0]], dtype=np.float32), np.array([0, 0]), None)
    truth, T = replace(scene_truth, point_truth=lambda: lonely), np.linalg.inv(scene_truth.poses[0])
    world = lonely.points[:1] + np.array([[distance, 0.0, 0.0]])
    points = np.concatenate([world, lonely.points[1:]]) @ T[:3, :3].T + T[:3, 3]
    result = label_points(make_case(replace(perfect_run(truth), cloud=lambda: (points, None)), truth))
    assert (len(result.true), result.left_out) == (1 + judged, 1 - judged)
    assert result.covered == (1 + judged) / 2


def test_clouds_are_aligned_by_all_poses_not_by_the_first(perfect_run, scene_truth, make_case):
    run = perfect_run(scene_truth, labelled=True)
    poses = run.poses.copy()
    poses[0, :3, 3] += 0.5
    points = label_points(make_case(replace(run, poses=poses), scene_truth))
    assert points.left_out == 0
    assert np.mean(points.found == points.true) > 0.85  # all poses are off by 2 cm, which is the half metre over 40


def test_what_is_missing_is_said(perfect_run, scene_truth, make_case):
    run = perfect_run(scene_truth)
    case = make_case(run, scene_truth)

    def damaged():
        raise InputError("out/cloud.ply", "a cloud", "half of one", "map again")

    points, _ = run.cloud()
    for changed, reason in [
        (replace(case, truth=replace(scene_truth, point_truth=None)), "no labelled points"),
        (replace(case, run=replace(run, cloud=lambda: (points + 9.0, None))), "within 3 cm"),
        (replace(case, run=replace(run, cloud=lambda: (points[:0], None))), "none of the 0 points"),
    ]:
        with pytest.raises(NotEvaluated, match=reason):
            label_points(changed)
    with pytest.raises(InputError, match="half of one"):  # no map is judged by what is left of it
        label_points(replace(case, run=replace(run, cloud=damaged)))

"""Protocol 1 on a scene of eight objects, two of each class, that every frame shows whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.truth import NO_OBJECT
from thingmap.detectors.detections import Detections
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.protocols.georgakis import evaluate
from thingmap.mapper.evaluation.result import NotEvaluated

FRAMES = 8  # of 40, numbers divisible by 5
SHARES = ("mAP", "precision", "recall", "F1")


@pytest.fixture
def judge(perfect_run, scene_truth, change_things, make_case):
    """Evaluate the perfect run with other things."""

    def judged(change=lambda things: things, **options):
        run = perfect_run(scene_truth, labelled=True)
        run = change_things(run, change(run.object_map.things))
        return evaluate(make_case(run, scene_truth, **options))

    return judged


def multi_view(result) -> tuple:
    return tuple(result.value(f"multi-view {name}") for name in ("precision", "recall"))


def relabelled(thing, label, belief=None):
    probability = thing.probability if belief is None else belief
    return replace(thing, label=label, probability=probability, class_posterior={label: probability})


def row(result, title: str, name: str) -> tuple:
    table = next(table for table in result.tables if table.title.startswith(title))
    return next(row for row in table.rows if row[0] == name)


def test_a_perfect_map_scores_perfectly(judge, find_everything, scene_truth):
    result = judge(detections=find_everything(scene_truth))
    for name in SHARES:
        assert result.value(f"single-view {name}") == 1.0
        assert result.value(f"multi-view {name}") == 1.0
    assert result.value("point precision") == result.value("point recall") == 1.0
    assert result.value("single-view threshold") == 1.0
    assert row(result, "Boxes", "cup") == ("cup", 2 * FRAMES, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    assert row(result, "Boxes", "all classes")[1] == 8 * FRAMES
    assert result.worst == ()


def test_a_duplicate_costs_precision_only(judge):
    result = judge(lambda things: (*things, replace(things[4], id="thing-again", existence=0.9)))
    assert multi_view(result) == (pytest.approx(8 / 9), 1.0)
    assert row(result, "Boxes", "cup")[6] == pytest.approx(2 / 3)
    assert result.value("multi-view mAP") == 1.0  # the duplicate ranks below all that is right
    assert [case.text.split(":")[0] for case in result.worst] == ["thing-again"]
    assert result.worst[0].frame is not None
    assert result.worst[0].found_xyxy is not None


def test_a_duplicate_ranked_first_costs_average_precision(judge):
    """A duplicate with the highest belief is as good as the original, which is false then."""
    result = judge(lambda things: (*(replace(t, existence=0.9) for t in things), replace(things[4], id="thing-again")))
    assert multi_view(result) == (pytest.approx(8 / 9), 1.0)
    # cups: the duplicate is right, then the original (false) and the other cup (right) come together: (1 + 2/3) / 2
    assert row(result, "Boxes", "cup")[5] == pytest.approx((1.0 + 2 / 3) / 2)


def test_a_wrong_label_costs_one_of_eight_in_both(judge):
    result = judge(lambda things: (*things[:7], relabelled(things[7], "cup")))
    assert multi_view(result) == (pytest.approx(7 / 8), pytest.approx(7 / 8))
    assert row(result, "Boxes", "cup")[5:] == (pytest.approx(2 / 3), pytest.approx(2 / 3), 1.0)
    assert row(result, "Boxes", "soda can")[5:] == (0.5, 1.0, 0.5)
    assert {case.text.split(" ")[0] for case in result.worst} == {"thing-0007:", "soda"}


def test_labels_exchanged_between_all_things_leave_nothing(judge):
    """Bowls become soda cans, cereal boxes cups and the other way round."""
    result = judge(lambda things: tuple(relabelled(t, o.label) for t, o in zip(things, things[::-1], strict=True)))
    assert multi_view(result) == (0.0, 0.0)
    assert result.value("multi-view mAP") == 0.0
    assert result.value("point recall") == 1.0  # the cloud keeps the labels that the run wrote


def test_ids_exchanged_change_nothing(judge):
    result = judge(lambda things: tuple(replace(t, id=o.id) for t, o in zip(things, things[::-1], strict=True)))
    assert multi_view(result) == (1.0, 1.0)


def test_a_missing_thing_costs_recall_only(judge):
    result = judge(lambda things: things[1:])
    assert multi_view(result) == (1.0, pytest.approx(7 / 8))
    assert result.value("multi-view mAP") == pytest.approx((0.5 + 1 + 1 + 1) / 4)
    assert [case.text.split(" is ")[0] for case in result.worst] == ["bowl 0"]


def test_the_table_averages_classes_that_are_there(perfect_run, scene_truth, change_things, make_case):
    run, truth = perfect_run(scene_truth), replace(scene_truth, classes=(*scene_truth.classes, "teapot"))
    result = evaluate(make_case(change_things(run, run.object_map.things[1:]), truth))
    boxes = next(table for table in result.tables if table.title.startswith("Boxes"))
    assert [row[0] for row in boxes.rows] == [*scene_truth.classes, "mean of classes", "all classes"]
    assert boxes.rows[-2][5:] == (pytest.approx(3.5 / 4), 1.0, pytest.approx(3.5 / 4))


def test_worst_cases_are_shown_where_they_are_seen_best(perfect_run, scene_truth, change_things, make_case):
    look = scene_truth.frame_truth

    def dim(index):
        visibility = np.where(look(index).object_id == 0, 0.9 if index == 20 else 0.5, 1.0)
        return replace(look(index), visibility=visibility)

    run, truth = perfect_run(scene_truth), replace(scene_truth, frame_truth=dim)
    before_camera_15 = run.poses[15, :3, 3] + 0.5 * run.poses[15, :3, 2]
    phantom = replace(run.object_map.things[6], id="phantom", position=before_camera_15)
    false, missed = evaluate(make_case(change_things(run, (*run.object_map.things[1:], phantom)), truth)).worst
    assert (false.text.split(":")[0], false.frame) == ("phantom", 15)
    assert (missed.text.split(" is ")[0], missed.frame) == ("bowl 0", 20)


def test_a_shifted_map_finds_nothing(judge):
    result = judge(lambda things: tuple(replace(t, position=t.position + np.array([0.25, 0.0, 0.0])) for t in things))
    precision, recall = multi_view(result)
    assert recall < 0.1
    assert precision < 0.1
    near = judge(lambda things: tuple(replace(t, position=t.position + np.array([0.005, 0.0, 0.0])) for t in things))
    assert multi_view(near) == (1.0, 1.0)


def test_doubtful_things_are_ranked_but_not_claimed(judge):
    result = judge(lambda things: (*things[:7], replace(things[7], existence=0.3)))
    assert multi_view(result) == (1.0, pytest.approx(7 / 8))
    assert result.value("multi-view mAP") == 1.0


def test_a_phantom_is_false_where_it_projects(judge, scene_truth):
    """In the middle of the table, where every camera looks: one false positive a frame."""
    result = judge(lambda things: (*things, replace(things[6], id="phantom", position=_above_table(things))))
    assert multi_view(result) == (pytest.approx(8 / 9), 1.0)


def _above_table(things) -> np.ndarray:
    return np.mean([thing.position for thing in things], axis=0) + 0.01


def test_hidden_objects_are_nobodys_fault(perfect_run, scene_truth, change_things, make_case):
    whole = scene_truth.frame_truth

    def hide_object_0(index):
        seen = whole(index)
        visible = np.where(seen.object_id == 0, 0.1, 1.0)
        return replace(seen, visibility=visible)

    truth = replace(scene_truth, frame_truth=hide_object_0)
    run = perfect_run(truth)
    for things in (run.object_map.things, run.object_map.things[1:]):
        result = evaluate(make_case(change_things(run, things), truth))
        assert multi_view(result) == (1.0, 1.0)
        assert row(result, "Boxes", "bowl")[1] == FRAMES


def test_single_view_threshold_and_scores(judge, find_everything, scene_truth):
    """The detector also calls a corner of every image a cup, with a low score, and misses the first frame."""
    perfect = find_everything(scene_truth, 0.8)

    def detect(index):
        if index == 0:
            return Detections.empty(scene_truth.classes)
        corner = Detections.from_best_class(scene_truth.classes, [[0.0, 0.0, 40.0, 40.0]], [2], [0.4])
        return Detections.concatenate([perfect(index), corner])

    result = judge(detections=detect)
    assert result.value("single-view threshold") == 0.8
    assert result.value("single-view precision") == 1.0
    assert result.value("single-view recall") == pytest.approx(7 / 8)
    assert row(result, "Boxes", "cup")[2] == pytest.approx(7 / 8)
    assert multi_view(result) == (1.0, 1.0)


def test_a_detector_that_finds_nothing(judge, scene_truth):
    result = judge(detections=lambda _: Detections.empty(scene_truth.classes))
    assert result.value("single-view mAP") == 0.0
    assert result.value("single-view precision") is None
    assert result.value("single-view recall") == 0.0
    assert result.value("single-view threshold") is None


def test_without_a_detector_the_rest_goes_on(judge):
    result = judge()
    assert "no detector" in " ".join(result.notes)
    with pytest.raises(KeyError):
        result.value("single-view mAP")
    assert row(result, "Boxes", "cup")[2:5] == (None, None, None)
    assert multi_view(result) == (1.0, 1.0)


def test_poses_of_the_truth_are_not_needed(judge, perfect_run, scene_truth, make_case):
    """Images only: boxes in frames, no pose, no cloud, no place of any object."""
    run = perfect_run(scene_truth)
    nowhere = np.full(3, np.nan)
    objects = tuple(replace(thing, position=nowhere, size=nowhere) for thing in scene_truth.objects)
    truth = replace(scene_truth, poses=None, objects=objects, point_truth=None, up=None)
    result = evaluate(make_case(run, truth))
    assert multi_view(result) == (1.0, 1.0)
    assert "labelled points" in " ".join(result.notes)


def test_a_run_over_some_frames_is_judged_in_those_with_its_own_poses(judge, perfect_run, scene_truth, make_case):
    run = perfect_run(scene_truth)
    half = replace(run, stamps=run.stamps[::2], poses=run.poses[::2])
    result = evaluate(make_case(half, scene_truth))
    assert multi_view(result) == (1.0, 1.0)
    assert row(result, "Boxes", "all classes")[1] == 8 * FRAMES / 2  # frames 0, 10, 20 and 30


def test_points_are_averaged_with_the_background(perfect_run, scene_truth, make_case):
    """The second soda can is lost in the background."""
    run, true = perfect_run(scene_truth, labelled=True), scene_truth.point_truth()
    lost, cans, background = (np.sum(a == b) for a, b in ((true.object_id, 7), (true.class_id, 3), (true.class_id, -1)))
    labels = np.where(true.object_id == 7, NO_OBJECT, true.class_id)
    result = evaluate(make_case(replace(run, cloud=lambda: (run.cloud()[0], labels)), scene_truth))
    assert result.value("point precision") == pytest.approx((4 + background / (background + lost)) / 5)
    assert result.value("point recall") == pytest.approx((4 + 1 - lost / cans) / 5)


def test_points_alone(judge, perfect_run, scene_truth, make_case):
    run = perfect_run(scene_truth, labelled=True)
    result = evaluate(make_case(run, replace(scene_truth, frame_truth=None)))
    assert result.value("point precision") == 1.0
    assert [table.title for table in result.tables] == ["Points"]


def test_nothing_to_judge_by_says_why(perfect_run, scene_truth, make_case):
    def no_cloud():
        raise NotEvaluated("the run has no cloud")

    run = replace(perfect_run(scene_truth), cloud=no_cloud)
    with pytest.raises(NotEvaluated, match=r"boxes: .*every object.*points: .*cloud"):
        evaluate(make_case(run, replace(scene_truth, complete=False)))
    with pytest.raises(NotEvaluated, match="divisible by 7"):
        case = make_case(run, scene_truth, config=EvaluationConfig(frame_step=7))
        evaluate(replace(case, truth_index=case.truth_index[1:6], run_index=case.run_index[1:6]))

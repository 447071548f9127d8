from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.truth import FrameTruth, TrueObject
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.protocols.objects import evaluate
from thingmap.mapper.evaluation.result import Better, NotEvaluated

SHARES = ("joint", "detection")
PERFECT = [f"{kind} {name}" for kind in SHARES for name in ("F1", "precision", "recall")]
PERFECT += [f"{kind} F1, IoU {iou}" for kind in SHARES for iou in (0.25, 0.5)]
PERFECT += ["label accuracy", "label F1", "count ratio", "volume IoU"]
ZERO = ["duplicates", "centre error, median", "centre error, mean", "centre error, 95 %", "size error"]
ZERO += ["size error in the truth's axes", "size error in cm"]


@pytest.fixture
def perfect(scene_truth, perfect_run):
    return perfect_run(scene_truth)


def renamed(thing, label):
    return replace(thing, label=label, class_posterior={label: thing.probability})


def table(result, title):
    found = next(table for table in result.tables if table.title == title)
    return {row[0]: dict(zip(found.columns, row, strict=True)) for row in found.rows}


@pytest.fixture
def score(scene_truth, perfect, make_case, change_things):
    """`score(things, truth)`: the protocol on the perfect run with other things or another truth."""

    def run(things=None, truth=scene_truth, config=EvaluationConfig()):  # noqa: B008
        return evaluate(make_case(change_things(perfect, things or perfect.object_map.things), truth, config=config))

    return run


def test_a_map_made_from_the_truth_is_perfect(score):
    result = score()
    for name in PERFECT:
        assert result.value(name) == pytest.approx(1.0, abs=1e-9), name
    for name in ZERO:
        assert result.value(name) == pytest.approx(0.0, abs=1e-9), name
    assert result.value("true objects") == result.value("claimed things") == 8
    assert result.value("believed false detections") is None
    assert not result.worst
    assert {plot.title: sum(plot.series[0].y) for plot in result.plots if "errors" in plot.title} == {
        "Centre errors": 8.0,
        "Size errors": 24.0,
    }
    assert len({metric.name for metric in result.metrics}) == len(result.metrics)
    assert next(metric for metric in result.metrics if metric.name == "count ratio").better is Better.NEAR_ONE
    for row in table(result, "Objects by class").values():
        assert row["objects"] == row["things"] == row["found"] == row["right label"] == 2
        assert row["joint F1"] == row["count ratio"] == 1.0


def test_all_labels_exchanged_costs_all_joint_scores_and_nothing_else(score, perfect, scene_truth):
    following = dict(zip(scene_truth.classes, (*scene_truth.classes[1:], scene_truth.classes[0]), strict=True))
    result = score([renamed(thing, following[thing.label]) for thing in perfect.object_map.things])
    for name in ("joint F1", "joint precision", "joint recall", "label accuracy", "label F1", "joint F1, IoU 0.5"):
        assert result.value(name) == 0.0
    for name in ("detection F1", "detection F1, IoU 0.5", "count ratio", "volume IoU"):
        assert result.value(name) == pytest.approx(1.0)
    assert len([case for case in result.worst if "is called" in case.text]) == EvaluationConfig().worst_cases


def test_one_wrong_label_costs_one_eighth(score, perfect):
    things = list(perfect.object_map.things)
    things[0] = renamed(things[0], "cup")
    result = score(things)
    for name in ("joint F1", "joint precision", "joint recall", "label accuracy"):
        assert result.value(name) == 7 / 8
    # bowl: 2 * 1 / (1 + 2), cup: 2 * 2 / (3 + 2), two classes without a mistake
    assert result.value("label F1") == pytest.approx((2 / 3 + 4 / 5 + 1 + 1) / 4)
    assert result.value("detection F1") == 1.0
    rows = table(result, "Objects by class")
    assert (rows["bowl"]["things"], rows["bowl"]["right label"], rows["bowl"]["count ratio"]) == (1, 1, 0.5)
    assert (rows["bowl"]["joint recall"], rows["bowl"]["joint precision"]) == (0.5, 1.0)
    assert (rows["cup"]["joint precision"], rows["cup"]["count ratio"]) == (2 / 3, 1.5)
    (wrong,) = result.worst
    assert wrong.text.startswith("bowl 0 is called cup") and wrong.frame is not None
    # A thing of the right extents in the right place lies inside the box of its corners, and fills most of it.
    inner, outer = np.array(wrong.found_xyxy), np.array(wrong.truth_xyxy)
    assert np.all(inner[:2] >= outer[:2]) and np.all(inner[2:] <= outer[2:])
    assert np.prod(inner[2:] - inner[:2]) > 0.5 * np.prod(outer[2:] - outer[:2])


def test_a_shift_is_measured_exactly(score, perfect, scene_truth):
    T_map_world = np.linalg.inv(scene_truth.poses[0])
    shift = np.array([0.01, 0.0, -0.02])
    things = [replace(t, position=t.position + T_map_world[:3, :3] @ shift) for t in perfect.object_map.things]
    result = score(things)
    for name in ("median", "mean", "95 %"):
        assert result.value(f"centre error, {name}") == pytest.approx(1000.0 * np.sqrt(0.0005))
    axes = table(result, "Centre errors, mm")
    assert axes["x"]["mean (thing - object)"] == pytest.approx(10.0)
    assert axes["y"]["median |error|"] == pytest.approx(0.0, abs=1e-9)
    assert axes["z"]["mean (thing - object)"] == pytest.approx(-20.0)
    assert result.value("joint F1") == 1.0
    assert result.value("size error") == pytest.approx(0.0, abs=1e-9)
    assert len(result.worst) == EvaluationConfig().worst_cases


def test_a_lift_by_half_the_height_costs_two_thirds_of_the_volume_iou(score, perfect):
    up = perfect.object_map.up.direction
    lifted = [replace(t, position=t.position + 0.5 * t.size[2] * up) for t in perfect.object_map.things]
    result = score(lifted)
    assert result.value("volume IoU") == pytest.approx(1 / 3)
    assert result.value("detection F1, IoU 0.25") == 1.0
    assert result.value("detection F1, IoU 0.5") == 0.0
    assert result.value("joint F1") == 1.0  # half a height is less than half a diagonal


def test_things_out_of_reach_are_missed_and_false(score, perfect):
    things = [replace(t, position=t.position + 3.0) for t in perfect.object_map.things]
    result = score(things)
    for name in ("joint F1", "detection F1", "detection precision", "detection recall"):
        assert result.value(name) == 0.0
    assert result.value("label accuracy") is None and result.value("centre error, median") is None
    assert result.value("count ratio") == 1.0 and result.value("duplicates") == 0
    assert result.value("volume IoU") is None
    assert {case.text.split(": ")[-1] for case in result.worst[6:]} == {"no object is there"}


def test_duplicates_cost_precision_and_nothing_else(score, perfect):
    things = perfect.object_map.things
    up = perfect.object_map.up.direction
    result = score([*things, *(replace(t, id=f"again-{t.id}", position=t.position + 0.01 * up) for t in things[:4])])
    assert result.value("detection recall") == result.value("joint recall") == 1.0
    assert result.value("detection precision") == result.value("joint precision") == 8 / 12
    assert result.value("joint F1") == 16 / 20
    assert result.value("count ratio") == 12 / 8
    assert result.value("duplicates") == 4
    assert result.value("centre error, mean") == pytest.approx(0.0, abs=1e-9)
    assert {case.text.split(": ")[1] for case in result.worst} == {"its object has a thing already"}
    assert all(case.frame is not None and case.found_xyxy is not None for case in result.worst)


def test_missing_things_cost_recall_and_are_shown(score, perfect):
    result = score(perfect.object_map.things[2:])
    assert result.value("detection precision") == 1.0
    assert result.value("detection recall") == result.value("count ratio") == 6 / 8
    assert result.value("joint F1") == 12 / 14
    assert {case.text for case in result.worst} == {"bowl 0 is missed", "bowl 1 is missed"}
    assert all(case.truth_xyxy is not None and case.found_xyxy is None for case in result.worst)


def test_an_empty_map_finds_nothing(scene_truth, perfect, make_case, change_things):
    result = evaluate(make_case(change_things(perfect, ()), scene_truth))
    assert result.value("detection F1") == result.value("joint recall") == result.value("count ratio") == 0.0
    assert result.value("detection precision") is None


def test_doubtful_things_are_no_claims(score, perfect):
    things = list(perfect.object_map.things)
    things[0] = replace(things[0], existence=0.4)
    things[1] = replace(things[1], existence=0.9, probability=0.5, class_posterior={"bowl": 0.5, "cup": 0.5})
    assert score(things).value("claimed things") == 6


def test_sizes_twice_too_large(score, perfect):
    result = score([replace(t, size=2.0 * t.size) for t in perfect.object_map.things])
    assert result.value("size error") == pytest.approx(np.log(2.0))
    assert result.value("size error in the truth's axes") == pytest.approx(np.log(2.0))
    assert result.value("volume IoU") == pytest.approx(1 / 8)
    assert result.value("detection F1") == 1.0 and result.value("detection F1, IoU 0.25") == 0.0
    assert table(result, "Size errors")["height"]["median ln(thing / object)"] == pytest.approx(np.log(2.0))
    height = table(score([replace(t, size=0.5 * t.size) for t in perfect.object_map.things]), "Size errors")["height"]
    assert height["median ln(thing / object)"] == pytest.approx(-np.log(2.0))
    assert height["median |ln|"] == pytest.approx(np.log(2.0))


def test_axes_named_the_other_way_round_are_the_same_box(score, perfect):
    things = [replace(t, size=t.size[[1, 0, 2]], yaw=t.yaw + np.pi / 2) for t in perfect.object_map.things]
    result = score(things)
    assert result.value("size error") == pytest.approx(0.0, abs=1e-9)
    assert result.value("size error in the truth's axes") == pytest.approx(0.0, abs=1e-9)
    assert result.value("volume IoU") == pytest.approx(1.0)


def test_a_wrong_yaw_shows_in_the_truths_axes_only(score, perfect):
    things = [replace(t, yaw=t.yaw + np.pi / 4) for t in perfect.object_map.things]
    result = score(things)
    assert result.value("size error") == pytest.approx(0.0, abs=1e-9)
    assert result.value("size error in the truth's axes") > 0.2
    assert result.value("volume IoU") < 0.9


def test_objects_that_could_not_be_seen_do_not_count(score, scene_truth, perfect):
    look = scene_truth.frame_truth

    def hidden(index):
        seen = look(index)
        visibility = np.where(seen.object_id == 3, 0.2, np.where(seen.object_id == 4, 0.26, 1.0))
        return FrameTruth(seen.object_id, seen.xyxy, seen.xyxy_visible, visibility)

    truth = replace(scene_truth, frame_truth=hidden)
    for things in (perfect.object_map.things, [t for t in perfect.object_map.things if t.id != "thing-0003"]):
        result = score(things, truth)
        assert result.value("true objects") == result.value("claimed things") == 7
        assert result.value("joint F1") == result.value("count ratio") == 1.0
        assert any(note.endswith("16 pixels large: 1.") for note in result.notes)
        boxes = table(result, "Objects by class")["cereal box"]
        assert boxes["objects"] == boxes["things"] == boxes["found"] == boxes["joint F1"] == 1


def test_one_object_of_unknown_size_leaves_no_score_by_volume(score, scene_truth):
    """Nor if it need not be found: its thing would be false, as nothing tells by volume what it stands for."""
    look = scene_truth.frame_truth

    def hidden(index):
        return replace(look(index), visibility=np.where(look(index).object_id == 3, 0.0, 1.0))

    objects = tuple(replace(t, size=np.full(3, np.nan)) if t.id == 3 else t for t in scene_truth.objects)
    result = score(truth=replace(scene_truth, objects=objects, frame_truth=hidden))
    assert result.value("detection recall") == 1.0
    assert result.value("detection precision") == 1.0
    assert result.value("detection F1, IoU 0.5") is None


def test_recall_by_occlusion(score, scene_truth, perfect):
    look = scene_truth.frame_truth
    visibility = np.array([1.0, 0.95, 0.7, 0.7, 0.3, 0.3, 0.3, 0.3])

    def occluded(index):
        seen = look(index)
        return FrameTruth(seen.object_id, seen.xyxy, seen.xyxy_visible, visibility)

    things = list(perfect.object_map.things)
    things[2] = renamed(things[2], "cup")
    result = score([*things[:4], things[4]], replace(scene_truth, frame_truth=occluded))
    rows = table(result, "Recall by mean occlusion")
    assert set(rows) == {"0.0 to 0.1", "0.3 to 0.4", "0.7 to 0.8"}
    assert [rows[name]["objects"] for name in sorted(rows)] == [2, 2, 4]
    assert [rows[name]["recall"] for name in sorted(rows)] == [1.0, 1.0, 0.25]
    assert [rows[name]["joint recall"] for name in sorted(rows)] == [1.0, 0.5, 0.25]
    plot = next(plot for plot in result.plots if plot.title == "Recall by mean occlusion")
    assert plot.series[0].x == pytest.approx((0.05, 0.35, 0.75)) and plot.series[1].y == (1.0, 0.5, 0.25)


def test_an_incomplete_truth_has_no_precision_but_knows_false_detections(score, scene_truth, perfect):
    unknown = np.full(3, np.nan)
    objects = tuple(replace(true, size=unknown) for true in scene_truth.objects[:4])
    false = (
        TrueObject(10, "soda can", scene_truth.objects[6].position + 0.14 * scene_truth.up, unknown, 0.0),
        TrueObject(11, "soda can", scene_truth.objects[7].position + 0.16 * scene_truth.up, unknown, 0.0),
        TrueObject(12, "microwave", scene_truth.objects[5].position, unknown, 0.0),
        TrueObject(13, "microwave", scene_truth.objects[6].position, unknown, 0.0),  # where a soda can is believed
    )
    truth = replace(
        scene_truth,
        objects=objects,
        tolerance={true.id: 0.1 for true in objects},
        complete=False,
        false_detections=false,
        frame_truth=None,
        up=None,
    )
    result = score(truth=truth)
    for name in (
        "joint F1",
        "detection precision",
        "count ratio",
        "detection F1, IoU 0.25",
        "volume IoU",
        "size error",
    ):
        assert result.value(name) is None, name
    assert result.value("joint recall") == 1.0
    assert result.value("believed false detections") == 1  # the second is 16 cm away, nothing is called a microwave
    doubtful = [replace(t, existence=0.4) if t.id == "thing-0006" else t for t in perfect.object_map.things]
    assert score(doubtful, truth).value("believed false detections") == 0
    wider = score(truth=replace(truth, tolerance={**truth.tolerance, 11: 0.2}))
    assert wider.value("believed false detections") == 2
    (shown,) = result.worst
    assert "known not to be a soda can" in shown.text and shown.found_xyxy is not None
    things = [renamed(t, "microwave") if t.id == "thing-0005" else t for t in perfect.object_map.things]
    object_map = replace(perfect.object_map, things=tuple(things), classes=(*scene_truth.classes, "microwave"))
    assert object_map.knows("microwave")
    assert score(things, truth).value("believed false detections") == 2
    missed = score([t for t in things if t.id != "thing-0001"], truth)
    assert missed.value("joint recall") == 3 / 4
    assert any(case.text == "bowl 1 is missed" and case.truth_xyxy is not None for case in missed.worst)


def test_what_cannot_be_judged_says_why(score, scene_truth):
    with pytest.raises(NotEvaluated, match="no position"):
        score(truth=replace(scene_truth, objects=()))
    with pytest.raises(NotEvaluated, match="well enough"):
        score(config=EvaluationConfig(seen_side=1e4))


def test_without_images_boxes_and_poses_of_the_camera_there_are_no_pictures(score, scene_truth, perfect):
    truth = replace(scene_truth, intrinsics=None, frame_truth=None)
    result = score(perfect.object_map.things[1:], truth)
    assert [case.frame for case in result.worst] == [None]
    assert any("all count" in note for note in result.notes)

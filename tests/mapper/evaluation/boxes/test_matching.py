"""Boxes and objects of one image, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.truth import FrameTruth, TrueObject
from thingmap.detectors.detections import Detections
from thingmap.mapper.evaluation.boxes.image_boxes import (
    FoundBoxes,
    TrueBoxes,
    check_boxes,
    detected_boxes,
    found_boxes,
    true_boxes,
)
from thingmap.mapper.evaluation.boxes.matching import NOTHING, Outcome, box_ious, match_boxes, scored
from thingmap.mapper.evaluation.result import NotEvaluated

CAMERA = Intrinsics(100, 80, 80.0, 80.0, 49.5, 39.5)
NOWHERE = (np.nan,) * 4


def found(*boxes: tuple, inside: float = 1.0) -> FoundBoxes:
    """(xyxy, class, score) each."""
    xyxy = np.array([box[0] for box in boxes], dtype=np.float64).reshape(-1, 4)
    class_id, score = np.array([box[1] for box in boxes], dtype=np.int64), np.array([float(box[2]) for box in boxes])
    return FoundBoxes(xyxy, class_id, score, np.full(len(boxes), inside), np.arange(len(boxes)))


def true(*objects: tuple, fair: bool = True) -> TrueBoxes:
    """(whole, visible, class) each."""
    whole = np.array([thing[0] for thing in objects], dtype=np.float64).reshape(-1, 4)
    visible = np.array([thing[1] for thing in objects], dtype=np.float64).reshape(-1, 4)
    class_id, count = np.array([thing[2] for thing in objects], dtype=np.int64), len(objects)
    return TrueBoxes(np.arange(count), class_id, whole, visible, np.ones(count), np.full(count, fair))


def outcomes(matches) -> list[Outcome]:
    return [Outcome(value) for value in matches.outcome]


LEFT, RIGHT = (0, 0, 10, 10), (20, 0, 30, 10)


def test_intersection_over_union_by_hand():
    a = np.array([[0.0, 0.0, 10.0, 10.0], [0.0, 0.0, 10.0, 10.0], [50.0, 50.0, 60.0, 60.0]])
    b = np.array([[5.0, 0.0, 15.0, 10.0], NOWHERE, [3.0, 3.0, 3.0, 9.0]])
    expected = [[1 / 3, 0.0, 0.0], [1 / 3, 0.0, 0.0], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(box_ious(a, b), expected)
    assert box_ious(a, np.zeros((0, 4))).shape == (3, 0)


def test_whole_and_visible_boxes_both_count():
    behind = true(((0, 0, 10, 20), (0, 0, 10, 6), 0))
    for box, outcome in [
        ((0, 0, 10, 19), Outcome.FOUND),
        ((0, 0, 10, 6), Outcome.FOUND),
        ((0, 14, 10, 20), Outcome.FALSE),
    ]:
        assert outcomes(match_boxes(found((box, 0, 0.9)), behind, 0.5)) == [outcome]


def test_iou_of_exactly_one_half_is_enough():
    assert outcomes(match_boxes(found(((0, 0, 10, 5), 0, 0.9)), true((LEFT, LEFT, 0)), 0.5)) == [Outcome.FOUND]
    assert outcomes(match_boxes(found(((0, 0, 10, 4.99), 0, 0.9)), true((LEFT, LEFT, 0)), 0.5)) == [Outcome.FALSE]


def test_a_second_box_on_an_object_is_false_and_the_better_score_wins():
    matches = match_boxes(found((LEFT, 0, 0.3), ((0, 0, 10, 9), 0, 0.8)), true((LEFT, LEFT, 0)), 0.5)
    assert outcomes(matches) == [Outcome.FALSE, Outcome.FOUND]
    assert matches.object_row.tolist() == [NOTHING, 0]


def test_classes_are_not_mixed():
    matches = match_boxes(found((LEFT, 1, 0.9), (RIGHT, 1, 0.8)), true((LEFT, LEFT, 0), (RIGHT, RIGHT, 1)), 0.5)
    assert outcomes(matches) == [Outcome.FALSE, Outcome.FOUND]
    assert [scored([matches], number).objects for number in (0, 1)] == [1, 1]
    assert scored([matches], 0).scores.tolist() == []
    assert scored([matches], 1).right.tolist() == [False, True]
    assert scored([matches]).scores.tolist() == [0.9, 0.8]


def test_the_next_best_object_is_taken_when_the_best_is():
    front, back = (0, 0, 10, 10), (0, 2, 10, 12)
    matches = match_boxes(
        found((front, 0, 0.9), ((0, 0.5, 10, 10.5), 0, 0.8)), true((front, front, 0), (back, back, 0)), 0.5
    )
    assert matches.object_row.tolist() == [0, 1]


def test_equal_scores_are_taken_by_overlap():
    front, back = (0, 0, 10, 10), (0, 2, 10, 12)
    things = true((front, front, 0), (back, back, 0))
    forth = match_boxes(found(((0, 1, 10, 11.5), 0, 0.9), (front, 0, 0.9)), things, 0.5)
    assert forth.object_row.tolist() == [1, 0]


def test_hardly_visible_objects_are_nobodys_fault():
    hidden = true((LEFT, NOWHERE, 0), fair=False)
    matches = match_boxes(found((LEFT, 0, 0.9), (LEFT, 0, 0.8), (RIGHT, 0, 0.7), (LEFT, 1, 0.6)), hidden, 0.5)
    assert outcomes(matches) == [Outcome.IGNORED, Outcome.IGNORED, Outcome.FALSE, Outcome.FALSE]
    ranked = scored([matches], 0)
    assert (ranked.objects, ranked.images, ranked.scores.tolist()) == (0, 1, [0.7])


def test_an_object_that_can_be_seen_goes_before_one_that_cannot():
    things = true((LEFT, LEFT, 0), (LEFT, NOWHERE, 0))
    things = TrueBoxes(
        things.object_id, things.class_id, things.whole, things.visible, np.array([1.0, 0.0]), np.array([True, False])
    )
    matches = match_boxes(found((LEFT, 0, 0.9), (LEFT, 0, 0.8)), things, 0.5)
    assert outcomes(matches) == [Outcome.FOUND, Outcome.IGNORED]


def test_a_claim_mostly_outside_the_image_is_not_false_but_may_be_right():
    assert outcomes(match_boxes(found((LEFT, 0, 0.9), inside=0.4), true(), 0.5)) == [Outcome.IGNORED]
    assert outcomes(match_boxes(found((LEFT, 0, 0.9), inside=0.5), true(), 0.5)) == [Outcome.FALSE]
    assert outcomes(match_boxes(found((LEFT, 0, 0.9), inside=0.4), true((LEFT, LEFT, 0)), 0.5)) == [Outcome.FOUND]


def test_boxes_are_clipped_to_the_image():
    boxes = found_boxes(
        np.array([[-10.5, -10.5, 9.5, 9.5], [200.0, 0.0, 220.0, 9.0], NOWHERE]), [0, 0, 0], [0.9, 0.8, 0.7], CAMERA
    )
    assert boxes.xyxy.tolist() == [[-0.5, -0.5, 9.5, 9.5]]
    assert boxes.inside == pytest.approx([0.25])
    assert boxes.source.tolist() == [0]


def truth_of(*labels: str, **changes) -> GroundTruth:
    objects = tuple(TrueObject(7 + k, label, np.zeros(3), np.ones(3), 0.0) for k, label in enumerate(labels))
    values = {"name": "t", "classes": ("bowl", "cup"), "objects": objects, "intrinsics": CAMERA}
    return GroundTruth(**{**values, "frame_truth": lambda _: None, **changes})


def test_objects_of_a_frame():
    seen = FrameTruth(
        object_id=np.array([8, 99, 7]),  # 99 is clutter
        xyxy=np.array([[-20.0, 0.0, 20.0, 10.0], [0.0, 0.0, 9.0, 9.0], [5.0, 5.0, 15.0, 200.0]]),
        xyxy_visible=np.array([[-0.5, 0.0, 20.0, 10.0], [0.0, 0.0, 9.0, 9.0], [np.nan] * 4]),
        visibility=np.array([0.25, 1.0, 0.1]),
    )
    boxes = true_boxes(seen, truth_of("bowl", "cup"), CAMERA, 0.25)
    assert boxes.object_id.tolist() == [8, 7]
    assert boxes.class_id.tolist() == [1, 0]
    assert boxes.fair.tolist() == [True, False]
    assert boxes.whole.tolist() == [[-0.5, 0.0, 20.0, 10.0], [5.0, 5.0, 15.0, 79.5]]
    assert np.isnan(boxes.visible[1]).all()


def test_detections_are_shifted_by_half_a_pixel(perfect_run, scene_truth, make_case):
    case = make_case(perfect_run(scene_truth), scene_truth)
    camera = scene_truth.intrinsics
    names = ("teapot", "CUP", "bowl")  # one unknown, one in other letters
    detections = Detections(
        names,
        [[0, 0, 640, 480], [10, 10, 20, 20], [30, 30, 40, 40], [50, 50, 60, 60]],
        [[0.1, 0.2, 0.6], [0.1, 0.7, 0.2], [0.9, 0.1, 0.1], [0.1, 0.8, 0.1]],
        [0, 0, 0, 1],  # the last is the top of something
    )
    boxes = detected_boxes(detections, case, camera)
    assert boxes.xyxy.tolist() == [[-0.5, -0.5, 639.5, 479.5], [9.5, 9.5, 19.5, 19.5]]
    assert [scene_truth.classes[k] for k in boxes.class_id] == ["bowl", "cup"]
    assert boxes.score.tolist() == [0.6, 0.7]
    assert len(detected_boxes(Detections.empty(()), case, camera)) == 0


@pytest.mark.parametrize(
    ("changes", "reason"),
    [({"frame_truth": None}, "seen"), ({"intrinsics": None}, "camera"), ({"complete": False}, "every object")],
)
def test_truth_that_cannot_judge_boxes(changes, reason):
    check_boxes(truth_of("cup"))
    with pytest.raises(NotEvaluated, match=reason):
        check_boxes(truth_of("cup", **changes))


corners = arrays(np.float64, (6, 2), elements=st.floats(0.0, 60.0))


@given(corners, arrays(np.float64, (6, 2), elements=st.floats(0.0, 60.0)), st.permutations(range(6)))
def test_matching_is_one_to_one_and_free_of_order(one, other, order):
    xyxy = np.concatenate([one, one + 20.0], axis=1)
    things = np.concatenate([other, other + 20.0], axis=1)
    claims = found(*((box, k % 2, 0.9 - 0.1 * k) for k, box in enumerate(xyxy)))
    objects = true(*((box, box, k % 2) for k, box in enumerate(things)))
    matches = match_boxes(claims, objects, 0.5)
    rows = matches.object_row[matches.object_row != NOTHING]
    assert len(set(rows.tolist())) == len(rows) == np.sum(matches.outcome == Outcome.FOUND)
    order = np.array(order)
    mixed = FoundBoxes(xyxy[order], claims.class_id[order], claims.score[order], claims.inside[order], order)
    again = match_boxes(mixed, objects, 0.5)
    assert again.object_row.tolist() == matches.object_row[order].tolist()

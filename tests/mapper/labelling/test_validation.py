"""Boxes against labelled points, in a hand-made image: a cup before a wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.truth import NO_OBJECT
from thingmap.detectors.detections import Detections, Part
from thingmap.mapper.labelling.box_votes import central_votes
from thingmap.mapper.labelling.validation import Validator, project_points
from thingmap.mapper.labelling.validation_config import ValidationConfig
from thingmap.mapper.map.labels_file import PointLabels

CUP, BOWL = 0, 1
CLASSES = ("Cup", "bowl")
INTRINSICS = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
ON_CUP, ON_WALL = (24.0, 16.0, 40.0, 32.0), (4.0, 4.0, 16.0, 16.0)


def make_frame() -> Frame:
    """A wall at 2 m with a square of 16 x 16 pixels at 1 m in the middle, `ON_CUP`."""
    depth = np.full((48, 64), 2.0, np.float32)
    depth[16:32, 24:40] = 1.0
    return Frame(0, "a", 0.5, np.zeros((48, 64, 3), np.uint8), depth, INTRINSICS)


def make_points() -> tuple[np.ndarray, np.ndarray]:
    """What `make_frame` sees, a point in every second pixel, with labels; and a bowl behind the cup, which it does not
    see."""
    frame = make_frame()
    v, u = np.mgrid[0:48:2, 0:64:2].reshape(2, -1)
    seen = INTRINSICS.back_project(np.stack([u, v], axis=1), frame.depth[v, u].astype(np.float64))
    hidden = seen[seen[:, 2] == 1.0] * 1.3
    hidden = np.concatenate([hidden, hidden * 1.02])
    label = np.where(seen[:, 2] == 1.0, CUP, NO_OBJECT)
    return np.concatenate([seen, hidden]), np.append(label, np.full(len(hidden), BOWL))


def make_validator(points, labels, second=None, margin=None, **config) -> Validator:
    known = PointLabels(labels, second, margin)
    return Validator(points, known, CLASSES, np.array([0.5]), np.eye(4)[None], ValidationConfig(**config))


def boxes(*claims, classes=("cup", "bowl")) -> Detections:
    """(box, class) pairs as detections."""
    return Detections.from_best_class(
        classes, [box for box, _ in claims], [k for _, k in claims], np.full(len(claims), 0.7)
    )


def test_boxes_stay_where_the_points_in_the_middle_agree():
    validator = make_validator(*make_points())
    found = boxes((ON_CUP, CUP), (ON_CUP, BOWL), (ON_WALL, CUP), (ON_WALL, BOWL))
    assert validator.validate(found, make_frame(), np.eye(4)).agrees.tolist() == [True, False, False, False]


def test_classes_are_told_by_name_and_not_by_number():
    found = boxes((ON_CUP, 1), (ON_CUP, 0), classes=("bowl", "cup"))
    assert make_validator(*make_points()).validate(found, make_frame(), np.eye(4)).agrees.tolist() == [True, False]
    with pytest.raises(UserError, match="sofa"):
        make_validator(*make_points()).validate(boxes((ON_CUP, 0), classes=("sofa",)), make_frame(), np.eye(4))


def test_a_box_stays_that_unsure_points_may_be_of():
    """The cup is labelled background, but half of its points are that by a little, and next a cup."""
    points, labels = make_points()
    on_cup, background = labels == CUP, np.full(len(labels), NO_OBJECT)
    frame, found = make_frame(), boxes((ON_CUP, CUP), (ON_CUP, BOWL), (ON_WALL, CUP))
    top = INTRINSICS.project(points)[:, 1] < 24.0
    second = np.where(on_cup, CUP, BOWL)
    for near, stays in ((0.5, [True, False, False]), (0.7, [False, False, False])):
        margin = np.where(on_cup & top, near, 1.2).astype(np.float32)
        validator = make_validator(points, background, second, margin, doubt=0.6, central=1.0)
        assert validator.validate(found, frame, np.eye(4)).agrees.tolist() == stays
    by_labels_alone = make_validator(points, background, second, margin - 1.0, doubt=0.0, central=1.0)
    assert not make_validator(points, background).validate(found, frame, np.eye(4)).agrees.any()
    # the evidence is a cup's
    assert by_labels_alone.validate(found, frame, np.eye(4)).agrees.tolist() == [True, False, False]


def test_only_the_middle_counts():
    wide = (12.0, 4.0, 52.0, 44.0)  # 40 x 40 pixels around the cup's 16 x 16
    frame, found = make_frame(), boxes((wide, CUP))
    assert make_validator(*make_points(), central=0.4).validate(found, frame, np.eye(4)).agrees.all()
    assert not make_validator(*make_points(), central=0.9).validate(found, frame, np.eye(4)).agrees.any()


def test_a_box_stays_whose_middle_is_hidden():
    """A box of a bowl, whose middle is a cup's: the bowl's own points are a quarter of those in the box, or fewer."""
    points, labels = make_points()
    frame, around = make_frame(), (20.0, 12.0, 44.0, 36.0)  # 24 x 24 pixels about the cup's 16 x 16
    side = INTRINSICS.project(points)[:, 0] < 24.0
    labels = np.where((labels == NO_OBJECT) & side, BOWL, labels)  # 2 of 12 columns: a sixth
    found = boxes((around, BOWL))
    for share, stays in ((0.1, True), (0.3, False)):
        validator = make_validator(points, labels, share=share)
        assert validator.validate(found, frame, np.eye(4)).agrees.tolist() == [stays]


def test_what_no_points_speak_of_stays():
    points, labels = make_points()
    nothing = make_validator(points[:0], labels[:0])
    assert nothing.validate(boxes((ON_CUP, BOWL)), make_frame(), np.eye(4)).agrees.all()
    dark = make_frame()
    dark.depth[:] = 0.0
    assert make_validator(points, labels).validate(boxes((ON_CUP, BOWL)), dark, np.eye(4)).agrees.all()
    none = make_validator(points, labels).validate(Detections.empty(("cup",)), make_frame(), np.eye(4))
    assert none.agrees.shape == (0,)


def test_a_moved_camera_sees_the_same():
    """A camera that stands elsewhere, and points of the world that stand as they did before it."""
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3], T_world_camera[:3, 3] = turn, (3.0, -1.0, 0.5)
    points, labels = make_points()
    validator = make_validator(points @ turn.T + T_world_camera[:3, 3], labels)
    found = boxes((ON_CUP, CUP), (ON_CUP, BOWL), (ON_WALL, CUP))
    assert validator.validate(found, make_frame(), T_world_camera).agrees.tolist() == [True, False, False]


def test_only_what_the_depth_shows_is_visible():
    frame = make_frame()
    points = np.array([[0, 0, 1.0], [0, 0, 1.03], [0, 0, 1.05], [0, 0, 0.95], [0, 0, -1.0], [0.5, 0, 2.0], [1.1, 0, 2]])
    rows, uv, is_seen = project_points(points, frame, np.eye(4), 0.04)
    assert rows.tolist() == [0, 1, 2, 3, 5, 6] and rows[is_seen].tolist() == [0, 1, 5]  # one is behind the camera
    assert uv[0] == pytest.approx([31.5, 23.5]) and uv[4] == pytest.approx([46.5, 23.5])


def test_the_edges_of_the_image():
    frame = make_frame()
    uv = np.array([[-0.5, 0.0], [-0.51, 0.0], [63.49, 47.49], [63.5, 47.0], [0.0, 47.51]])
    points = INTRINSICS.back_project(uv, np.full(len(uv), 2.0))
    assert np.flatnonzero(project_points(points, frame, np.eye(4), 0.04)[2]).tolist() == [0, 2]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 1.0))
def test_votes_are_what_counting_gives(seed, central):
    rng = np.random.default_rng(seed)
    corner = rng.uniform(0, 30, (5, 2))
    xyxy = np.concatenate([corner, corner + rng.uniform(1, 30, (5, 2))], axis=1)
    uv, label = rng.uniform(0, 60, (80, 2)), rng.choice([NO_OBJECT, 0, 1], 80)
    votes = central_votes(xyxy, uv, label, 2, central)
    for d, (left, top, right, bottom) in enumerate(xyxy):
        across, down = (right - left) * (1 - central) / 2, (bottom - top) * (1 - central) / 2
        edge = uv + 0.5  # boxes count from the image's outer edge
        inside = (edge[:, 0] >= left + across) & (edge[:, 0] <= right - across)
        inside &= (edge[:, 1] >= top + down) & (edge[:, 1] <= bottom - down)
        assert votes[d].tolist() == [int(np.sum(inside & (label == k))) for k in (0, 1, NO_OBJECT)]


def test_poses_are_those_of_mapped_frames():
    validator = make_validator(*make_points())
    assert validator.pose_at(0.5) is not None and validator.pose_at(0.5000004) is not None
    assert validator.pose_at(0.6) is None


@pytest.mark.parametrize("wrong", [{"central": 0.0}, {"central": 1.1}, {"tolerance": 0.0}, {"least_points": 0}])
def test_numbers_out_of_range_are_refused(wrong):
    with pytest.raises(UserError):
        ValidationConfig(**wrong)


# -- where it is known whose the points are


def with_things(points, labels, number, **config) -> Validator:
    known = PointLabels(labels, instance=number)
    return Validator(points, known, CLASSES, np.array([0.5]), np.eye(4)[None], ValidationConfig(**config))


def test_a_thing_is_found_once_and_drawn_midway_to_its_points():
    points, labels = make_points()
    validator = with_things(points, labels, np.where(labels == CUP, 5, 0))
    aside, double, wrong = (22.0, 16.0, 38.0, 32.0), (26.0, 18.0, 42.0, 34.0), (24.0, 16.0, 40.0, 32.0)
    found = boxes((aside, CUP), (double, CUP), (wrong, BOWL), (ON_WALL, CUP))
    found.scores[:2] = [[0.9, np.nan], [0.8, np.nan]]
    validated = validator.validate(found, make_frame(), np.eye(4))
    assert (validated.denied, validated.doubled) == (2, 1)
    # a point in every second pixel, the first in the middle of 24, the last in that of 38
    np.testing.assert_allclose(validated.detections.xyxy, [(23.25, 16.25, 38.25, 31.25)])
    assert validated.detections.confidence.tolist() == [0.9]


def test_nothing_found_stays_nothing():
    points, labels = make_points()
    none = with_things(points, labels, np.ones(len(labels), int)).validate(
        Detections.empty(CLASSES), make_frame(), np.eye(4)
    )
    assert (len(none.detections), none.denied, none.doubled) == (0, 0, 0)


def test_without_things_labels_alone_decide():
    found = boxes((ON_CUP, CUP), ((26.0, 18.0, 42.0, 34.0), CUP), (ON_CUP, BOWL))
    validated = make_validator(*make_points()).validate(found, make_frame(), np.eye(4))
    assert (validated.denied, validated.doubled) == (1, 0)
    np.testing.assert_array_equal(validated.detections.xyxy, found.xyxy[:2])


def test_boxes_of_masks_and_of_parts_stay_where_they_are():
    points, labels = make_points()
    validator = with_things(points, labels, np.where(labels == CUP, 5, 0))
    found = boxes(((22.0, 16.0, 38.0, 32.0), CUP), ((22.0, 16.0, 30.0, 32.0), CUP))
    masked = replace(found, mask=np.zeros((2, 48, 64), bool))
    halves = replace(found, part=np.array([Part.LEFT, Part.LEFT]))
    for some in (masked, halves):
        kept = validator.validate(some, make_frame(), np.eye(4)).detections
        np.testing.assert_array_equal(kept.xyxy, some.xyxy[: len(kept)])
    assert len(validator.validate(halves, make_frame(), np.eye(4)).detections) == 2  # parts are no doubles


def test_what_is_half_outside_of_the_image_is_drawn_to_its_edge():
    """A cup that reaches from the image's left edge to 10 px beyond it: its points are before the camera, unseen."""
    frame = make_frame()
    frame.depth[10:30, 0:10] = 1.0
    v, u = np.mgrid[10:30, -10:10].reshape(2, -1)
    points = INTRINSICS.back_project(np.stack([u, v], axis=1).astype(float), np.ones(400))
    validator = with_things(points, np.full(400, CUP), np.ones(400, int), drawn=1.0)
    kept = validator.validate(boxes(((0.0, 11.0, 11.0, 30.0), CUP)), frame, np.eye(4)).detections
    np.testing.assert_allclose(kept.xyxy, [(0.0, 10.5, 9.5, 29.5)])  # the whole cup's; of what is seen it begins at 0.5


@pytest.mark.parametrize("wrong", [{"same": 0.0}, {"drawn": 1.1}, {"drawn": -0.1}, {"least_own": 0}])
def test_numbers_of_things_out_of_range_are_refused(wrong):
    with pytest.raises(UserError):
        ValidationConfig(**wrong)

"""Halves of known objects and of new ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from thingmap.datasets.frame import Intrinsics
from thingmap.detectors.detections import Part
from thingmap.detectors.parts import part_box, whole_box
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import AssociationConfig
from thingmap.mapper.estimation.association import PART_VISIBLE, Assignment, Targets, associate
from thingmap.mapper.estimation.lifting import LiftedDetection

KINECT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
CONFIG = AssociationConfig()
SIZE = np.array([0.1, 0.1, 0.1])
WHOLE, TOP, BOTTOM, LEFT, RIGHT = Part
HALVES = [TOP, BOTTOM, LEFT, RIGHT]
EVERY_HALF = pytest.mark.parametrize("part", HALVES, ids=lambda part: part.name.lower())
A, B, C = (0.0, 0.0, 2.0), (0.5, 0.0, 2.0), (-0.5, 0.2, 2.5)
NONE = [-1] * 5


def box_at(centre: ArrayLike, half_axes: ArrayLike = SIZE) -> np.ndarray:
    return project_solids(np.eye(4), np.eye(3), np.array([centre]), np.log(half_axes)[None], KINECT)[0][0]


def seen(
    centre: ArrayLike,
    part: Part = WHOLE,
    score: float = 0.6,
    half_axes: ArrayLike = SIZE,
    xyxy: ArrayLike | None = None,
    sigma: float = 0.05,
) -> LiftedDetection:
    """The box of a part of something at (3,) in the camera."""
    box = part_box(box_at(centre, half_axes) if xyxy is None else np.array(xyxy, dtype=float), part)
    scores, place = np.array([score, np.nan]), np.array(centre, dtype=float)
    noise = 2.0, place, sigma, sigma
    return LiftedDetection(scores, box, np.ones(4, bool), *noise, np.array(half_axes), part, whole_box(box, part))


def targets(*centres: ArrayLike, half_axes: ArrayLike = SIZE, sigma: float = 0.03) -> Targets:
    positions = np.array(centres, dtype=float).reshape(-1, 3)
    count = len(positions)
    boxes = np.array([box_at(p, half_axes) for p in positions]).reshape(-1, 4)
    clipped = np.clip(boxes, -0.5, np.array([639.5, 479.5] * 2))
    covariances, sizes = np.tile(sigma**2 * np.eye(3), (count, 1, 1)), np.tile(np.log(half_axes), (count, 1))
    return Targets(positions, covariances, sizes, clipped, np.ones(count), projected=boxes)


def hidden(known: Targets, **shares: float) -> Targets:
    """The same with these shares of the first target's parts visible."""
    visible = known.visible_parts.copy()
    for name, share in shares.items():
        visible[0, Part[name]] = share
    return replace(known, visible=visible[:, WHOLE], visible_parts=visible)


def run(detections: list[LiftedDetection], known: Targets, evidence: ArrayLike | None = None) -> Assignment:
    ratio = np.zeros((len(detections), len(known))) if evidence is None else np.array(evidence, dtype=float)
    return associate(detections, known, ratio, np.eye(4), np.eye(3), CONFIG)


def test_every_template_finds_its_target_by_itself():
    found = run([seen(place, part) for part in Part for place in (B, A)], targets(A, B, C))
    assert found.target.tolist() == [1, 0] * 5
    assert found.detection_of.tolist() == [[1, 3, 5, 7, 9], [0, 2, 4, 6, 8], NONE]
    assert found.duplicate_of.tolist() == found.same_as.tolist() == [-1] * 10
    assert not found.starts_new().any()


@EVERY_HALF
def test_a_half_is_enough_where_the_whole_is_missed(part):
    found = run([seen(A, part)], targets(A))
    assert found.target.tolist() == [0]
    assert found.shown_by(0)[part] == 0 and (found.shown_by(0) >= 0).sum() == 1


@EVERY_HALF
def test_a_half_counts_where_enough_of_that_half_is_visible(part):
    """However much of the rest is."""
    for share, expected in ((PART_VISIBLE - 0.01, -1), (PART_VISIBLE, -1), (PART_VISIBLE + 0.01, 0)):
        found = run([seen(A, part)], hidden(targets(A), **{part.name: share}))
        assert found.target.tolist() == [expected]
        assert found.duplicate_of.tolist() == [-1 if expected == 0 else 0]  # it lies on a known thing
        rest = {p.name: 0.05 for p in Part if p != part}
        assert run([seen(A, part)], hidden(targets(A), **rest, **{part.name: share})).target.tolist() == [expected]


def test_the_half_that_is_named_is_the_one_that_is_compared():
    """Two neighbours touch. A box at the border between them is the left half of one or the right half of the other."""
    known = targets((-0.06, 0.0, 2.0), (0.06, 0.0, 2.0), half_axes=[0.06, 0.06, 0.06], sigma=0.15)
    border = np.array([311.75, 224.0, 327.25, 254.0])  # half as wide as one of them
    for part, expected in ((LEFT, 1), (RIGHT, 0)):
        found = seen((0.0, 0.0, 2.0), part, xyxy=whole_box(border, part), sigma=0.15)
        np.testing.assert_allclose(found.xyxy, border)
        assert run([found], known).target.tolist() == [expected]


def test_halves_are_taken_before_the_image_clips():
    """A target reaches over the left border by most of itself: what shows is its right half, or less."""
    known = targets((-1.28, 0.0, 2.0))
    assert known.projected[0, 0] < -10.0 and known.xyxy[0, 0] == -0.5
    shown = known.boxes_of(RIGHT)[0]
    np.testing.assert_allclose(shown, np.maximum(part_box(known.projected[0], RIGHT), [-0.5, -0.5, 0, 0]))
    outside = known.boxes_of(LEFT)[0]
    assert outside[2] <= max(part_box(known.projected[0], LEFT)[2], -0.5) and outside[2] >= outside[0]
    gone = targets((-1.45, 0.0, 2.0)).boxes_of(LEFT)[0]
    assert gone[0] == gone[2] == -0.5


@EVERY_HALF
def test_the_gate_of_depth_holds_for_halves(part):
    far = seen((0.0, 0.0, 3.0), part, xyxy=box_at(A))
    assert run([far], targets(A)).target.tolist() == [-1]


@EVERY_HALF
def test_the_class_decides_between_equal_places_for_halves(part):
    pair = [seen(A, WHOLE), seen(A, part)]
    found = run(pair, targets(A, A), [[2.0, 0.0], [0.0, 2.0]])
    assert found.target.tolist() == [0, 1]


@EVERY_HALF
def test_a_second_half_on_a_target_is_a_duplicate(part):
    found = run([seen(A, part), seen(A, part)], targets(A, B))
    assert sorted(found.target.tolist()) == [-1, 0] and sorted(found.duplicate_of.tolist()) == [-1, 0]
    assert found.same_as.tolist() == [-1, -1]


def test_a_half_goes_with_the_detection_of_a_known_target():
    """The target is thought half as large, and its upper half hidden: only the whole box still passes for it."""
    known, real = hidden(targets(A, half_axes=0.55 * SIZE), TOP=0.1), seen(A, TOP)
    assert run([real], known).starts_new().tolist() == [True]
    both = run([real, seen(A)], known)
    assert both.target.tolist() == [-1, 0] and both.duplicate_of.tolist() == [0, -1]
    assert both.same_as.tolist() == [-1, -1] and not both.starts_new().any()
    assert both.detection_of.tolist() == [[1, *NONE[1:]]]


def test_halves_of_something_new_go_with_its_whole_box():
    found = run([seen(A, LEFT, 0.9), seen(B, TOP, 0.9), seen(A, WHOLE, 0.3), seen(B), seen(A, TOP)], targets(C))
    assert found.target.tolist() == [-1] * 5
    assert found.same_as.tolist() == [2, 3, -1, -1, 2]
    assert found.starts_new().tolist() == [False, False, True, True, False]


def test_halves_of_something_new_without_whole_box_follow_the_surest():
    parts = [seen(A, LEFT, 0.4), seen(A, TOP, 0.8), seen(B, RIGHT, 0.3), seen(A, RIGHT, 0.5)]
    for known in (targets(), targets(C)):
        found = run(parts, known)
        assert found.same_as.tolist() == [1, -1, -1, 1]
        assert found.starts_new().tolist() == [False, True, True, False]
    reversed_order = run(parts[::-1], targets())
    assert reversed_order.same_as.tolist() == [2, -1, -1, 2]


def test_halves_of_things_behind_each_other_stay_apart():
    """They overlap in the image; the one behind is twice as far and twice as large."""
    far = (0.0, 0.0, 4.0)
    np.testing.assert_allclose(box_at(far, 2.0 * SIZE), box_at(A), atol=1e-6)
    found = run([seen(A, LEFT), seen(far, RIGHT, half_axes=2.0 * SIZE)], targets())
    assert found.same_as.tolist() == [-1, -1]
    near = run([seen(A, LEFT, 0.7), seen((0.0, 0.0, 2.1), RIGHT)], targets())  # a tenth of a metre is its own depth
    assert near.same_as.tolist() == [-1, 0]


def test_groups_have_one_leader_that_leads_itself():
    """A row of boxes each of which overlaps the next: followers do not lead, so that groups do not chain."""
    row = [seen((0.07 * i, 0.0, 2.0), LEFT if i % 2 else TOP, 0.9 - 0.1 * i) for i in range(6)]
    same_as = run(row, targets()).same_as
    followers = np.flatnonzero(same_as >= 0)
    assert len(followers) > 0 and (same_as[same_as[followers]] == -1).all()
    assert (same_as[followers] < followers).all()  # surer ones come first here
    assert (same_as == -1).sum() >= 2


def test_whole_boxes_are_never_joined():
    found = run([seen(A), seen(A), seen(A)], targets())
    assert found.same_as.tolist() == [-1] * 3 and found.starts_new().all()


def test_a_half_before_a_target_is_something_new():
    front = seen((0.0, 0.0, 1.0), LEFT, half_axes=0.5 * SIZE)
    np.testing.assert_allclose(front.whole_xyxy, box_at(A), atol=1.0)
    found = run([front], targets(A))
    assert found.duplicate_of.tolist() == [-1] and found.starts_new().tolist() == [True]


def test_what_shows_a_half_of_a_small_thing_on_a_large_target_is_new():
    table = targets(A, half_axes=[0.5, 0.5, 0.3])
    assert run([seen((0.0, 0.0, 1.9), TOP, half_axes=0.05 * np.ones(3))], table).starts_new().tolist() == [True]


def test_an_assignment_of_whole_boxes_needs_no_more_than_targets():
    found = Assignment(np.array([2, -1, 0, 2]), np.array([-1, 0, -1, -1]))
    assert found.detection_of.tolist() == [[2, *NONE[1:]], NONE, [0, *NONE[1:]]]
    assert found.same_as.tolist() == [-1] * 4
    assert found.shown_by(2).tolist() == [0, *NONE[1:]] and found.shown_by(9).tolist() == NONE
    empty = Assignment(np.empty(0, dtype=int), np.empty(0, dtype=int))
    assert empty.detection_of.shape == (0, 5) and empty.shown_by(0).tolist() == NONE


def test_targets_are_as_visible_in_parts_as_on_the_whole_unless_told():
    plain = Targets(np.zeros((2, 3)), np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros((2, 4)), np.array([0.2, 0.7]))
    np.testing.assert_array_equal(plain.visible_parts, [[0.2] * 5, [0.7] * 5])
    assert plain.projected is plain.xyxy

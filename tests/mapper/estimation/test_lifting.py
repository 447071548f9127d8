"""From a box and a depth image to a place in space."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.parts import part_box
from thingmap.mapper.config import LiftingConfig
from thingmap.mapper.estimation.lifting import HALF_RANGE, HALF_TANGENTIAL, LiftedDetection, lift, lift_box
from thingmap.mapper.estimation.outcomes import Outcome

CAMERA = Intrinsics(320, 240, 262.5, 262.5, 159.5, 119.5)
CONFIG = LiftingConfig()
SCORES = np.array([0.7, 0.1])
HALVES = [Part.TOP, Part.BOTTOM, Part.LEFT, Part.RIGHT]
EVERY_HALF = pytest.mark.parametrize("part", HALVES, ids=lambda part: part.name.lower())


def frame(depth: np.ndarray | float) -> Frame:
    image = np.broadcast_to(np.float32(depth), (CAMERA.height, CAMERA.width)).astype(np.float32)
    color = np.zeros((CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
    return Frame(0, "frame-000000", 0.0, color, image, CAMERA)


def lifted(
    xyxy, depth: np.ndarray | float = 2.0, config: LiftingConfig = CONFIG, part: Part = Part.WHOLE
) -> LiftedDetection:
    result = lift_box(np.array(xyxy, dtype=float), SCORES, frame(depth), config, part)
    assert isinstance(result, LiftedDetection), result
    return result


def about(u: float, v: float, half_width: float = 20.0, half_height: float = 30.0) -> list[float]:
    return [u - half_width, v - half_height, u + half_width, v + half_height]


def test_a_box_in_the_middle_lies_on_the_optical_axis():
    found = lifted(about(159.5, 119.5))
    half_width, half_height = 20.0 * 2.0 / 262.5, 30.0 * 2.0 / 262.5
    np.testing.assert_allclose(found.centre[:2], 0.0, atol=1e-12)
    assert found.centre[2] == pytest.approx(2.0 + CONFIG.surface_offset * half_width)  # the narrower side for depth
    np.testing.assert_allclose(found.half_extents, [half_width, half_width, half_height])
    assert found.sides_seen.all() and found.scores is SCORES


def test_detectors_count_from_the_edge_and_the_graph_from_pixel_centres():
    """A box over the columns 100 to 139 spans [100, 140] for a detector and [99.5, 139.5] for the projection."""
    detections = Detections(("cup", "bowl"), np.array([[100.0, 80.0, 140.0, 140.0]]), SCORES[None])
    (found,), refused = lift(detections, frame(2.0), CONFIG)
    np.testing.assert_allclose(found.xyxy, [99.5, 79.5, 139.5, 139.5])
    assert refused == []
    u, v = CAMERA.project(found.centre[None])[0]
    assert (u, v) == (pytest.approx(119.5), pytest.approx(109.5))


def test_a_box_over_the_whole_image_is_cut_on_all_sides():
    detections = Detections(("cup", "bowl"), np.array([[0.0, 0.0, 320.0, 240.0]]), SCORES[None])
    (found,), _ = lift(detections, frame(2.0), CONFIG)
    assert not found.sides_seen.any()


@pytest.mark.parametrize(
    ("box", "seen"),
    [
        ([3.0, 60.0, 40.0, 120.0], [False, True, True, True]),
        ([3.1, 60.0, 40.0, 120.0], [True, True, True, True]),
        ([60.0, 2.0, 90.0, 120.0], [True, False, True, True]),
        ([250.0, 60.0, 316.0, 120.0], [True, True, False, True]),
        ([250.0, 60.0, 315.9, 120.0], [True, True, True, True]),
        ([60.0, 160.0, 90.0, 238.0], [True, True, True, False]),
    ],
)
def test_sides_at_the_border_are_cut_off(box, seen):
    found = lifted(box)
    assert found.sides_seen.tolist() == seen
    width, height = np.subtract(box[2:], box[:2]) / 2.0 * 2.0 / 262.5
    share = CONFIG.sigma_tangential if all(seen) else 1.0
    assert found.sigma_tangential == pytest.approx(share * np.sqrt(width * height))


@given(u=st.floats(60.0, 260.0), v=st.floats(60.0, 180.0), z=st.floats(0.5, 5.0))
@settings(max_examples=30, deadline=None)
def test_the_centre_lies_behind_its_own_pixel(u, v, z):
    found = lifted(about(u, v), z)
    np.testing.assert_allclose(CAMERA.project(found.centre[None])[0], [u, v], atol=1e-9)
    surface = CAMERA.back_project(np.array([[u, v]]), np.array([z]))[0]
    behind = np.linalg.norm(found.centre) - np.linalg.norm(surface)
    assert behind == pytest.approx(CONFIG.surface_offset * found.half_extents[1], abs=1e-6)


@given(u=st.floats(60.0, 260.0), v=st.floats(60.0, 180.0), z=st.floats(0.5, 5.0))
@settings(max_examples=30, deadline=None)
def test_the_covariance_is_long_along_the_ray(u, v, z):
    found = lifted(about(u, v, 12.0, 12.0), z)
    values, axes = np.linalg.eigh(found.covariance())
    ray = found.centre / np.linalg.norm(found.centre)
    assert found.sigma_range > found.sigma_tangential
    assert abs(axes[:, 2] @ ray) == pytest.approx(1.0)
    np.testing.assert_allclose(np.sqrt(values), [*[found.sigma_tangential] * 2, found.sigma_range], rtol=1e-6)


def test_a_covariance_can_be_flat_too():
    found = LiftedDetection(SCORES, np.zeros(4), np.ones(4, bool), 1.0, np.array([0.0, 0.0, 2.0]), 0.3, 0.1, np.ones(3))
    np.testing.assert_allclose(found.covariance(), np.diag([0.09, 0.09, 0.01]), atol=1e-12)


def test_the_middle_of_the_box_is_read_and_outliers_do_not_count():
    """The wall around the object is not looked at, nor do a few wild readings move the median."""
    depth = np.full((240, 320), 4.0, dtype=np.float32)
    depth[89:150, 139:180] = 1.5  # the object fills the box
    depth[119, 150:160] = 9.0
    found = lifted(about(159.5, 119.5), depth)
    assert found.centre[2] == pytest.approx(1.5 + CONFIG.surface_offset * 20.0 * 1.5 / 262.5, abs=1e-6)
    depth[89:150, 139:180][:15] = 4.0  # the wall above it, outside the central half
    assert lifted(about(159.5, 119.5), depth).centre[2] == pytest.approx(found.centre[2])


def test_far_and_scattered_depth_is_less_sure():
    box = about(159.5, 119.5, 10.0, 10.0)
    near, far = lifted(box, 1.0), lifted(box, 4.0)
    assert far.sigma_range > near.sigma_range
    rough = 2.0 + 0.2 * np.random.default_rng(0).standard_normal((240, 320))
    assert lifted(box, rough).sigma_range > np.hypot(lifted(box, 2.0).sigma_range, 0.15)


def test_boxes_are_as_noisy_as_they_are_large():
    small, large = lifted(about(159.5, 119.5, 5.0, 5.0)), lifted(about(159.5, 119.5, 50.0, 50.0))
    assert small.sigma_px == pytest.approx(CONFIG.sigma_px + CONFIG.sigma_relative * 10.0)
    assert large.sigma_px == pytest.approx(CONFIG.sigma_px + CONFIG.sigma_relative * 100.0)


@pytest.mark.parametrize(
    ("box", "depth", "outcome"),
    [
        (about(159.5, 119.5), 0.0, Outcome.NO_DEPTH),
        (about(159.5, 119.5), float("nan"), Outcome.NO_DEPTH),
        (about(159.5, 119.5, 1.0, 1.0), 2.0, Outcome.NO_DEPTH),  # nine pixels
        (about(-100.0, 119.5), 2.0, Outcome.NO_DEPTH),
        (about(159.5, 500.0), 2.0, Outcome.NO_DEPTH),
        (about(159.5, 119.5), CONFIG.max_range + 0.01, Outcome.OUT_OF_RANGE),
        (about(159.5, 119.5), float("inf"), Outcome.OUT_OF_RANGE),
    ],
)
def test_why_a_box_has_no_place(box, depth, outcome):
    assert lift_box(np.array(box), SCORES, frame(depth), CONFIG) is outcome


def test_a_few_readings_are_enough():
    depth = np.zeros((240, 320), dtype=np.float32)
    depth[119, 150 : 150 + CONFIG.min_readings] = 2.0
    assert lifted(about(159.5, 119.5), depth).centre[2] > 2.0
    depth[119, 150] = 0.0
    assert lift_box(np.array(about(159.5, 119.5)), SCORES, frame(depth), CONFIG) is Outcome.NO_DEPTH


@EVERY_HALF
def test_a_half_is_lifted_as_the_whole_that_it_implies(part):
    whole = np.array(about(150.0, 110.0))
    half, full = lifted(part_box(whole, part), part=part), lifted(whole)
    np.testing.assert_allclose(half.whole_xyxy, whole)
    np.testing.assert_allclose(half.xyxy, part_box(whole, part))
    np.testing.assert_allclose(half.centre, full.centre)
    np.testing.assert_allclose(half.half_extents, full.half_extents)
    assert half.part == part and half.sigma_px == full.sigma_px
    assert half.sigma_range == pytest.approx(HALF_RANGE * full.sigma_range) and HALF_RANGE > 1.0
    assert half.sigma_tangential == pytest.approx(HALF_TANGENTIAL * full.sigma_tangential) and HALF_TANGENTIAL > 1.0


@EVERY_HALF
def test_depth_is_read_where_the_half_is(part):
    """Something stands before the other half."""
    whole = np.array(about(159.5, 119.5))
    other = {Part.TOP: Part.BOTTOM, Part.BOTTOM: Part.TOP, Part.LEFT: Part.RIGHT, Part.RIGHT: Part.LEFT}[part]
    x0, y0, x1, y1 = np.round(part_box(whole, other)).astype(int)
    depth = np.full((240, 320), 2.0, dtype=np.float32)
    depth[y0:y1, x0:x1] = 0.8
    clear = lifted(part_box(whole, part), part=part)
    np.testing.assert_allclose(lifted(part_box(whole, part), depth, part=part).centre, clear.centre)
    assert lifted(part_box(whole, other), depth, part=other).centre[2] < 1.0


def test_of_a_half_the_image_border_cuts_the_measured_box_only():
    """The whole object reaches out of the image on the right, where its left half does not come near the border."""
    found = lifted([260.0, 60.0, 300.0, 120.0], part=Part.LEFT)
    assert found.whole_xyxy[2] == 340.0 and found.sides_seen.all()
    assert CAMERA.project(found.centre[None])[0][0] == pytest.approx(300.0)
    cut = lifted([0.0, 60.0, 40.0, 120.0], part=Part.LEFT)
    assert cut.sides_seen.tolist() == [False, True, True, True]
    assert cut.sigma_tangential == pytest.approx(HALF_TANGENTIAL * np.sqrt(cut.half_extents[0] * cut.half_extents[2]))


def test_best_class_and_score_look_past_what_is_unknown():
    found = lift_box(np.array(about(160.0, 120.0)), np.array([np.nan, 0.2, 0.6, np.nan]), frame(2.0), CONFIG)
    assert isinstance(found, LiftedDetection)
    assert found.class_id == 2 and found.confidence == 0.6


def test_the_whole_is_its_own_box():
    found = lifted(about(160.0, 120.0))
    assert found.part == Part.WHOLE and found.whole_xyxy is found.xyxy
    plain = LiftedDetection(
        SCORES, np.arange(4.0), np.ones(4, bool), 1.0, np.array([0.0, 0.0, 2.0]), 0.3, 0.1, np.ones(3)
    )
    assert plain.part == Part.WHOLE and plain.whole_xyxy is plain.xyxy


def test_halves_are_left_out_where_they_are_not_used():
    boxes = np.array([about(160.0, 120.0)] * 5)
    found = Detections(("cup", "bowl"), boxes, np.tile(SCORES, (5, 1)), np.array(list(Part)))
    every, none = lift(found, frame(2.0), CONFIG)
    assert [d.part for d in every] == list(Part) and none == []
    whole, refused = lift(found, frame(2.0), CONFIG, use_parts=False)
    assert [d.part for d in whole] == [Part.WHOLE] and refused == [Outcome.PART_UNUSED] * 4


def test_halves_are_made_whole_before_half_a_pixel_is_taken_off():
    """Detectors count from the image's edge; the implied whole is that of `whole_box` in either way of counting."""
    (found,), _ = lift(
        Detections(("cup", "bowl"), np.array([[100.0, 80.0, 140.0, 140.0]]), SCORES[None], np.array([Part.RIGHT])),
        frame(2.0),
        CONFIG,
    )
    np.testing.assert_allclose(found.whole_xyxy, [59.5, 79.5, 139.5, 139.5])


def test_every_detection_is_lifted_or_refused_with_a_reason():
    scores = np.array([[0.7, np.nan], [0.05, 0.07], [0.9, 0.1], [np.nan, 0.08], [0.3, 0.6]])
    boxes = np.array([about(160.0, 120.0)] * 4 + [about(-99.0, 120.0)])
    part = np.array([Part.WHOLE, Part.WHOLE, Part.TOP, Part.WHOLE, Part.WHOLE])
    found, refused = lift(Detections(("cup", "bowl"), boxes, scores, part), frame(2.0), CONFIG, use_parts=False)
    assert len(found) == 2
    assert refused == [Outcome.LOW_CONFIDENCE, Outcome.PART_UNUSED, Outcome.NO_DEPTH]
    np.testing.assert_array_equal(found[1].scores, scores[3])


def test_no_detections_no_work():
    assert lift(Detections.empty(("cup",)), frame(2.0), CONFIG) == ([], [])


@pytest.mark.parametrize("box", [[160.0, 80.0, 160.0, 160.0], [120.0, 120.0, 200.0, 120.0]])
def test_a_box_without_area_is_refused(box):
    found, refused = lift(Detections(("cup", "bowl"), np.array([box]), SCORES[None]), frame(2.0), CONFIG)
    assert found == [] and len(refused) == 1


def test_a_box_that_reaches_out_of_the_image_is_the_one_that_is_clipped():
    wide = Detections(("cup", "bowl"), np.array([[-60.0, 40.0, 80.0, 140.0]]), SCORES[None])
    (found,), _ = lift(wide, frame(2.0), CONFIG)
    (clipped,), _ = lift(wide.clip(CAMERA.width, CAMERA.height), frame(2.0), CONFIG)
    np.testing.assert_allclose(found.xyxy, clipped.xyxy)
    np.testing.assert_allclose(found.centre, clipped.centre)

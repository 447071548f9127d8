"""Probabilities of pixels, on levels filled by hand."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.candidates import ScoredLevel
from thingmap.detectors.hog.maps import MapConfig, probability_maps
from thingmap.detectors.hog.model import HogTemplate
from thingmap.detectors.hog.refinement import ClassBoxes, refine
from thingmap.detectors.hog.score_vectors import LEAST
from thingmap.detectors.probability_maps import ProbabilityMaps

W, H = 64, 48
NOTHING = ClassBoxes(np.zeros(0, int), np.zeros((0, 4)), np.zeros(0))


def template(class_id: int, part: Part = Part.WHOLE, platt: tuple[float, float] = (-1.0, 0.0)) -> HogTemplate:
    return HogTemplate(class_id, part, np.zeros((2, 2, 31)), 0.0, 0.0, platt, (0.0, 0.0, 1.0, 1.0))


def frame(depth: np.ndarray | float = 1.0) -> Frame:
    size = depth.shape if isinstance(depth, np.ndarray) else (H, W)
    K = Intrinsics(size[1], size[0], 100.0, 100.0, size[1] / 2, size[0] / 2)
    return Frame(0, "f", 0.0, np.zeros((*size, 3), np.uint8), np.full(size, depth, dtype=np.float32), K)


def level(scores: np.ndarray, first: tuple[float, ...] = (-4, -4, 12, 12), step: float = 8.0) -> ScoredLevel:
    """Windows of 16 px, centred on (4, 4), (12, 4) ..., as at scale 1 in an image with half a cell of border."""
    scores = np.asarray(scores, dtype=np.float32)
    return ScoredLevel(scores, np.tile(np.array(first, dtype=np.float64), (len(scores), 1)), step)


def p(score: float) -> float:
    return 1.0 / (1.0 + np.exp(-score))


def maps_of(levels: list[ScoredLevel], *templates: HogTemplate, classes: int = 1, **keywords) -> ProbabilityMaps:
    names = tuple("abc"[:classes])
    return probability_maps(levels, templates, names, keywords.pop("frame", frame()), NOTHING, MapConfig(**keywords))


def test_a_pixel_has_the_probability_of_the_window_centred_on_it():
    def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.06 * x - 0.05 * y - 0.5

    centres = np.meshgrid(np.arange(W // 8) * 8.0 + 4, np.arange(H // 8) * 8.0 + 4)
    found = maps_of([level(plane(*centres)[None])], template(0)).probabilities
    assert found.shape == (1, H, W) and found.dtype == np.float32
    pixels = np.meshgrid(np.arange(W) + 0.5, np.arange(H) + 0.5)
    inner = slice(6, -6)  # a rim beyond the outer windows' centres takes theirs
    np.testing.assert_allclose(found[0, inner, inner], p(plane(*pixels))[inner, inner], atol=1e-5)


def test_the_best_scale_counts_after_calibration():
    low, high = np.full((2, 6, 8), -1.0), np.full((2, 3, 4), 0.5)
    high[1] = -2.0
    coarse = level(high, (-8, -8, 24, 24), 16.0)
    found = maps_of([level(low), coarse], template(0), template(1, platt=(-2.0, 1.0)), classes=2)
    assert found.probabilities[0, 16:32, 16:48] == pytest.approx(p(0.5), abs=1e-5)
    assert found.probabilities[1, 16:32, 16:48] == pytest.approx(p(2 * -1.0 - 1), abs=1e-5)
    assert found.background[24, 32] == pytest.approx(0.1 * (1 - p(0.5)), abs=1e-6)


def test_halves_and_classes_without_a_template_leave_the_map_at_its_least():
    scores = np.full((2, 6, 8), 3.0)
    found = maps_of([level(scores)], template(0, Part.LEFT), template(1), classes=3).probabilities
    assert found[0].max() == pytest.approx(LEAST) and found[2].max() == pytest.approx(LEAST)
    assert found[1].min() == pytest.approx(p(3.0), abs=1e-5)


def test_pixels_on_which_no_window_is_centred():
    scores = np.full((1, 6, 8), 2.0)
    scores[0, 2:] = scores[0, :, 3:] = -np.inf  # windows centred on (4, 4) to (20, 12)
    found = maps_of([level(scores)], template(0)).probabilities[0]
    assert found[:14, :22] == pytest.approx(p(2.0), abs=1e-5)
    assert found[24:].max() < 2 * LEAST and found[:, 32:].max() < 2 * LEAST


def test_a_single_window():
    scores = np.full((1, 3, 3), -np.inf)
    scores[0, 0, 0] = 2.0
    found = maps_of([level(scores)], template(0)).probabilities[0]
    assert found[4, 4] == pytest.approx(p(2.0), abs=1e-5) and found[20, 20] < 2 * LEAST


@pytest.mark.parametrize("size", [(0, 0), (1, 1), (3, 2), (5, 70)])
def test_images_of_a_few_pixels_and_no_levels(size: tuple[int, int]):
    found = maps_of([], template(0), frame=frame(np.zeros(size, np.float32)), alpha=0.3)
    assert found.probabilities.shape == (1, *size)
    assert found.probabilities.ravel() == pytest.approx(LEAST)
    assert found.background == pytest.approx(0.3)


def test_all_is_strictly_between_0_and_1():
    for score in (-1e6, 1e6):
        boxes = ClassBoxes(np.array([0]), np.array([[0.0, 0.0, W, H]]), np.array([1.0]))
        found = probability_maps(
            [level(np.full((1, 6, 8), score))], (template(0),), ("a",), frame(), boxes, MapConfig()
        )
        assert found.probabilities.min() > 0.0 and found.probabilities.max() < 1.0 and found.background.min() > 0.0


def boxes(*rows: tuple[int, float, tuple[float, float, float, float]]) -> ClassBoxes:
    return ClassBoxes(np.array([r[0] for r in rows]), np.array([r[2] for r in rows]), np.array([r[1] for r in rows]))


def test_a_box_spreads_over_what_is_near_its_middle():
    depth = np.full((H, W), 2.0, np.float32)
    depth[10:31, 10:31] = 1.0  # a thing before a wall
    view, found = frame(depth), np.full((2, H, W), 0.3, np.float32)
    refine(found, view, boxes((0, 0.8, (8.0, 8.0, 33.0, 33.0))), 25.0)
    K, middle = view.intrinsics, (20, 20)
    for x, y in ((20, 20), (30, 20), (10, 30), (32, 20), (8, 8)):
        points = K.back_project(np.array([[x, y], middle], float), np.array([depth[y, x], 1.0], float))
        expected = max(0.8 * np.exp(-25.0 * ((points[0] - points[1]) ** 2).sum()), LEAST)
        assert found[0, y, x] == pytest.approx(expected, rel=1e-5)
    inside = np.zeros((H, W), bool)
    inside[8:33, 8:33] = True
    assert (found[0][~inside] == np.float32(0.3)).all() and (found[1] == np.float32(0.3)).all()


def test_pixels_without_depth_keep_their_probability():
    depth = np.ones((H, W), np.float32)
    depth[12, :], depth[13, :], depth[14, :] = 0.0, np.nan, np.inf
    found = np.full((1, H, W), 0.3, np.float32)
    refine(found, frame(depth), boxes((0, 0.9, (0.0, 0.0, W, H))), 25.0)
    assert (found[0, 12:15] == np.float32(0.3)).all() and found[0, 11, W // 2] > 0.5


def test_a_centre_without_depth_takes_the_median_around_it():
    depth = np.full((H, W), 3.0, np.float32)
    depth[12:36, 16:48] = 1.5  # the middle of a box over the image
    depth[20:28, 30:36] = 0.0
    found = np.full((1, H, W), 0.3, np.float32)
    refine(found, frame(depth), boxes((0, 0.9, (0.0, 0.0, W, H))), 25.0)
    assert found[0, 15, 31] > 0.5 and found[0, 2, 31] == pytest.approx(LEAST)


def test_a_box_without_readings_in_its_middle_is_left_out():
    depth = np.ones((H, W), np.float32)
    depth[8:40, 8:56] = 0.0
    found = np.full((1, H, W), 0.3, np.float32)
    refine(found, frame(depth), boxes((0, 0.9, (0.0, 0.0, W, H))), 25.0)
    refine(found, frame(0.0), boxes((0, 0.9, (0.0, 0.0, W, H))), 25.0)
    assert (found == np.float32(0.3)).all()


def test_where_boxes_overlap_the_greatest_value_counts():
    two = (0, 0.9, (0.0, 0.0, 30.0, 30.0)), (0, 0.5, (10.0, 0.0, 40.0, 30.0))
    results = []
    for order in (two, two[::-1]):
        found = np.full((1, H, W), 0.3, np.float32)
        refine(found, frame(), boxes(*order), 1.0)
        results.append(found)
    np.testing.assert_array_equal(*results)
    assert results[0][0, 15, 15] == pytest.approx(0.9, abs=0.01) and results[0][0, 15, 35] == pytest.approx(
        0.5, abs=0.02
    )


def test_boxes_of_little_probability_and_of_no_pixel_change_nothing():
    scores = [level(np.zeros((1, 6, 8)))]
    few = boxes((0, 0.19, (0.0, 0.0, W, H)), (0, 0.9, (5.6, 5.6, 5.9, 5.9)))
    found = probability_maps(scores, (template(0),), ("a",), frame(), few, MapConfig(refined_from=0.2))
    assert (found.probabilities == 0.5).all()
    found = probability_maps(scores, (template(0),), ("a",), frame(), few, MapConfig(refined_from=0.19))
    assert found.probabilities.max() < 0.2


def test_background_is_what_the_surest_class_leaves():
    found = ProbabilityMaps.of(("a", "b"), np.array([[[0.2, 0.9]], [[0.6, 0.1]]], np.float32))
    np.testing.assert_allclose(found.background, [[0.04, 0.01]], rtol=1e-5)
    assert ProbabilityMaps.of((), np.zeros((0, 2, 3), np.float32), 0.5).background == pytest.approx(0.5)


@pytest.mark.parametrize(
    "keywords", [{"gamma": -1.0}, {"refined_from": 1.1}, {"judged_from": -0.1}, {"alpha": 0.0}, {"gamma": np.nan}]
)
def test_numbers_out_of_range(keywords: dict[str, float]):
    with pytest.raises(UserError, match=r"gamma >= 0, refined_from and judged_from in"):
        MapConfig(**keywords)


def test_maps_of_other_shapes():
    with pytest.raises(ValueError, match=r"probabilities must have shape \(2, H, W\)"):
        ProbabilityMaps(("a", "b"), np.zeros((1, 2, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="background must have shape"):
        ProbabilityMaps(("a",), np.zeros((1, 2, 3)), np.zeros((3, 2)))

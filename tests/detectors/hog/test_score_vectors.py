"""What every class makes of a detection's place, on levels filled by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.detections import Part
from thingmap.detectors.hog.candidates import Candidates, ScoredLevel
from thingmap.detectors.hog.model import HogTemplate
from thingmap.detectors.hog.score_vectors import LEAST, SAME_PLACE, score_vectors
from thingmap.detectors.hog.suppression import overlap


def template(class_id: int, part: Part = Part.WHOLE, platt: tuple[float, float] = (-1.0, 0.0)) -> HogTemplate:
    return HogTemplate(class_id, part, np.zeros((2, 2, 31)), 0.0, 0.0, platt, (0.0, 0.0, 1.0, 1.0))


def level(scores: np.ndarray, sizes: list[tuple[float, float]], step: float = 8.0) -> ScoredLevel:
    first = np.array([[0.0, 0.0, width, height] for width, height in sizes])
    return ScoredLevel(np.asarray(scores, dtype=np.float32), first, step)


def detection(levels: list[ScoredLevel], *places: tuple[int, int, int, int]) -> Candidates:
    """The windows (level, template, i, j), where templates are of whole objects, each of its own class."""
    boxes = [levels[a].first[t] + levels[a].step * np.array([j, i, j, i]) for a, t, i, j in places]
    class_id, part = np.array([t for _, t, _, _ in places]), np.full(len(places), Part.WHOLE)
    return Candidates(class_id, part, np.array(boxes), np.full(len(places), 0.5))


def p(score: float, u: float = -1.0, v: float = 0.0) -> float:
    return 1.0 / (1.0 + np.exp(u * score + v))


def test_the_best_window_on_it_speaks_for_a_class():
    scores = np.full((2, 5, 5), -3.0)
    scores[0, 2, 2] = 2.0
    scores[1, 2, 3] = 1.0  # 24 x 24 px moved by 8: intersection over union 1/2
    scores[1, 2, 4] = 5.0  # moved by 16: 1/5
    levels = [level(scores, [(24, 24), (24, 24)])]
    templates = (template(0), template(1, platt=(-2.0, 0.5)))
    found = score_vectors(detection(levels, (0, 0, 2, 2)), levels, templates, 2, 0.5)
    assert found == pytest.approx(np.array([[p(2.0), p(1.0, -2.0, 0.5)]]))


def test_over_all_levels_and_templates_of_a_class():
    flat = np.full((2, 3, 3), -3.0)
    finer, coarser = flat.copy(), flat.copy()
    finer[0, 1, 1], coarser[1, 1, 1] = 1.0, 1.5
    levels = [level(finer, [(32, 32)] * 2, 8.0), level(coarser, [(40, 40)] * 2, 8.0)]
    found = score_vectors(detection(levels, (0, 0, 1, 1)), levels, (template(0), template(0)), 1, 0.5)
    assert found == pytest.approx(np.array([[p(1.5)]]))


def test_templates_of_other_parts_say_nothing():
    scores = np.full((2, 3, 3), 1.0)
    levels = [level(scores, [(32, 32)] * 2)]
    found = score_vectors(detection(levels, (0, 0, 1, 1)), levels, (template(0), template(1, Part.TOP)), 2, 0.5)
    assert found[0, 0] == pytest.approx(p(1.0)) and np.isnan(found[0, 1])


def test_a_window_that_a_better_detection_suppresses_is_about_that_one():
    scores = np.full((2, 1, 12), -3.0)
    scores[0, 0, 2], scores[1, 0, 6] = 1.0, 4.0  # a mug, and a bowl that stands half before it
    scores[1, 0, 5] = 3.0  # the bowl, not quite at its place: on the mug by more than half
    scores[1, 0, 2] = -1.0
    levels = [level(scores, [(80, 80)] * 2)]
    alone = score_vectors(detection(levels, (0, 0, 0, 2)), levels, (template(0), template(1)), 2, 0.5)
    assert alone[0, 1] == pytest.approx(p(3.0))
    both = score_vectors(detection(levels, (0, 1, 0, 6), (0, 0, 0, 2)), levels, (template(0), template(1)), 2, 0.5)
    assert both[1] == pytest.approx([p(1.0), p(-1.0)])
    assert both[0, 1] == pytest.approx(p(4.0))


def test_a_lesser_box_on_an_objects_rim_borrows_nothing_of_the_better_one():
    scores = np.full((1, 1, 12), -3.0)
    scores[0, 0, 2:8] = 2.0, 1.9, 1.8, 1.5, 0.1, -1.0
    levels = [level(scores, [(80, 80)])]
    found = score_vectors(detection(levels, (0, 0, 0, 2), (0, 0, 0, 6)), levels, (template(0),), 1, 0.5)
    assert found[:, 0] == pytest.approx([p(2.0), p(0.1)])


def test_where_no_box_of_a_class_fits_its_nearest_one_speaks():
    scores = np.full((2, 9, 9), -2.0)
    scores[0, 4, 4] = 2.0
    scores[1, 3:6, 3:6] = 0.5
    levels = [level(scores, [(64, 8), (8, 64)])]  # lying and standing: 1/15 at most
    found = score_vectors(detection(levels, (0, 0, 4, 4)), levels, (template(0), template(1)), 2, 0.5)
    assert found[0, 0] == pytest.approx(p(2.0))
    assert p(-2.0) - 1e-6 < found[0, 1] < p(0.5) + 1e-6


def test_windows_that_do_not_exist_have_no_score():
    scores = np.zeros((2, 3, 3))
    scores[1] = -np.inf
    levels = [level(scores, [(32, 32)] * 2), level(np.zeros((2, 0, 0)), [(64, 64)] * 2)]
    found = score_vectors(detection(levels, (0, 0, 1, 1)), levels, (template(0), template(1)), 2, 0.5)
    assert found[0, 0] == 0.5 and np.isnan(found[0, 1])


def test_beside_the_last_window_of_a_large_class():
    scores = np.full((2, 6, 6), -2.0)
    scores[1, 3:] = scores[1, :, 3:] = -np.inf
    scores[1, 2, 2] = 1.0
    levels = [level(scores, [(16, 16), (40, 40)])]
    found = score_vectors(detection(levels, (0, 0, 5, 5)), levels, (template(0), template(1)), 2, 0.5)
    assert found[0, 1] == pytest.approx(p(1.0))


def test_no_score_is_nothing():
    scores = np.stack([np.zeros((3, 3)), np.full((3, 3), -1e6)])
    levels = [level(scores, [(32, 32)] * 2)]
    found = score_vectors(detection(levels, (0, 0, 1, 1)), levels, (template(0), template(1)), 2, 0.5)
    assert found[0, 1] == LEAST


def test_no_detections():
    levels = [level(np.zeros((1, 3, 3)), [(32, 32)])]
    nothing = Candidates(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 4)), np.zeros(0))
    assert score_vectors(nothing, levels, (template(0),), 3, 0.5).shape == (0, 3)
    assert score_vectors(nothing, [], (), 3, 0.5).shape == (0, 3)


sizes = st.tuples(st.integers(8, 60), st.integers(8, 60))


@given(st.integers(0, 1000), st.lists(sizes, min_size=2, max_size=2), st.floats(0.5, 2.0), st.floats(0.2, 0.8))
def test_as_found_by_looking_at_every_window(seed: int, size: list[tuple[int, int]], ratio: float, nms_iou: float):
    rng = np.random.default_rng(seed)
    other = [(width * ratio, height * ratio) for width, height in size]
    levels = [level(rng.normal(size=(2, 7, 8)), size), level(rng.normal(size=(2, 5, 6)), other, 8.0 * ratio)]
    kept = detection(levels, (0, 0, 3, 3), (1, 1, 2, 2))
    expected = np.zeros((2, 2))
    for n in range(2):
        for k in range(2):
            windows = [
                (overlap(box, kept.xyxy[n]), overlap(box, kept.xyxy[0]) > nms_iou, p(lev.scores[k, i, j]))
                for lev in levels
                for i, j in np.ndindex(lev.scores.shape[1:])
                for box in [lev.first[k] + lev.step * np.array([j, i, j, i])]
            ]
            on_it = [value for here, lost, value in windows if here >= SAME_PLACE and not (lost and n == 1)]
            expected[n, k] = max(on_it, default=np.nan)
    found = score_vectors(kept, levels, (template(0), template(1)), 2, nms_iou)
    known = ~np.isnan(expected)
    np.testing.assert_allclose(found[known], expected[known], rtol=1e-5)
    assert np.isfinite(found).all()

"""How far things reach in an image, which of them a box shows, and boxes drawn on the way to there."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.boxes import box_ious
from thingmap.detectors.detections import Detections, Part
from thingmap.mapper.labelling.thing_extents import ThingPixels, doubles, drawn_anew, reaches, shown_things

CUP, BOWL = 0, 1
NONE = (np.nan,) * 4


def grid(x0: int, y0: int, x1: int, y1: int) -> np.ndarray:
    """(V, 2) pixels from one corner to the other, both included."""
    v, u = np.mgrid[y0 : y1 + 1, x0 : x1 + 1].reshape(2, -1)
    return np.stack([u, v], axis=1).astype(float)


def pixels(*areas: tuple[int, tuple[int, int, int, int]]) -> ThingPixels:
    """Every pixel of areas, each of a thing."""
    parts = [(grid(*area), number) for number, area in areas]
    number = np.concatenate([np.full(len(uv), number) for uv, number in parts])
    return ThingPixels(np.concatenate([uv for uv, _ in parts]), number)


def boxes(*xyxy: tuple[float, ...], class_id=None, confidence=None, part=None) -> Detections:
    n = len(xyxy)
    found = Detections.from_best_class(
        ("cup", "bowl"), xyxy, class_id or [CUP] * n, confidence or np.linspace(0.9, 0.5, n)
    )
    return found if part is None else Detections(found.classes, found.xyxy, found.scores, np.array(part))


def test_things_reach_from_their_first_point_to_their_last():
    seen = pixels((7, (10, 20, 29, 39)), (9, (50, 20, 51, 21)), (0, (0, 0, 60, 45)))
    found = reaches(seen, np.array([7, 0, 9, 7, 4]), least=8)
    around = (10.5, 20.5, 29.5, 39.5)  # from the image's outer edge
    np.testing.assert_array_equal(found, [around, NONE, NONE, around, NONE])
    np.testing.assert_array_equal(reaches(seen, np.array([9]), least=4), [(50.5, 20.5, 51.5, 21.5)])
    assert reaches(seen, np.zeros(0, int), 8).shape == (0, 4)


def test_a_box_shows_the_thing_of_most_points_in_its_middle():
    """A box around one cup, with a corner over another cup; one around a cup whose middle a bowl hides; half a cup."""
    seen = pixels((1, (10, 10, 29, 29)), (2, (30, 10, 49, 29)), (3, (15, 15, 24, 24)))
    label = np.repeat([CUP, CUP, BOWL], [400, 400, 100])
    found = boxes((10, 10, 40, 30), (25, 10, 50, 30), (12, 12, 28, 28), (10, 10, 30, 20), part=[0, 0, 0, Part.TOP])
    claimed = np.array([CUP, CUP, BOWL, CUP])
    assert shown_things(found, claimed, seen, label, 0.5).tolist() == [1, 2, 3, 0]
    assert shown_things(found, np.full(4, BOWL), seen, label, 0.2).tolist() == [3, 0, 3, 0]  # at a side, or not at all
    nothing = ThingPixels(np.zeros((0, 2)), np.zeros(0, int))
    assert shown_things(found, claimed, nothing, label[:0], 0.5).tolist() == [0] * 4
    assert shown_things(boxes(), np.zeros(0, int), seen, label, 0.5).shape == (0,)


def test_a_box_goes_to_the_extents_that_it_means():
    """What is seen of a thing whose right half is hidden, and all of it: a detector may draw either."""
    part, whole = (10.0, 10.0, 30.0, 50.0), (10.0, 10.0, 50.0, 50.0)
    xyxy = np.array([(12.0, 10.0, 32.0, 50.0), (8.0, 10.0, 46.0, 50.0), (60.0, 10.0, 80.0, 30.0)])
    extents = [np.tile(part, (3, 1)), np.tile(whole, (3, 1))]
    np.testing.assert_allclose(drawn_anew(xyxy, extents, 0.3, 0.5), [(11, 10, 31, 50), (9, 10, 48, 50), NONE])
    np.testing.assert_allclose(drawn_anew(xyxy, extents, 0.3, 1.0), [part, whole, NONE])
    assert np.isnan(drawn_anew(xyxy, [np.full((3, 4), np.nan)] * 2, 0.3, 0.5)).all()


@given(st.integers(0, 1000), st.floats(0.05, 1.0), st.floats(0.0, 1.0))
def test_no_box_gets_farther_from_the_extents(seed: int, same: float, drawn: float):
    rng = np.random.default_rng(seed)
    corner = rng.uniform(0.0, 20.0, (2, 6, 2))
    xyxy, there = np.concatenate([corner, corner + rng.uniform(5.0, 30.0, (2, 6, 2))], axis=2)
    before = np.diagonal(box_ious(xyxy, there))
    anew = drawn_anew(xyxy, [there], same, drawn)
    assert (np.isnan(anew).all(axis=1) == (before < same)).all()
    near = ~np.isnan(anew[:, 0])
    assert (np.diagonal(box_ious(anew, there))[near] >= before[near] - 1e-9).all()


def test_of_several_boxes_on_a_thing_the_surest_is_no_double():
    found = boxes(*[(0.0, 0.0, 9.0, 9.0)] * 6, class_id=[0, 0, 0, 1, 0, 0], confidence=[0.5, 0.9, 0.9, 0.3, 0.8, 0.7])
    assert doubles(found, np.array([4, 4, 4, 4, 0, 0])).tolist() == [True, False, True, False, False, False]
    assert doubles(boxes(), np.zeros(0, int)).tolist() == []

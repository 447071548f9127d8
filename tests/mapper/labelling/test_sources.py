"""Probabilities of pixels from boxes, masks and maps: equations (5) and (12) of Lai et al., by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from label_frames import CLASSES, make_frame

from thingmap.datasets.errors import UserError
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.probability_maps import ProbabilityMaps
from thingmap.mapper.labelling.labelling_config import SourceConfig
from thingmap.mapper.labelling.pixel_evidence import PixelEvidence, pixel_grid
from thingmap.mapper.labelling.sources import evidence_of, log_probabilities

CONFIG = SourceConfig(least=0.01, least_maps=0.015, gamma=25.0, alpha=0.1)


def detections(xyxy, scores, part=None, mask=None):
    return Detections(CLASSES, np.array(xyxy, float), np.array(scores, float), part, mask)


def of_pixel(evidence: PixelEvidence, u: int, v: int) -> np.ndarray:
    """(K + 1,) probabilities of one pixel."""
    row = np.flatnonzero((evidence.uv == [u, v]).all(axis=1))
    assert len(row) == 1
    return np.exp(evidence.log_p[row[0]])


def test_the_background_is_what_the_likeliest_class_leaves():
    p = log_probabilities(np.array([[0.8, 0.3, 0.01], [0.2, 0.2, 0.6]]), CONFIG)
    np.testing.assert_allclose(np.exp(p[:, -1]), [0.1 * 0.2, 0.1 * 0.4], rtol=1e-5)  # alpha min (1 - p), eq. 5
    np.testing.assert_allclose(np.exp(p[0, :-1]), [0.8, 0.3, 0.01], rtol=1e-5)


@given(st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3), st.floats(1e-6, 0.4), st.floats(0.01, 1.0))
def test_nothing_is_impossible_and_the_background_is_bounded(p, least, alpha):
    log_p = log_probabilities(np.array([p]), SourceConfig(least=least, alpha=alpha))
    assert np.isfinite(log_p).all() and log_p.max() <= 0.0
    assert np.all(np.exp(log_p[0, -1]) <= 1.0 - np.exp(log_p[0, :-1]) + 1e-6)  # eq. 4


@pytest.mark.parametrize("step", [1, 2, 3])
def test_a_box_is_spread_by_distance_in_space(step):
    frame = make_frame()  # a wall at 1 m with its left half at 1.2 m
    box = [[7.0, 5.0, 22.0, 20.0]]  # 15 pixels wide and high, its middle pixel (14, 12)
    evidence = evidence_of(frame, detections(box, [[0.8, 0.3, np.nan]]), None, step, CONFIG)
    k, depth = frame.intrinsics, frame.depth

    def point(u, v):
        return k.back_project(np.array([[u, v]]), np.array([depth[v, u]], dtype=float))[0]

    middle = {1: (14.0, 12.0), 2: (14.0, 12.0), 3: (15.0, 12.0)}[step]  # of the pixels of the box that are looked at
    x0 = k.back_project(np.array([middle]), np.array([depth[12, 15 if step == 3 else 14]], dtype=float))[0]
    for u, v in ((12, 6), (18, 18), (18, 12)):
        away = np.sum((point(u, v) - x0) ** 2)
        expected = np.exp(-25.0 * away)
        p = of_pixel(evidence, u, v)
        np.testing.assert_allclose(p[:3], [0.8 * expected, 0.3 * expected, 0.01], rtol=1e-4)  # eq. 12; least
        np.testing.assert_allclose(p[3], 0.1 * (1.0 - 0.8 * expected), rtol=1e-4)
    np.testing.assert_allclose(of_pixel(evidence, 24, 12), [0.01, 0.01, 0.01, 0.1 * 0.99], rtol=1e-4)  # outside


def test_where_boxes_overlap_the_greater_probability_counts_for_each_class():
    frame = make_frame(left=1.0)
    boxes = [[7, 5, 22, 20], [7, 5, 22, 20]]
    evidence = evidence_of(frame, detections(boxes, [[0.8, 0.1, 0.0], [0.3, 0.6, 0.0]]), None, 1, CONFIG)
    np.testing.assert_allclose(of_pixel(evidence, 14, 12)[:3], [0.8, 0.6, 0.01], rtol=1e-3)


def test_a_box_without_depth_says_nothing():
    frame = make_frame()
    frame.depth[5:20, 7:22] = 0.0
    evidence = evidence_of(frame, detections([[7, 5, 22, 20]], [[0.8, 0.1, 0.1]]), None, 1, CONFIG)
    assert len(evidence.uv) == frame.depth.size - 15 * 15
    nothing = np.tile([0.01, 0.01, 0.01, 0.099], (len(evidence.uv), 1))
    np.testing.assert_allclose(np.exp(evidence.log_p), nothing, rtol=1e-5)


def test_a_mask_says_which_pixels_and_its_box_does_not():
    frame = make_frame()
    mask = np.zeros((1, *frame.depth.shape), dtype=bool)
    mask[0, 8:12, 9:13] = True
    evidence = evidence_of(frame, detections([[7, 5, 22, 20]], [[0.8, np.nan, 0.05]], mask=mask), None, 2, CONFIG)
    np.testing.assert_allclose(of_pixel(evidence, 10, 8), [0.8, 0.01, 0.05, 0.02], rtol=1e-5)
    assert np.sum(evidence.log_p[:, 0] > np.log(0.02)) == 2 * 2  # rows 8 and 10, columns 10 and 12
    np.testing.assert_allclose(of_pixel(evidence, 16, 12), [0.01, 0.01, 0.01, 0.099], rtol=1e-5)


def test_a_detection_whose_mask_is_empty_has_its_box():
    frame = make_frame(left=1.0)
    masks = np.zeros((2, *frame.depth.shape), dtype=bool)
    masks[1, 8:12, 9:13] = True
    boxes = [[20, 5, 27, 20], [9, 8, 13, 12]]
    evidence = evidence_of(frame, detections(boxes, [[0.7, 0, 0], [0, 0.9, 0]], mask=masks), None, 1, CONFIG)
    np.testing.assert_allclose(of_pixel(evidence, 23, 12)[0], 0.7, rtol=1e-3)
    np.testing.assert_allclose(of_pixel(evidence, 10, 10)[:2], [0.01, 0.9], rtol=1e-5)


@pytest.mark.parametrize(
    "found",
    [
        detections([[7, 5, 22, 20]], [[0.1, 0.19, 0.0]]),  # below `refined_from`
        detections([[7, 5, 22, 20]], [[0.9, 0.1, 0.0]], part=np.array([Part.TOP])),
        Detections.empty(CLASSES),
    ],
)
def test_doubtful_boxes_halves_and_nothing_say_nothing(found):
    evidence = evidence_of(make_frame(), found, None, 2, CONFIG)
    np.testing.assert_allclose(evidence.log_p[:, :3], np.log(0.01), rtol=1e-6)


def test_maps_are_taken_as_they_are_within_bounds():
    frame = make_frame()
    rng = np.random.default_rng(0)
    p = rng.uniform(0.02, 0.9, (3, *frame.depth.shape)).astype(np.float32)
    p[0, 4, 6] = 1e-6
    maps = ProbabilityMaps.of(CLASSES, p, alpha=0.3)
    evidence = evidence_of(frame, detections([[7, 5, 22, 20]], [[0.99, 0.0, 0.0]]), maps, 2, CONFIG)
    np.testing.assert_allclose(of_pixel(evidence, 8, 6), [*p[:, 6, 8], 0.3 * (1.0 - p[:, 6, 8].max())], rtol=1e-5)
    np.testing.assert_allclose(of_pixel(evidence, 6, 4)[0], 0.015, rtol=1e-5)


def test_pixels_are_every_so_many_whose_depth_is_in_range():
    frame = make_frame(left=3.0)
    frame.depth[0, 0], frame.depth[4, 20] = 0.0, 0.1
    uv = pixel_grid(frame, 4, 0.2, 2.0)
    assert (uv % 4 == 0).all() and uv[:, 0].min() == 16 and [20, 4] not in uv.tolist() and uv.dtype == np.int32
    assert len(uv) == 4 * 6 - 1 and len(pixel_grid(frame, 4, 0.0, 9.0)) == 8 * 6 - 1


def test_evidence_in_the_order_of_other_classes():
    evidence = PixelEvidence(("bowl", "Cup"), np.array([[1, 2]]), np.log([[0.5, 0.2, 0.05]]).astype(np.float32))
    np.testing.assert_allclose(np.exp(evidence.over(CLASSES, 0.01).log_p), [[0.2, 0.5, 0.01, 0.05]], rtol=1e-5)
    assert evidence.over(("bowl", "Cup"), 0.01) is evidence


def test_evidence_of_other_shapes_or_of_certainty_is_refused():
    uv = np.zeros((2, 2), np.int32)
    with pytest.raises(ValueError, match="shape"):
        PixelEvidence(CLASSES, uv, np.zeros((2, 3), np.float32))
    with pytest.raises(ValueError, match="finite"):
        PixelEvidence(CLASSES, uv, np.full((2, 4), -np.inf, np.float32))


@pytest.mark.parametrize("wrong", [{"least": 0.0}, {"alpha": 0.0}, {"near": 5.0}, {"volumes": -1.0}, {"gamma": -1.0}])
def test_numbers_out_of_range_are_told(wrong):
    with pytest.raises(UserError, match="expected"):
        SourceConfig(**wrong)

"""Hypotheses given to proposals."""

import numpy as np
import pytest

from thingmap.detectors.shape_context.hypotheses import Hypotheses
from thingmap.detectors.shape_context.verification import class_scores

PROPOSALS = np.array([(0.0, 0.0, 20.0, 20.0), (50.0, 0.0, 70.0, 20.0)])


def hypotheses(*rows: tuple[float, float, float, float]) -> Hypotheses:
    """Rows of x, y of the middle in pixels from the image's edge, side, score."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    return Hypotheses(table[:, :2] - 0.5, table[:, 3], table[:, [2, 2]], tuple(np.array([0]) for _ in rows))


def test_scores_are_normalised_by_the_edges_of_the_class(codebook):
    book = codebook([(0, 0)], edge_mean=10.0, edge_std=2.0)
    scores, boxes = class_scores([hypotheses((10, 10, 20, 14.0))], [book], PROPOSALS, 0.5)
    assert scores[0, 0] == pytest.approx(2.0) and np.isnan(scores[1, 0])
    np.testing.assert_allclose(boxes[0, 0], PROPOSALS[0])
    assert np.isnan(boxes[1]).all()


def test_a_hypothesis_that_overlaps_too_little_is_removed(codebook):
    few = hypotheses((10, 10, 40, 14.0), (62, 10, 20, 12.0))  # overlap 1/4 and 0.82
    scores, _ = class_scores([few], [codebook([(0, 0)])], PROPOSALS, 0.5)
    assert np.isnan(scores[0, 0]) and scores[1, 0] == pytest.approx(1.0)


def test_the_best_of_several_counts_and_classes_do_not_mix(codebook):
    both = [hypotheses((10, 10, 20, 12.0), (11, 10, 20, 16.0), (10, 11, 20, 11.0)), hypotheses((60, 10, 20, 8.0))]
    scores, boxes = class_scores(both, [codebook([(0, 0)])] * 2, PROPOSALS, 0.5)
    assert scores[0, 0] == pytest.approx(3.0) and np.isnan(scores[0, 1])
    assert scores[1, 1] == pytest.approx(-1.0) and np.isnan(scores[1, 0])
    np.testing.assert_allclose(boxes[0, 0], (1.0, 0.0, 21.0, 20.0))


def test_nothing_proposed_or_nothing_found(codebook):
    scores, boxes = class_scores([hypotheses((10, 10, 20, 14.0))], [codebook([(0, 0)])], np.zeros((0, 4)), 0.5)
    assert scores.shape == (0, 1) and boxes.shape == (0, 1, 4)
    scores, _ = class_scores([hypotheses()], [codebook([(0, 0)])], PROPOSALS, 0.5)
    assert np.isnan(scores).all()

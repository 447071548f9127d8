"""What whole contours say."""

import numpy as np
import pytest

from thingmap.detectors.shape_context.contour import contour_evidence


def test_by_hand():
    own = np.array([[0.1, 0.3], [0.2, 0.2], [0.5, 0.5]])
    rival = np.array([[0.4, 0.4], [0.1, 0.1], [0.5, 0.5]])
    found = contour_evidence(own, rival, np.array([0, 0, 2]), 4, 0.1)
    assert found.tolist() == pytest.approx([(2.0 - 1.0) / 2, 0.0, 0.0, 0.0])


def test_points_without_a_context_say_nothing():
    own, rival = np.array([[0.1], [np.inf]]), np.array([[0.3], [np.inf]])
    assert contour_evidence(own, rival, np.array([0, 0]), 1, 0.2) == pytest.approx([1.0])

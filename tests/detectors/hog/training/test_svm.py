import sys

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.detectors.hog.training.svm import check_installed, fit_svm


def loss(weights, bias, samples, labels, cost):
    return 0.5 * weights @ weights + cost * np.square(np.maximum(0.0, 1.0 - labels * (samples @ weights + bias))).sum()


def test_the_weights_minimise_the_loss():
    rng = np.random.default_rng(0)
    positives, negatives = rng.normal(0.5, 1.0, (40, 6)), rng.normal(-0.5, 1.0, (90, 6))
    weights, bias = fit_svm(positives.astype(np.float16), negatives.astype(np.float16), 0.05)
    samples = np.concatenate([positives, negatives]).astype(np.float16).astype(np.float64)
    labels = np.repeat([1.0, -1.0], [40, 90])
    least = loss(weights, bias, samples, labels, 0.05)
    for _ in range(200):
        step = rng.normal(0.0, 0.02, 7)
        assert loss(weights + step[:6], bias + step[6], samples, labels, 0.05) > least - 1e-3 * least


def test_two_points_are_parted_in_the_middle():
    weights, bias = fit_svm(np.array([[3.0, 0.0]]), np.array([[1.0, 0.0]]), 1000.0)
    np.testing.assert_allclose(weights, [1.0, 0.0], atol=0.02)
    assert bias == pytest.approx(-2.0, abs=0.04)


def test_without_scikit_learn_the_remedy_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.svm", None)
    with pytest.raises(UserError, match=r"\[train\]"):
        check_installed()

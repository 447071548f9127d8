import numpy as np
import pytest

from thingmap.datasets.object_views.backgrounds import Background
from thingmap.detectors.shape_context.calibration import FEATURES
from thingmap.detectors.shape_context.training.calibrating import Samples, even_weights, fit, without_own
from thingmap.detectors.shape_context.training.config import TrainConfig
from thingmap.detectors.shape_context.training.scenes import NEITHER, shown


def background(labels: tuple[str, ...], *boxes: tuple[float, ...]) -> Background:
    xyxy = np.array(boxes, dtype=np.float64).reshape(-1, 4)
    return Background("wall", np.zeros((9, 9, 3), np.uint8), None, 300.0, labels, xyxy, np.ones(len(labels)))


def test_what_a_box_shows():
    known = background(("mug", "lamp"), (0, 0, 10, 10), (50, 0, 60, 10))
    boxes = np.array([[0, 0, 10, 8], [0, 0, 4, 10], [50, 0, 60, 9], [20, 20, 30, 30]], dtype=np.float64)
    classes = ("bowl", "mug")
    assert shown(boxes, known, classes, TrainConfig()).tolist() == [1, NEITHER, 2, 2]  # nobody asked for lamps
    assert shown(boxes, background(()), classes, TrainConfig()).tolist() == [2, 2, 2, 2]


def features(strength: np.ndarray) -> np.ndarray:
    """(N, C, F): hypotheses of these strengths (N, C), NaN for none, and nothing else."""
    found = np.zeros((*strength.shape, len(FEATURES)))
    found[..., FEATURES.index("hypothesis")] = np.isfinite(strength)
    found[..., FEATURES.index("log strength")] = np.nan_to_num(strength)
    return found


def test_all_labels_weigh_the_same_whatever_was_sampled():
    label = np.array([0] * 10 + [1] * 2 + [2] * 30)
    sums = np.bincount(label, even_weights(label))
    assert sums.sum() == pytest.approx(42) and sums == pytest.approx([14.0, 14.0, 14.0])
    assert even_weights(np.array([0, 2])) == pytest.approx([1.0, 1.0])  # nobody is of class 1


def test_an_object_without_its_own_class():
    scores = features(np.array([[1.0, 2.0], [3.0, np.nan]]))
    scores[..., FEATURES.index("objectness")] = 4.0
    found = without_own(scores, np.array([0, 1]))
    assert found[0, 0].tolist() == [0.0, 0.0, 0.0, 0.0, 4.0]
    np.testing.assert_array_equal(found[0, 1], scores[0, 1])
    np.testing.assert_array_equal(found[1, 0], scores[1, 0])


def test_a_score_that_says_nothing_gives_the_prior():
    rng = np.random.default_rng(0)
    samples = Samples(features(rng.normal(size=(600, 2))), np.repeat([0, 1, 2], [100, 300, 200]), True)
    assert samples.counts().tolist() == [100, 300, 200]
    p = fit(samples).distribution(features(np.zeros((1, 2))))[0]
    assert p == pytest.approx([1 / 3, 1 / 3, 1 / 3], abs=0.05)


def test_a_score_that_tells_all_is_believed():
    label = np.repeat([0, 1, 2], 100)
    scores = np.where(np.arange(3)[:2] == label[:, None], 2.0, -2.0)
    p = fit(Samples(features(scores), label, True)).distribution(features(np.array([[2.0, -2.0], [np.nan, np.nan]])))
    assert p[0, 0] > 0.9

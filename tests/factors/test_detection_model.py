"""P_D: at its knots, between and beyond them, mixed over classes, and what a miss then counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import expit, logit

from thingmap.factors.detection_model import LOG2_SIDE_KNOTS, VISIBLE_KNOTS, DetectionModel
from thingmap.factors.visibility import VolumePart

CLASSES = ("mug", "bowl", "cereal box")
shares, sides = st.floats(0.0, 1.0), st.floats(0.0, 2000.0)


def made_up(seed: int = 0) -> DetectionModel:
    """Every number differs from every other; neither curve is monotone."""
    rng = np.random.default_rng(seed)
    return DetectionModel(
        CLASSES, rng.normal(0.5, 1.0, (4, 5)), rng.normal(-1.0, 2.0, (5, 7)), rng.normal(-1.0, 2.0, (5, 8))
    )


MODEL = made_up()


@pytest.mark.parametrize("part", VolumePart)
def test_the_logit_adds_up_at_the_knots(part):
    probability = MODEL.probability(VISIBLE_KNOTS[:, None], 2.0 ** LOG2_SIDE_KNOTS[None, :], part)
    expected = MODEL.intercept[-1, part] + MODEL.visible[part][:, None] + MODEL.side[part][None, :]
    np.testing.assert_allclose(logit(probability), expected, atol=1e-9)


def test_the_logit_is_linear_between_the_knots_and_constant_beyond():
    def at(visible: float, side_px: float) -> float:
        return float(logit(MODEL.probability(visible, side_px, 1)))

    assert at(0.7, 32.0) == pytest.approx((at(0.6, 32.0) + at(0.8, 32.0)) / 2.0)
    assert at(0.5, 2.0**5.25) == pytest.approx(0.75 * at(0.5, 32.0) + 0.25 * at(0.5, 64.0))  # in log2 of pixels
    assert at(0.5, 0.0) == at(0.5, 1.0) == at(0.5, 4.0) and at(0.5, 512.0) == at(0.5, 4000.0)
    assert at(-0.1, 32.0) == at(0.0, 32.0) and at(1.1, 32.0) == at(1.0, 32.0)


def test_objects_are_mixed_over_their_class_posterior():
    visible, side = np.array([1.0, 0.5, 0.4, 0.9]), np.array([20.0, 60.0, 90.0, 300.0])
    posterior = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.3, 0.2], [0.25, 0.15, 0.1]])
    probability = MODEL.probability(visible, side, 2, posterior)
    by_class = expit(
        logit(MODEL.probability(visible, side, 2))[:, None] + MODEL.intercept[:3, 2] - MODEL.intercept[3, 2]
    )
    np.testing.assert_allclose(probability[:2], [by_class[0, 0], by_class[1, 2]])
    np.testing.assert_allclose(probability[2:], by_class[2:] @ [0.5, 0.3, 0.2])  # scaled to sum 1


def test_an_object_of_no_known_class_is_pooled():
    visible, side, posterior = (
        np.array([0.9, 0.9]),
        np.array([50.0, 50.0]),
        np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    )
    probability = MODEL.probability(visible, side, 0, posterior)
    assert probability[0] == MODEL.probability(0.9, 50.0)
    assert probability[1] != probability[0]


def test_no_objects_are_no_mistake():
    assert MODEL.probability(np.zeros(0), np.zeros(0), 0, np.zeros((0, 3))).shape == (0,)
    assert MODEL.relative(np.zeros(0), np.zeros(0), 0, np.zeros((0, 3))).shape == (0,)


@settings(deadline=None, derandomize=True, max_examples=150)
@given(
    st.integers(0, 5),
    st.lists(st.tuples(shares, sides), min_size=1, max_size=4),
    st.sampled_from(list(VolumePart)),
    st.one_of(st.none(), st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3)),
)
def test_a_miss_counts_in_proportion_to_p_d_and_at_most_once(seed, looks, part, weights):
    model = made_up(seed)
    visible, side = np.array(looks).T
    posterior = None if weights is None else np.tile(weights, (len(looks), 1))
    relative, probability = (f(visible, side, part, posterior) for f in (model.relative, model.probability))
    assert ((relative >= 0.0) & (relative <= 1.0 + 1e-12)).all()
    best = VISIBLE_KNOTS[np.argmax(model.visible[part])], 2.0 ** LOG2_SIDE_KNOTS[np.argmax(model.side[part])]
    largest = model.probability(np.full(len(looks), best[0]), np.full(len(looks), best[1]), part, posterior)
    shown = visible >= 0.3
    np.testing.assert_allclose(relative[shown] * largest[shown], probability[shown])


@pytest.mark.parametrize("visible", [0.0, 0.1, 0.29])
def test_missing_what_is_hidden_counts_nothing_at_all(visible):
    """However often: 1,000 hidden frames must not add up."""
    confident = replace(MODEL, visible=np.zeros((5, 7)), side=np.zeros((5, 8)))
    assert confident.relative(visible, 100.0) == 0.0
    assert confident.relative(0.31, 100.0) == 1.0


def test_classes_that_were_not_learned_get_the_pooled_row():
    bound = MODEL.bind(["sofa", "Cereal-Box"])
    np.testing.assert_array_equal(bound.intercept, MODEL.intercept[[3, 2, 3]])
    one_hot = np.array([[1.0, 0.0]])
    assert bound.probability(np.array([0.9]), np.array([50.0]), 3, one_hot)[0] == MODEL.probability(0.9, 50.0, 3)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"intercept": np.zeros((3, 5))}, r"intercept of shape \(3, 5\) instead of \(4, 5\)"),
        ({"visible": np.zeros((5, 8))}, "visible of shape"),
        ({"side": np.full((5, 8), np.nan)}, r"side\[0, 0\] = nan"),
        ({"side": np.full((5, 8), -1e3)}, "a number from -50 to 50"),
    ],
)
def test_wrong_numbers_are_refused(change, says):
    with pytest.raises(ValueError, match=says):
        replace(MODEL, **change)

"""The information of one more look, against cases that can be worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.evidence_model import EvidenceModel, generic_evidence_model, load_evidence_model
from thingmap.mapper.queries.information_gain import Questions, make_questions
from thingmap.mapper.queries.information_kernel import SCORE_BINS, fill_likelihood

CLASSES = ("cup", "bowl", "bottle")
ONE = np.ones(1)
NONE = np.zeros(1)


def model_of(classes: tuple[str, ...] = CLASSES) -> EvidenceModel:
    return generic_evidence_model().bind(classes)


def says_nothing_by_scores(model: EvidenceModel) -> EvidenceModel:
    """A detector of two outcomes: found, and not found; the scores are the same with and without an object."""
    s = model.scores
    mean, sigma = np.full(s.mean.shape, 0.4), np.full(s.sigma.shape, 0.2)
    scores = replace(
        s, mean=mean, sigma=sigma, background_mean=mean[..., 0], background_sigma=sigma[..., 0], confusion=np.zeros(5)
    )
    return replace(model, scores=scores)


def entropy(*p: float) -> float:
    return float(-sum(x * np.log2(x) for x in p if x > 0.0))


def gain(questions: Questions, visible: float = 1.0, expected: float = 1.0) -> float:
    return float(questions.gains(np.zeros(1, np.int64), np.array([visible]), np.array([expected]))[0])


@pytest.mark.parametrize("expected", [1.0, 0.5, 0.1])
@pytest.mark.parametrize("existence", [0.5, 0.2, 0.97])
def test_a_detector_of_two_outcomes_is_a_binary_channel(existence: float, expected: float) -> None:
    model = says_nothing_by_scores(model_of(("cup",)))
    questions = make_questions(ONE * existence, np.ones((1, 1)), NONE, NONE, model)
    (a, b), (c, d) = model.existence.object_rate, model.existence.none_rate
    found, false = expected * a / (a + b), expected * c / (c + d)
    total = existence * found + (1.0 - existence) * false
    conditional = existence * entropy(found, 1.0 - found) + (1.0 - existence) * entropy(false, 1.0 - false)
    by_hand = entropy(total, 1.0 - total) - conditional
    assert gain(questions, expected=expected) == pytest.approx(by_hand, abs=1e-9)


def test_what_was_found_before_is_found_again_and_tells_less() -> None:
    model = says_nothing_by_scores(model_of(("cup",)))
    fresh = make_questions(ONE * 0.5, np.ones((1, 1)), NONE, NONE, model)
    known = make_questions(ONE * 0.5, np.ones((1, 1)), ONE * 12, NONE, model)
    assert gain(known) < 0.3 * gain(fresh)


def test_names_tell_classes_apart_as_worked_out_by_hand() -> None:
    """No confusion, no steady mistakes, always there: a detection names the class, and a miss leaves it open."""
    model = says_nothing_by_scores(model_of(("cup", "bowl")))
    model = replace(model, existence=replace(model.existence, steady_confusion=1e-12))
    questions = make_questions(ONE, np.array([[0.7, 0.3]]), NONE, NONE, model)
    a, b = model.existence.object_rate
    assert gain(questions) == pytest.approx(a / (a + b) * entropy(0.7, 0.3), abs=1e-6)


@pytest.mark.parametrize("classes", [("cup",), ("cup", "bowl"), CLASSES, tuple("abcdefgh")])
def test_outcomes_of_every_hypothesis_sum_to_one(classes: tuple[str, ...]) -> None:
    model, K = model_of(classes), len(classes)
    posterior = np.arange(1.0, K + 1.0)[None] / np.arange(1.0, K + 1.0).sum()
    q = make_questions(ONE * 0.6, posterior, ONE, ONE, model)
    J = q.looks_like.shape[1]
    likelihood = np.empty((1 + J * SCORE_BINS, J + 1))
    states = q.looks_like[0], q.steady[0], q.counts[0], q.own[0, :, 1], q.own_sigma[0, :, 1]
    fill_likelihood(likelihood, 0.8, *states, q.background[0], q.rates[0], q.confusion)
    assert np.all(likelihood >= 0.0)
    np.testing.assert_allclose(likelihood.sum(axis=0), 1.0, atol=1e-9)


@pytest.mark.parametrize("load", [generic_evidence_model, load_evidence_model])
@pytest.mark.parametrize("labels", [None, [0], [0, 2]])
def test_more_in_sight_never_tells_less(load, labels: list[int] | None) -> None:
    """The search for the best viewpoints rests on this."""
    model = load()
    model = model.bind(model.classes or CLASSES)
    K = len(model.classes)
    rng = np.random.default_rng(4)
    posterior = rng.dirichlet(np.full(K, 0.5), size=20)
    q = make_questions(
        rng.uniform(0.05, 0.99, 20), posterior, rng.uniform(0, 5, 20), rng.uniform(0, 2, 20), model, labels
    )
    visible = np.linspace(0.0, 1.0, 41)
    for n in range(20):
        expected = model.detection.relative(visible, 80.0, posterior=posterior[n])
        gains = q.gains(np.full(41, n), visible, expected)
        assert gains[0] == 0.0
        assert gains[-1] > 0.0
        assert np.all(np.diff(gains) >= -0.02 * gains.max())


@settings(max_examples=60, deadline=None)
@given(
    existence=st.floats(0.0, 1.0),
    weights=st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7),
    luck=st.tuples(st.floats(0.0, 20.0), st.floats(0.0, 20.0)),
    visible=st.floats(0.0, 1.0),
    expected=st.floats(0.0, 1.0),
    labels=st.sampled_from([None, [0], [6], [0, 1, 2, 3, 6]]),
)
def test_no_look_tells_more_than_is_unknown(existence, weights, luck, visible, expected, labels) -> None:
    model = model_of(tuple("abcdefg"))
    posterior = np.array(weights)[None] / max(sum(weights), 1.0)
    q = make_questions(ONE * existence, posterior, ONE * luck[0], ONE * luck[1], model, labels)
    told = gain(q, visible, expected)
    assert 0.0 <= told <= q.bits[0] + 1e-9


def test_what_hardly_exists_tells_nothing() -> None:
    posterior = np.array([[0.0] * 6 + [1.0]])
    q = make_questions(ONE * 2.2e-313, posterior, NONE, NONE, model_of(tuple("abcdefg")))
    assert gain(q) == 0.0 and q.bits[0] == 0.0


def test_a_label_asks_for_less_than_everything_and_is_never_among_the_others() -> None:
    model = model_of(tuple("abcdefg"))
    posterior = np.array([[0.3, 0.25, 0.2, 0.1, 0.08, 0.05, 0.02]])
    whole = make_questions(ONE * 0.7, posterior, NONE, NONE, model)
    rare = make_questions(ONE * 0.7, posterior, NONE, NONE, model, labels=[6])
    assert rare.bits[0] == pytest.approx(entropy(0.7 * 0.02, 1.0 - 0.7 * 0.02))
    assert 0.0 < gain(rare) < gain(whole)


def test_a_sure_thing_leaves_nothing_to_learn() -> None:
    q = make_questions(ONE, np.array([[1.0, 0.0, 0.0]]), ONE, NONE, model_of())
    assert q.bits[0] == 0.0
    assert gain(q) == 0.0


def test_a_class_that_only_a_steady_mistake_could_hide_shows_no_better_next_time() -> None:
    model = model_of()
    careless = replace(model, existence=replace(model.existence, steady_confusion=1e-9))
    posterior = np.array([[0.97, 0.02, 0.01]])
    gains = [gain(make_questions(ONE, posterior, ONE * 5, NONE, m)) for m in (model, careless)]
    assert gains[0] < 0.6 * gains[1]

"""How evidence adds up, against the sums and integrals that it stands for."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import softmax
from scipy.stats import beta

from thingmap.factors.existence import Evidence, ExistenceModel

MODEL = ExistenceModel(
    null_prior=0.4,
    object_rate=(4.0, 2.0),
    none_rate=(1.0, 5.0),
    score_correlation=0.5,
    steady_confusion=0.1,
    surface=0.3,
    weight_score=0.8,
    weight_rate=0.7,
    weight_free=0.6,
    weight_depth=0.5,
    weight_size=0.9,
)
WEIGHTS = ("weight_score", "weight_rate", "weight_free", "weight_depth", "weight_size")
QUICK = settings(max_examples=50, deadline=None)
NATS, VIEWS = st.floats(-8.0, 8.0), st.floats(0.0, 20.0)


def make(classes: int = 3, **given: object) -> Evidence:
    """One row without evidence but what is given."""
    rows, zeros = 1, np.zeros(1)
    nothing = dict.fromkeys(("score_views", "hits", "misses", "free", "depth"), zeros)
    by_class = {"own": np.zeros((rows, classes)), "excess": np.zeros((rows, classes))}
    values = nothing | by_class | {"log_size": np.zeros((rows, classes + 1))}
    return Evidence(**values | {k: np.array(v, dtype=float).reshape(values[k].shape) for k, v in given.items()})


def given_by(values: dict[str, list[float]]) -> Evidence:
    return make(3, **values)


def random(seed: int, classes: int, rows: int = 1) -> Evidence:
    rng = np.random.default_rng(seed)
    shapes = {"own": classes, "excess": classes, "log_size": classes + 1}
    values = {name: rng.normal(0.0, 2.0, (rows, width)) for name, width in shapes.items()}
    counts = {name: rng.uniform(0.0, 6.0, rows) for name in ("score_views", "hits", "misses")}
    return Evidence(**values, **counts, free=rng.normal(0.0, 3.0, rows), depth=rng.normal(0.0, 3.0, rows))


def integrated_rate(prior: tuple[float, float], hits: float, misses: float) -> float:
    """p(hits, misses) with the detection rate integrated out numerically."""
    return quad(lambda r: beta.pdf(r, *prior) * r**hits * (1.0 - r) ** misses, 0.0, 1.0, epsabs=1e-14)[0]


def enumerated(model: ExistenceModel, e: Evidence, row: int = 0) -> np.ndarray:
    """(K + 1,) posterior by summing out, one by one: what it looks like, its detection rate, and a surface there."""
    K, pi, rho = e.own.shape[1], model.steady_confusion, model.score_correlation
    own, views = e.own[row], e.score_views[row]
    background = [own[m] + e.excess[row, m] / (1.0 + rho * max(views - 1.0, 0.0)) for m in range(K)]
    weight = np.zeros(K + 1)
    rate = integrated_rate(model.object_rate, e.hits[row], e.misses[row])
    no_rate = integrated_rate(model.none_rate, e.hits[row], e.misses[row])
    for k, looks_like in itertools.product(range(K + 1), range(K)):
        if k == 0:
            scores = math.exp(background[looks_like]) / K
        elif looks_like == k - 1:
            scores = (1.0 - pi if K > 1 else 1.0) * math.exp(own[looks_like])
        else:
            scores = pi / (K - 1) * math.exp(background[looks_like])
        weight[k] += scores
    weight **= model.weight_score
    weight[0] *= model.null_prior * no_rate**model.weight_rate
    weight[1:] *= (1.0 - model.null_prior) / K * rate**model.weight_rate
    for total, power in ((e.free[row], model.weight_free), (e.depth[row], model.weight_depth)):
        surface = model.surface * math.exp(total) + 1.0 - model.surface  # it looks like an object, or it is empty
        weight[0] *= surface**power
        weight[1:] *= math.exp(total) ** power
    weight *= np.exp(model.weight_size * e.log_size[row])
    return weight / weight.sum()


@pytest.mark.parametrize("classes", [2, 3, 5])
@pytest.mark.parametrize("seed", range(6))
def test_the_posterior_is_that_of_the_enumeration(seed, classes):
    evidence = random(seed, classes, rows=3)
    got = softmax(MODEL.log_belief(evidence), axis=1)
    expected = [enumerated(MODEL, evidence, row) for row in range(3)]
    np.testing.assert_allclose(got, expected, rtol=1e-6)


def test_with_weights_one_the_rate_is_its_integral():
    for hits, misses in ((0.0, 0.0), (3.0, 0.0), (0.0, 3.0), (2.5, 1.25), (20.0, 7.0)):
        ratio = MODEL.rate_ratio(np.array([hits]), np.array([misses]))[0]
        object_, none = (integrated_rate(prior, hits, misses) for prior in (MODEL.object_rate, MODEL.none_rate))
        assert ratio == pytest.approx(math.log(object_ / none), abs=1e-8)


def test_without_evidence_there_is_the_prior():
    posterior = softmax(MODEL.log_belief(make(classes=4))[0])
    np.testing.assert_allclose(posterior, [0.4, 0.15, 0.15, 0.15, 0.15])
    np.testing.assert_allclose(np.exp(MODEL.log_prior(4)).sum(), 1.0)


GIVEN = {
    "weight_score": {"own": [2.0, -1.0, 0.5], "excess": [-3.0, 1.0, 0.0], "score_views": [2.0]},
    "weight_rate": {"hits": [3.0], "misses": [1.0]},
    "weight_free": {"free": [-4.0]},
    "weight_depth": {"depth": [-4.0]},
    "weight_size": {"log_size": [0.5, 2.0, -3.0, 0.0]},
}


@pytest.mark.parametrize("weight", WEIGHTS)
def test_a_weight_of_zero_switches_its_term_off_and_no_other(weight):
    prior = MODEL.log_belief(make())
    off = replace(MODEL, **{weight: 0.0})
    for term, values in GIVEN.items():
        with_term, without = MODEL.log_belief(given_by(values)), off.log_belief(given_by(values))
        shift = with_term - prior
        assert np.ptp(shift) > 0.3
        np.testing.assert_allclose(np.ptp(without - prior) if term == weight else without - with_term, 0.0, atol=1e-9)


@given(seed=st.integers(0, 10_000), order=st.permutations(range(4)))
@QUICK
def test_the_order_of_the_classes_does_not_matter(seed, order):
    e = random(seed, 4)
    size = e.log_size[:, [0, *(k + 1 for k in order)]]
    shuffled = replace(e, own=e.own[:, order], excess=e.excess[:, order], log_size=size)
    straight = MODEL.log_belief(e)[0]
    np.testing.assert_allclose(MODEL.log_belief(shuffled)[0], straight[[0, *(k + 1 for k in order)]], atol=1e-9)


@given(hits=VIEWS, misses=VIEWS, more=st.floats(0.01, 10.0))
@QUICK
def test_more_hits_speak_for_an_object_and_more_misses_against_it(hits, misses, more):
    h, m = np.array([hits, hits + more, hits]), np.array([misses, misses, misses + more])
    ratio = MODEL.rate_ratio(h, m)
    assert ratio[1] > ratio[0] > ratio[2]


@given(total=st.floats(-200.0, 200.0))
@QUICK
def test_a_surface_speaks_for_an_object_only_once_and_emptiness_without_a_limit(total):
    for term in ("free", "depth"):
        belief = replace(MODEL, weight_free=1.0, weight_depth=1.0).log_belief(given_by({term: [total]}))
        ratio = (belief - MODEL.log_prior(3))[0, 1]
        assert ratio <= -math.log(MODEL.surface) + 1e-9
        if total < -5.0:
            assert ratio == pytest.approx(total - math.log(1.0 - MODEL.surface), abs=0.01)


def test_naming_speaks_for_an_object_by_its_height_alone():
    """Scores as background gives them, of whichever class and however often, leave existence where it was."""
    for views in (1.0, 10.0, 100.0):
        own = views * np.array([3.0, 0.0, 0.0])  # steadily named; as likely of background as of an object
        belief = MODEL.log_belief(make(own=own, score_views=[views]))[0]
        assert 1.0 - softmax(belief)[0] < 1.0 - MODEL.null_prior + 1e-9
        assert np.argmax(belief[1:]) == 0


def test_heights_of_one_object_s_scores_are_correlated():
    """Excess of n views counts as n / (1 + rho (n - 1)) of them."""
    model, ratio = replace(MODEL, weight_score=1.0, steady_confusion=1e-9), []
    for n in (1.0, 4.0, 100.0):
        belief = model.log_belief(make(own=[30.0 * n, 0, 0], excess=[-0.4 * n, 0, 0], score_views=[n]))
        ratio.append((belief - model.log_prior(3))[0])
    for n, row in zip((1.0, 4.0, 100.0), ratio, strict=True):
        expected = 0.4 * n / (1.0 + 0.5 * (n - 1.0)) + math.log(3.0)
        assert row[1] - row[0] == pytest.approx(expected, abs=1e-6)


def test_what_looks_like_another_class_from_every_side_is_not_surely_of_it():
    """A wooden stand that is named microwave in every view is settled by its size."""
    own, size = [40.0, 0.0, 0.0], [0.0, -15.0, 0.0, 0.0]
    named = softmax(MODEL.log_belief(make(own=own, score_views=[10.0]))[0])
    sized = softmax(replace(MODEL, weight_size=1.0).log_belief(make(own=own, score_views=[10.0], log_size=size))[0])
    assert np.argmax(named[1:]) == 0 and named[1] / named[1:].sum() > 0.8
    assert sized[1] / sized[1:].sum() < 0.01


@given(own=st.lists(NATS, min_size=1, max_size=1), excess=NATS, hits=VIEWS, misses=VIEWS)
@QUICK
def test_one_class_is_enough(own, excess, hits, misses):
    belief = MODEL.log_belief(make(classes=1, own=own, excess=[excess], hits=[hits], misses=[misses]))
    assert belief.shape == (1, 2) and np.isfinite(belief).all()


@pytest.mark.parametrize("size", [1e4, 1e6])
def test_extreme_evidence_is_finite(size, recwarn):
    for sign in (-1.0, 1.0):
        x = sign * size
        e = make(
            own=[x, 0.0, -x], excess=[-x, x, 0.0], score_views=[size], hits=[size], misses=[size], free=[x], depth=[x],
            log_size=[x, 0.0, -x, 0.0],
        )  # fmt: skip
        assert np.isfinite(MODEL.log_belief(e)).all()
    assert not recwarn.list


def test_rows_are_landmarks_of_their_own():
    e = random(3, 4, rows=5)
    together = MODEL.log_belief(e)
    names = Evidence.__dataclass_fields__
    alone = [MODEL.log_belief(Evidence(**{n: getattr(e, n)[i : i + 1] for n in names}))[0] for i in range(5)]
    np.testing.assert_allclose(together, alone, atol=1e-12)
    none = Evidence(**{n: getattr(e, n)[:0] for n in names})
    assert MODEL.log_belief(none).shape == (0, 5)

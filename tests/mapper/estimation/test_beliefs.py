"""Class and existence of one landmark: what each kind of evidence does to them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.appearance import AppearanceModel
from thingmap.factors.free_space import FreeSpace
from thingmap.factors.missed import DetectionRate
from thingmap.factors.size_prior import load_size_priors
from thingmap.mapper.config import BeliefConfig
from thingmap.mapper.estimation.beliefs import Belief, SizeSite, ViewHistory, initial_site, propagate

CLASSES = ("cup", "bowl", "bottle", "cereal box", "monitor", "chair")
APPEARANCE, CONFIG = AppearanceModel(), BeliefConfig()
QUICK = settings(max_examples=40, deadline=None)
EMPTY, FILLED = FreeSpace().log_likelihood(np.array([0.9, 0.0]))  # of one view: seen through, and a surface is there


def make(classes: int = len(CLASSES), config: BeliefConfig = CONFIG) -> Belief:
    return Belief(classes, config, DetectionRate(), FreeSpace())


def named(label: str, score: float, other: float = 0.01) -> np.ndarray:
    """(K,) scores of a detector that names one class."""
    scores = np.full(len(CLASSES), other)
    scores[CLASSES.index(label)] = score
    return scores


def steadily_named(label: str, score: float, views: int, size: np.ndarray) -> Belief:
    """Named alike from `views` independent views, its log size measured to 0.1."""
    belief, priors = make(), load_size_priors(CLASSES)
    for _ in range(views):
        belief.add_scores(APPEARANCE.evidence(named(label, score), 0.0), 1.0)
        belief.add_view(1.0, 0.0, 0.0)
    site = SizeSite(size, 1e-6 * np.eye(3))
    result = propagate(size, 0.1**2 * np.eye(3), site, belief.log_belief(), priors, CONFIG.size_outlier)
    belief.update(result.log_z)
    np.testing.assert_allclose(belief.posterior, result.posterior, atol=1e-9)
    return belief


def size_of(label: str) -> np.ndarray:
    return load_size_priors(CLASSES).mean[1 + CLASSES.index(label)]


def belief_in(belief: Belief, label: str) -> float:
    """P(it exists and is a `label`), as a map reports it."""
    return belief.existence * belief.class_posterior()[CLASSES.index(label)]


SCORES = st.lists(st.one_of(st.floats(0.0, 1.0), st.just(float("nan"))), min_size=5, max_size=5).filter(
    lambda s: not np.all(np.isnan(s))
)
VIEWS = st.lists(
    st.tuples(SCORES, st.floats(0.0, 1.0), st.floats(0.05, 1.0), st.booleans(), st.floats(-3.0, 1.0)), max_size=12
)


def fed(views, order: list[int] | None = None) -> Belief:
    belief, columns = make(5), np.arange(5) if order is None else np.array(order)
    for scores, occlusion, weight, hit, free in views:
        if hit:
            belief.add_scores(APPEARANCE.evidence(np.array(scores)[columns], occlusion), weight)
        belief.add_view(weight * hit, weight * (not hit), weight * free)
    belief.update()
    return belief


@given(views=VIEWS)
@QUICK
def test_probabilities_are_probabilities(views):
    belief = fed(views)
    assert np.all(np.isfinite(belief.posterior)) and np.all(belief.posterior >= 0.0)
    assert belief.posterior.sum() == pytest.approx(1.0)
    assert belief.class_posterior().sum() == pytest.approx(1.0)
    assert 0.0 <= belief.existence <= 1.0
    assert belief.existence == pytest.approx(1.0 - belief.posterior[0])


@given(views=VIEWS, order=st.permutations(range(5)))
@QUICK
def test_permuting_the_classes_permutes_the_posterior(views, order):
    straight, shuffled = fed(views), fed(views, order)
    np.testing.assert_allclose(shuffled.posterior[0], straight.posterior[0], atol=1e-9)
    np.testing.assert_allclose(shuffled.posterior[1:], straight.posterior[1:][order], atol=1e-9)


@given(views=VIEWS, order=st.randoms(use_true_random=False))
@QUICK
def test_the_order_of_the_views_does_not_matter(views, order):
    shuffled = list(views)
    order.shuffle(shuffled)
    np.testing.assert_allclose(fed(shuffled).posterior, fed(views).posterior, atol=1e-9)


@given(views=VIEWS, hits=st.floats(0.01, 20.0))
@QUICK
def test_more_hits_never_lower_existence_and_more_misses_never_raise_it(views, hits):
    before, hit, missed = fed(views), fed(views), fed(views)
    hit.add_view(hits, 0.0, 0.0)
    missed.add_view(0.0, hits, 0.0)
    hit.update()
    missed.update()
    assert hit.existence >= before.existence - 1e-12
    assert missed.existence <= before.existence + 1e-12
    for other in (hit, missed):  # which class it is, is another question
        np.testing.assert_allclose(other.class_posterior(), before.class_posterior(), atol=1e-9)


@given(views=VIEWS)
@QUICK
def test_not_being_seen_while_occluded_changes_nothing(views):
    before, after = fed(views), fed(views)
    rate = DetectionRate()
    for visible in (0.0, 0.1, 0.3):
        expected = float(rate.expected(np.array([visible]), np.array([100.0]))[0])
        after.add_view(0.0, expected, 0.0)
    after.update()
    np.testing.assert_allclose(after.posterior, before.posterior, atol=1e-12)


def test_a_box_on_the_occluder_says_nothing_about_the_class():
    before, after = make(), make()
    for belief in (before, after):
        belief.add_scores(APPEARANCE.evidence(named("cup", 0.6), 0.0), 1.0)
    for _ in range(5):
        after.add_scores(APPEARANCE.evidence(named("bowl", 0.9), 0.95), 1.0)
    for belief in (before, after):
        belief.update()
    np.testing.assert_allclose(after.posterior, before.posterior, atol=1e-12)


def test_before_any_evidence_all_classes_are_alike():
    belief = make()
    assert belief.existence == pytest.approx(1.0 - CONFIG.null_prior)
    np.testing.assert_allclose(belief.class_posterior(), 1.0 / len(CLASSES))
    assert belief.effective_views == 0.0


def test_a_volume_that_is_seen_through_loses_existence():
    """Views in which the depth camera looks through it outweigh its detections; a surface there does not."""
    for free, gone in ((EMPTY, True), (FILLED, False)):
        belief = make()
        for _ in range(3):
            belief.add_view(1.0, 0.0, FILLED)
        belief.update()
        before = belief.existence
        for _ in range(6):
            belief.add_view(0.0, 0.0, free)
        belief.update()
        assert (belief.existence < 0.05) if gone else (belief.existence >= before)


def test_a_surface_alone_makes_no_object():
    belief = make()
    belief.add_view(0.0, 0.0, 100.0 * FILLED)
    belief.update()
    assert belief.existence < 0.7


@pytest.mark.parametrize("views", [1, 3, 10, 40])
@pytest.mark.parametrize("score", [0.09, 0.12, 0.15, 0.2])
@pytest.mark.parametrize("size", [size_of("monitor"), size_of("chair"), np.array([-1.0, -4.0, 0.0])])
def test_low_scores_and_a_wrong_size_name_nothing_however_often_they_are_seen(score, views, size):
    assert belief_in(steadily_named("cup", score, views, size), "cup") < 0.5


@pytest.mark.parametrize("label", CLASSES)
@pytest.mark.parametrize("score", [0.4, 0.6, 0.9])
def test_high_scores_and_the_right_size_name_the_object(score, label):
    for views in (3, 10):
        assert belief_in(steadily_named(label, score, views, size_of(label)), label) > 0.9


@pytest.mark.parametrize("score", [0.15, 0.3, 0.6])
def test_the_right_size_makes_the_named_class_likelier(score):
    right, wrong = (belief_in(steadily_named("cup", score, 3, size_of(s)), "cup") for s in ("cup", "monitor"))
    assert right > wrong + 0.1


def test_scores_name_the_class_that_scores():
    for label in CLASSES:
        belief = make()
        for _ in range(3):
            belief.add_scores(APPEARANCE.evidence(named(label, 0.6), 0.0), 1.0)
        belief.update()
        assert CLASSES[int(np.argmax(belief.class_posterior()))] == label


def test_one_class_is_enough_and_extreme_evidence_is_finite(recwarn):
    belief = make(classes=1)
    for _ in range(200):
        belief.add_scores(APPEARANCE.evidence(np.array([0.95]), 0.0), 1.0)
        belief.add_view(1.0, 0.0, 0.0)
    belief.update()
    assert belief.class_posterior() == pytest.approx([1.0]) and belief.existence > 0.99
    belief.add_view(0.0, 1e4, -1e4)
    belief.update()
    assert np.all(np.isfinite(belief.posterior)) and belief.existence < 1e-6
    np.testing.assert_allclose(belief.class_posterior(), 1.0)
    assert not recwarn.list


def test_a_sure_class_makes_no_noise(recwarn):
    belief = make()
    for _ in range(40):
        belief.add_scores(APPEARANCE.evidence(named("cup", 0.9, 0.0), 0.0), 1.0)
    belief.update()
    assert belief_in(belief, "cup") > 0.99
    assert not recwarn.list


def test_absorbed_evidence_counts_as_one_s_own():
    one, other, both = make(), make(), make()
    for belief, label in ((one, "cup"), (other, "bowl"), (both, "cup"), (both, "bowl")):
        belief.add_scores(APPEARANCE.evidence(named(label, 0.5), 0.0), 0.7)
        belief.add_view(1.0, 0.5, -0.3)
    one.absorb(other)
    for belief in (one, both):
        belief.update()
    np.testing.assert_allclose(one.posterior, both.posterior, atol=1e-12)
    assert one.effective_views == pytest.approx(3.0)


def test_a_view_of_either_is_no_new_view_of_both():
    kept, absorbed, place = make(), make(), np.array([1.0, 0.0, 0.5])
    absorbed.views.weight(place)
    kept.absorb(absorbed)
    assert kept.views.weight(place) == CONFIG.min_weight


def test_the_first_site_is_the_mixture_of_the_class_sizes():
    priors, belief = load_size_priors(CLASSES), make()
    sure = np.zeros(len(CLASSES) + 1)
    sure[2] = 1.0
    site = initial_site(priors, sure)
    np.testing.assert_allclose(site.mean, priors.mean[2])
    np.testing.assert_allclose(np.linalg.inv(site.information), priors.covariance[2], atol=1e-9)
    wide = np.linalg.inv(initial_site(priors, belief.posterior).information)
    assert np.linalg.eigvalsh(wide - priors.covariance[2])[0] > 0.0


class TestViewHistory:
    def test_the_first_view_counts_fully_and_the_same_again_hardly(self):
        history, place = ViewHistory(CONFIG), np.array([1.0, 0.5, 0.3])
        assert history.weight(place) == 1.0
        assert history.weight(place) == CONFIG.min_weight
        assert history.weight(1.001 * place) == CONFIG.min_weight

    def test_half_an_angle_away_counts_half(self):
        history = ViewHistory(CONFIG)
        history.weight(np.array([2.0, 0.0, 0.0]))
        a = 0.5 * CONFIG.view_angle
        assert history.weight(2.0 * np.array([np.cos(a), np.sin(a), 0.0])) == pytest.approx(0.5)

    def test_nearer_is_new(self):
        history = ViewHistory(CONFIG)
        history.weight(np.array([2.0, 0.0, 0.0]))
        assert history.weight(np.array([2.0 * np.exp(-CONFIG.view_log_range), 0.0, 0.0])) == pytest.approx(1.0)

    @given(
        places=st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 3).filter(lambda p: np.linalg.norm(p) > 0.1), max_size=90)
    )
    @QUICK
    def test_weights_are_shares_and_a_place_is_new_once(self, places):
        history = ViewHistory(CONFIG)
        weights = [history.weight(np.array(p)) for p in places]
        assert all(CONFIG.min_weight <= w <= 1.0 for w in weights)
        assert all(history.weight(np.array(p)) < 1.0 for p in places[: ViewHistory.MAX_VIEWS // 2])

    def test_twenty_identical_views_say_little_more_than_one(self):
        beliefs = {}
        for views in (1, 20):
            belief = make()
            for _ in range(views):
                weight = belief.views.weight(np.array([1.0, 0.0, 0.5]))
                belief.add_scores(APPEARANCE.evidence(named("cup", 0.5), 0.0), weight)
                belief.add_view(weight, 0.0, 0.0)
            beliefs[views] = belief
        assert beliefs[20].effective_views < 2.0
        independent = make()
        for _ in range(20):
            independent.add_scores(APPEARANCE.evidence(named("cup", 0.5), 0.0), 1.0)
            independent.add_view(1.0, 0.0, 0.0)
        gained = [b.log_belief()[1] - b.log_belief()[0] for b in (beliefs[1], beliefs[20], independent)]
        assert gained[1] - gained[0] < 0.25 * (gained[2] - gained[0])

    def test_a_camera_inside_the_object_is_survived(self):
        history = ViewHistory(CONFIG)
        assert history.weight(np.zeros(3)) == 1.0
        assert np.isfinite(history.weight(np.array([1.0, 0.0, 0.0])))

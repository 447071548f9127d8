"""Class and existence of one landmark: what each kind of evidence does to them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.evidence_model import EvidenceModel, generic_evidence_model
from thingmap.factors.existence import ExistenceModel
from thingmap.factors.free_space import FreeSpace
from thingmap.factors.size_prior import load_size_priors
from thingmap.mapper.config import BeliefConfig, PresenceConfig
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.size_site import SizeSite, propagate

CLASSES = ("cup", "bowl", "bottle", "cereal box", "monitor", "chair")
CONFIG, PRESENCE = BeliefConfig(), PresenceConfig()
# own numbers, so that what is learned or tuned later changes nothing here
STATED = ExistenceModel(
    null_prior=0.5,
    object_rate=(4.0, 2.0),
    none_rate=(1.0, 5.0),
    score_correlation=0.5,
    steady_confusion=0.1,
    surface=0.5,
)
GENERIC = generic_evidence_model()
MODEL = EvidenceModel(GENERIC.scores, GENERIC.detection, STATED, "the numbers of these tests")
SCORES_OF = MODEL.bind(CLASSES).scores
QUICK = settings(max_examples=40, deadline=None)
EMPTY, FILLED = FreeSpace().log_likelihood(np.array([0.9, 0.0]))  # of one view: seen through, and a surface is there


def place(i: int) -> np.ndarray:
    """(3,) metres off the object: 60 directions over the sphere, all of them independent views of each other."""
    height = 1.0 - (2.0 * i + 1.0) / 60.0
    azimuth, ring = math.pi * (1.0 + math.sqrt(5.0)) * i, math.sqrt(1.0 - height**2)
    return 1.5 * np.array([ring * math.cos(azimuth), ring * math.sin(azimuth), height])


def make(classes: int = len(CLASSES)) -> Belief:
    return Belief(classes, MODEL, CONFIG, PRESENCE)


def named(label: str, score: float, other: float = 0.01) -> np.ndarray:
    """(K,) scores of a detector that names one class."""
    scores = np.full(len(CLASSES), other)
    scores[CLASSES.index(label)] = score
    return scores


def seen_as(label: str, score: float, views: int, first: int = 0, other: float = 0.01) -> Belief:
    """Detected and named alike from `views` independent places."""
    belief = make()
    for i in range(first, first + views):
        belief.look(place(i), hits=1.0, scores=SCORES_OF.evidence(named(label, score, other), 0.0))
    belief.update()
    return belief


def steadily_named(label: str, score: float, views: int, size: np.ndarray) -> Belief:
    """The same, its log size measured to 0.1."""
    belief, priors = seen_as(label, score, views), load_size_priors(CLASSES)
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
    st.tuples(SCORES, st.floats(0.0, 1.0), st.integers(0, 7), st.booleans(), st.floats(-3.0, 1.0)), max_size=12
)
FIVE = MODEL.bind(tuple("abcde")).scores


def fed(views, order: list[int] | None = None) -> Belief:
    """From eight places, some of them again and again."""
    belief, columns = make(5), np.arange(5) if order is None else np.array(order)
    for scores, occlusion, where, hit, free in views:
        read = FIVE.evidence(np.array(scores)[columns], occlusion) if hit else None
        belief.look(
            place(where), hits=float(hit), misses=float(not hit), free=free, depth=0.5 * free, seen=1.0, scores=read
        )
    belief.update()
    return belief


@given(views=VIEWS)
@QUICK
def test_probabilities_are_probabilities(views):
    belief = fed(views)
    assert np.all(np.isfinite(belief.posterior)) and np.all(belief.posterior >= 0.0)
    assert belief.posterior.sum() == pytest.approx(1.0)
    assert belief.class_posterior().sum() == pytest.approx(1.0)
    assert 0.0 <= belief.existence <= belief.is_object <= 1.0
    assert belief.is_object == pytest.approx(1.0 - belief.posterior[0])
    assert belief.existence == pytest.approx(belief.is_object * (1.0 - PRESENCE.hazard), rel=1e-3)


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


@given(views=VIEWS, share=st.floats(0.01, 1.0))
@QUICK
def test_more_hits_never_lower_existence_and_more_misses_never_raise_it(views, share):
    before, hit, missed = fed(views), fed(views), fed(views)
    hit.look(place(20), hits=share)
    missed.look(place(20), misses=share)
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
    for i, visible in enumerate((0.0, 0.1, 0.29)):
        after.look(place(20 + i), misses=float(MODEL.detection.relative(visible, 100.0)))
    after.update()
    np.testing.assert_allclose(after.posterior, before.posterior, atol=1e-12)


def test_a_box_on_the_occluder_says_nothing_about_the_class():
    before, after = seen_as("cup", 0.6, 1), seen_as("cup", 0.6, 1)
    for i in range(1, 6):
        after.look(place(i), scores=SCORES_OF.evidence(named("bowl", 0.9), 0.95))
    after.update()
    np.testing.assert_allclose(after.posterior, before.posterior, atol=1e-12)


def test_looks_without_scores_do_not_wear_off_what_scores_said():
    """From one and the same place: found and named once, then hidden or missed for long."""
    before, after = seen_as("cup", 0.6, 1), seen_as("cup", 0.6, 1)
    for _ in range(100):
        after.look(place(0), misses=0.05)
    after.update()
    assert after.class_posterior()[0] > before.class_posterior()[0] - 0.05


def test_looks_that_hardly_tell_do_not_wear_off_hits():
    """Found ten times from one place, then for a thousand looks with one chance in a thousand."""
    belief = make()
    for _ in range(10):
        belief.look(place(0), hits=1.0, free=FILLED, seen=1.0, scores=SCORES_OF.evidence(named("cup", 0.6), 0.0))
    belief.update()
    before = belief.existence
    for _ in range(1000):
        belief.look(place(0), misses=0.001)
    belief.update()
    assert belief.existence > before - 0.01


def test_before_any_evidence_all_classes_are_alike():
    belief = make()
    assert belief.is_object == pytest.approx(1.0 - STATED.null_prior)
    np.testing.assert_allclose(belief.class_posterior(), 1.0 / len(CLASSES))
    assert belief.effective_views == belief.hits == belief.misses == belief.free == 0.0


def test_what_the_looks_said_is_read_off_again():
    belief = make()
    belief.look(place(0), hits=0.75, misses=0.25, free=-0.5, depth=0.3, seen=1.0)
    belief.look(place(1), misses=1.0, free=-2.0, depth=-1.0, seen=1.0)
    assert (belief.hits, belief.misses, belief.free) == pytest.approx((0.75, 1.25, -2.5))
    assert belief.effective_views == pytest.approx(2.0)
    evidence = belief.evidence
    assert evidence.depth.tolist() == pytest.approx([-0.7]) and evidence.own.shape == (1, len(CLASSES))
    assert evidence.score_views.tolist() == [0.0]


def test_log_belief_leaves_the_size_out():
    belief = seen_as("cup", 0.6, 2)
    without = belief.log_belief()
    belief.update(np.arange(len(CLASSES) + 1.0))
    np.testing.assert_allclose(belief.log_belief(), without)
    np.testing.assert_allclose(np.diff(np.log(belief.posterior) - without), 1.0, atol=1e-9)


def test_a_volume_that_is_seen_through_loses_existence():
    """Views in which the depth camera looks through it outweigh its detections; a surface there does not."""
    for free, gone in ((EMPTY, True), (FILLED, False)):
        belief = make()
        for i in range(3):
            belief.look(place(i), hits=1.0, free=FILLED, seen=1.0)
        belief.update()
        before = belief.existence
        for i in range(3, 9):
            belief.look(place(i), free=free, seen=1.0)
        belief.update()
        assert (belief.existence < 0.05) if gone else (belief.existence >= before)


def test_a_surface_alone_makes_no_object():
    belief = make()
    for i in range(60):
        belief.look(place(i), free=FILLED, seen=1.0)
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
        assert CLASSES[int(np.argmax(seen_as(label, 0.6, 3).class_posterior()))] == label


def test_steady_naming_alone_makes_nothing_an_object():
    """What scores as background does, from every side and however often, is no more of an object for it."""
    once, often = make(), make()
    for belief, views in ((once, 1), (often, 40)):
        for i in range(views):
            belief.look(place(i), scores=SCORES_OF.evidence(named("cup", 0.12), 0.0))
        belief.update()
    assert once.existence < 0.5 and often.existence < once.existence
    assert CLASSES[int(np.argmax(often.class_posterior()))] == "cup"


def test_one_class_is_enough_and_extreme_evidence_is_finite(recwarn):
    belief, scores = make(classes=1), MODEL.bind(("cup",)).scores
    for i in range(200):
        belief.look(place(i % 60), hits=1.0, scores=scores.evidence(np.array([0.95]), 0.0))
    belief.update()
    assert belief.class_posterior() == pytest.approx([1.0]) and belief.existence > 0.99
    belief.look(1e3 * place(0), misses=1.0, free=-1e4, depth=-1e4, seen=1.0)
    belief.update()
    assert np.all(np.isfinite(belief.posterior)) and belief.existence < 1e-6
    np.testing.assert_allclose(belief.class_posterior(), 1.0)
    assert not recwarn.list


def test_a_sure_class_makes_no_noise(recwarn):
    assert belief_in(seen_as("cup", 0.9, 40, other=0.0), "cup") > 0.98
    assert not recwarn.list


def test_absorbed_evidence_counts_as_one_s_own():
    one, other, both = make(), make(), make()
    for belief, label, where in ((one, "cup", 0), (other, "bowl", 1), (both, "cup", 0), (both, "bowl", 1)):
        read = SCORES_OF.evidence(named(label, 0.5), 0.0)
        belief.look(place(where), hits=0.7, misses=0.3, free=-0.3, seen=1.0, scores=read)
    one.absorb(other)
    for belief in (one, both):
        belief.update()
    np.testing.assert_allclose(one.posterior, both.posterior, atol=1e-12)
    assert one.effective_views == pytest.approx(2.0)


def test_a_view_of_either_is_no_new_view_of_both():
    kept, absorbed, where = make(), make(), np.array([1.0, 0.0, 0.5])
    absorbed.look(where, hits=1.0)
    assert kept.weight(where) == 1.0
    kept.absorb(absorbed)
    assert kept.weight(where) < 0.1


def test_twenty_identical_views_say_little_more_than_one():
    looks = {"once": [0], "again": [0] * 20, "around": list(range(20))}
    gained, read = {}, SCORES_OF.evidence(named("cup", 0.5), 0.0)
    for name, places in looks.items():
        belief = make()
        for i in places:
            belief.look(place(i), hits=1.0, scores=read)
        gained[name] = belief.log_belief()[1] - belief.log_belief()[0]
        assert name == "around" or belief.effective_views < 1.2
    assert gained["once"] <= gained["again"] < gained["once"] + 0.25 * (gained["around"] - gained["once"])


def look_through(belief: Belief, places: range, seen: float = 1.0) -> None:
    for i in places:
        belief.look_for(place(i), free=0.9, seen=seen, detected=False)
        belief.look(place(i), free=0.0, seen=1.0)
    belief.update()


def test_what_was_taken_away_was_an_object_and_no_longer_exists():
    belief = seen_as("cup", 0.6, 5)
    was = belief.is_object
    look_through(belief, range(5, 15))
    assert belief.is_object == pytest.approx(was) and was > 0.9 and belief.existence < 0.01
    assert belief.class_posterior().argmax() == 0


def test_a_hidden_thing_is_not_forgotten():
    belief = seen_as("cup", 0.6, 5)
    was = belief.existence
    for i in range(1000):
        belief.look_for(place(5 + i % 50), free=0.9, seen=0.0, detected=False)
    assert belief.existence == was


def test_a_merged_landmark_is_there_if_either_is():
    kept, other = seen_as("cup", 0.6, 5), seen_as("cup", 0.6, 5, first=5)
    look_through(kept, range(10, 20))
    assert kept.existence < 0.01
    kept.absorb(other)
    kept.update()
    assert kept.existence > 0.9

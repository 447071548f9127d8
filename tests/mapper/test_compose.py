"""From landmarks to things: labels, probabilities, sizes and their uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.view_log import Verdict, ViewNote
from thingmap.mapper.map.compose import MIN_LISTED, compose_thing, compose_things

CLASSES = ("cup", "bowl", "book")


def landmark(posterior: list[float], number: int = 7) -> Landmark:
    """`posterior`: (1 + K,) "not an object" first."""
    belief = Belief(len(posterior) - 1, generic_evidence_model())
    belief.posterior = np.array(posterior)
    return Landmark(
        number=number,
        belief=belief,
        position=np.array([0.1, 0.2, 0.3]),
        log_size=np.log([0.04, 0.05, 0.06]),
        first_seen=1.5,
        last_seen=9.0,
        covariance=np.diag([1e-4, 2e-4, 3e-4]),
        log_size_covariance=np.diag([0.01, 0.04, 0.09]),
        supporting={1, 2, 3, 4},
        occluded={5, 6},
        contradicting={9},
    )


def test_a_thing_is_its_landmark_in_people_s_terms():
    mark = landmark([0.2, 0.1, 0.6, 0.1])
    thing = compose_thing(mark, CLASSES)
    assert (thing.id, thing.label) == ("thing-0007", "bowl")
    assert thing.existence == mark.belief.existence == pytest.approx(0.8, rel=1e-3)  # it may have been taken away
    assert thing.probability == pytest.approx(0.75)  # given that it exists
    assert thing.class_posterior == pytest.approx({"cup": 0.125, "bowl": 0.75, "book": 0.125})
    np.testing.assert_allclose(thing.size, [0.08, 0.1, 0.12])
    np.testing.assert_allclose(thing.size_std, [0.008, 0.02, 0.036])
    np.testing.assert_allclose(thing.position, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(thing.position_std**2, [1e-4, 2e-4, 3e-4])
    assert (thing.first_seen, thing.last_seen, thing.yaw) == (1.5, 9.0, 0.0)
    assert (thing.evidence.supporting, thing.evidence.occluded, thing.evidence.contradicting) == (4, 2, 1)


def test_the_size_s_deviation_is_that_of_many_draws():
    rng, mark = np.random.default_rng(0), landmark([0.1, 0.9])
    mark.log_size_covariance = np.diag([0.0025, 0.01, 0.0225])
    draws = 2.0 * np.exp(rng.multivariate_normal(mark.log_size, mark.log_size_covariance, 20000))
    np.testing.assert_allclose(compose_thing(mark, ("cup",)).size_std, draws.std(axis=0), rtol=0.05)


def test_classes_that_are_out_of_the_question_are_not_listed():
    tiny = MIN_LISTED / 10.0
    thing = compose_thing(landmark([0.5, 0.5 - tiny, tiny, 0.0]), CLASSES)
    assert set(thing.class_posterior) == {"cup"}
    unsure = compose_thing(landmark([1.0, 0.0, 0.0, 0.0]), CLASSES)  # surely no object: any class
    assert unsure.existence == 0.0 and unsure.class_posterior == pytest.approx(dict.fromkeys(CLASSES, 1 / 3))


def test_a_covariance_that_lost_its_symmetry_in_the_last_bits_is_given_it_back():
    mark = landmark([0.1, 0.9])
    mark.covariance = np.array([[1e-4, 1e-5, 0.0], [1.01e-5, 1e-4, 0.0], [0.0, 0.0, 1e-4]])
    thing = compose_thing(mark, ("cup",))
    np.testing.assert_array_equal(thing.position_covariance, thing.position_covariance.T)
    assert thing.position_covariance[0, 1] == pytest.approx(1.005e-5)


@settings(deadline=None, derandomize=True)
@given(st.lists(st.floats(0.01, 1.0), min_size=4, max_size=4))
def test_belief_in_all_classes_together_is_existence(weights):
    posterior = np.array(weights) / np.sum(weights)
    thing = compose_thing(landmark(posterior.tolist()), CLASSES)
    assert sum(thing.belief(label) for label in CLASSES) == pytest.approx(thing.existence)
    assert thing.belief("bowl") == pytest.approx(posterior[2], rel=1e-3)


def test_things_come_by_number_and_only_where_they_exist_enough():
    marks = [landmark([0.6, 0.4], 3), landmark([0.1, 0.9], 12), landmark([0.4, 0.6], 1)]
    assert [t.id for t in compose_things(marks, ("cup",), 0.5)] == ["thing-0001", "thing-0012"]
    assert [t.id for t in compose_things(marks, ("cup",), 0.0)] == ["thing-0001", "thing-0003", "thing-0012"]
    assert compose_things([], (), 0.5) == ()


def test_a_thing_explains_itself_by_the_views_of_its_landmark_until_now():
    mark = landmark([0.2, 0.1, 0.6, 0.1])
    seen = {"stamp": 1.0, "frame": "a", "visible": np.ones(5), "score": 0.9, "part": 0, "class_id": 1, "weight": 1.0}
    mark.log.append(ViewNote(keyframe=3, log_ratio=[-1.0, 2.0, 0.0], verdict=Verdict.SUPPORTED, **seen))
    thing = compose_thing(mark, CLASSES)
    mark.log.append(ViewNote(keyframe=4, log_ratio=[0.0, -2.0, 0.0], verdict=Verdict.MISSED, **seen))
    explanation = thing.explain()
    assert (explanation.label, explanation.probability) == ("bowl", thing.belief("bowl"))
    assert [(view.keyframe, view.log_ratio) for view in explanation] == [(3, 2.0)]  # a thing is as it was then
    assert [view.log_ratio for view in thing.explain("CUP")] == [-1.0]
    assert len(compose_thing(mark, CLASSES).explain()) == 2

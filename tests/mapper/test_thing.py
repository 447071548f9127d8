import copy
import pickle

import numpy as np
import pytest

from thingmap.mapper.map.thing import Evidence


def test_belief_is_existence_times_the_probability_of_that_label(make_thing):
    thing = make_thing(label="bowl", probability=0.7, existence=0.5)
    assert thing.belief("bowl") == pytest.approx(0.35)
    assert thing.belief("CUP") == pytest.approx(0.15)
    assert thing.belief("spoon") == 0.0


def test_arrays_are_copies_that_cannot_be_changed(make_thing):
    position = np.array([1.0, 2.0, 3.0])
    thing = make_thing(position=position)
    position[0] = 9.0
    assert thing.position[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        thing.position[0] = 5.0


def test_position_std_is_along_the_map_axes(make_thing):
    np.testing.assert_allclose(make_thing().position_std, [0.01, 0.02, 0.03])


def test_survives_pickle_and_copy(make_thing):
    thing = make_thing()
    for other in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing)):
        np.testing.assert_array_equal(other.position_covariance, thing.position_covariance)
        assert other.class_posterior == thing.class_posterior
        assert other.evidence == Evidence(12, 3, 1)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"position": [1.0, 2.0]}, r"position must have shape \(3,\), but got \(2,\)"),
        ({"position": [1.0, np.nan, 2.0]}, "position must be finite"),
        ({"existence": 1.2}, r"existence must be in \[0, 1\], but got 1.2"),
        ({"size": [0.1, -0.1, 0.1]}, "size and size_std must not be negative"),
        ({"class_posterior": {"bowl": 0.9}}, r"must be class_posterior\['cup'\], which is None"),
        ({"class_posterior": {"cup": 0.5}}, "probability 0.9 must be class_posterior"),
        ({"class_posterior": {"cup": 0.9, "bowl": 0.2}}, "sum to at most 1"),
        ({"position_covariance": -np.eye(3)}, "no negative eigenvalue"),
        ({"position_covariance": np.eye(3) + np.eye(3, k=1)}, "symmetric"),
        ({"last_seen": np.inf}, "last_seen must be finite"),
    ],
)
def test_wrong_values_are_refused_by_name(make_thing, changes, named):
    with pytest.raises(ValueError, match=named):
        make_thing(**changes)


def test_evidence_is_counts():
    evidence = Evidence(np.int64(3), 0, 1)
    assert type(evidence.supporting) is int and evidence == Evidence(3, 0, 1)
    with pytest.raises(ValueError, match="occluded must not be negative"):
        Evidence(3, -1, 0)
    with pytest.raises(TypeError):
        Evidence(2.5, 0, 0)

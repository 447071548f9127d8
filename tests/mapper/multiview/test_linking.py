import numpy as np

from thingmap.mapper.multiview.linking import NEW, link


def at(*x):
    return np.array([[value, 0.0, 1.0] for value in x]).reshape(-1, 3)


def test_the_closest_track_within_the_threshold():
    np.testing.assert_array_equal(link(at(0.02, 0.5), at(0.0, 0.1), 0.1), [0, NEW])


def test_the_threshold_itself_is_near_enough_and_beyond_is_not():
    assert link(at(0.0), at(0.25), 0.25)[0] == 0
    assert link(at(0.0), at(0.25), 0.2499)[0] == NEW


def test_the_closest_pair_comes_first_whatever_the_order():
    # the first observation is nearest to track 0 too, but the second is nearer
    np.testing.assert_array_equal(link(at(0.04, 0.01), at(0.0, 0.07), 0.1), [1, 0])
    np.testing.assert_array_equal(link(at(0.01, 0.04), at(0.0, 0.07), 0.1), [0, 1])


def test_no_track_is_taken_twice():
    np.testing.assert_array_equal(link(at(0.01, 0.02, 0.03), at(0.0), 0.1), [0, NEW, NEW])


def test_nothing_to_link():
    assert link(at(), at(0.0), 0.1).shape == (0,)
    np.testing.assert_array_equal(link(at(0.0), at(), 0.1), [NEW])

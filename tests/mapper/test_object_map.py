import numpy as np
import pytest

from thingmap.mapper.map.object_map import MapFrame
from thingmap.mapper.map.up_direction import UpDirection


def ids(answers):
    return [answer.thing.id for answer in answers]


def test_find_ranks_by_existence_times_probability_of_that_label(make_thing, make_map):
    object_map = make_map(
        make_thing(1, "bowl", 0.7),  # a cup with 0.3
        make_thing(2, "cup", 0.99, existence=0.5),
        make_thing(3, "cup", 0.8, existence=0.9),
        make_thing(4, "book", 1.0, class_posterior={"book": 1.0}),
    )
    answers = object_map.find("Cup")
    assert ids(answers) == ["thing-0003", "thing-0002", "thing-0001"]
    assert [a.probability for a in answers] == pytest.approx([0.72, 0.495, 0.3 * 0.95])
    assert ids(object_map.find("cup", min_probability=0.4)) == ["thing-0003", "thing-0002"]


def test_unknown_label_gives_nothing(make_map):
    object_map = make_map()
    assert object_map.find("zebra") == []
    assert object_map.nearest([0, 0, 0], "zebra") == []
    assert not object_map.knows("zebra")
    assert object_map.knows("CUP")


def test_equal_things_are_ranked_by_id(make_thing, make_map):
    object_map = make_map(make_thing(2), make_thing(1))
    assert ids(object_map.find("cup")) == ["thing-0001", "thing-0002"]


def test_nearest_gives_distances_with_their_uncertainty(make_thing, make_map):
    covariance = np.diag([0.01, 0.04, 0.09])
    near = make_thing(1, position=[0.0, 0.0, 2.0], position_covariance=covariance)
    far = make_thing(2, position=[3.0, 0.0, 0.0], position_covariance=covariance)
    answers = make_map(far, near).nearest([0.0, 0.0, 0.0])
    assert ids(answers) == ["thing-0001", "thing-0002"]
    assert [a.distance for a in answers] == pytest.approx([2.0, 3.0])
    assert [a.distance_std for a in answers] == pytest.approx([0.3, 0.1])  # along z, along x


def test_distance_std_agrees_with_sampling(make_thing, make_map):
    A = np.random.default_rng(3).normal(size=(3, 3))
    covariance = 1e-4 * (A @ A.T + np.eye(3))
    position = np.array([0.5, -1.0, 2.0])
    answer = make_map(make_thing(position=position, position_covariance=covariance)).nearest([0.1, 0.2, 0.3])[0]
    samples = np.random.default_rng(4).multivariate_normal(position, covariance, 200_000)
    distances = np.linalg.norm(samples - [0.1, 0.2, 0.3], axis=1)
    assert answer.distance_std == pytest.approx(distances.std(), rel=0.02)


def test_distance_from_the_centre_itself_has_the_widest_std(make_thing, make_map):
    thing = make_thing(position_covariance=np.diag([0.01, 0.04, 0.09]))
    answer = make_map(thing).nearest(thing.position)[0]
    assert (answer.distance, answer.distance_std) == (0.0, pytest.approx(0.3))


def test_nearest_with_a_label_leaves_out_what_is_probably_something_else(make_thing, make_map):
    object_map = make_map(make_thing(1, "bowl", 0.7), make_thing(2, "cup", 0.9), make_thing(3, "cup", 0.9))
    assert ids(object_map.nearest([0, 0, 1], "cup")) == ["thing-0002", "thing-0003"]
    assert ids(object_map.nearest([0, 0, 1], "cup", min_probability=0.2))[0] == "thing-0001"
    assert ids(object_map.nearest([0, 0, 1], count=1)) == ["thing-0001"]
    with pytest.raises(ValueError, match="three finite numbers"):
        object_map.nearest([0.0, np.nan, 0.0])


def test_things_without_existence_are_no_answer(make_thing, make_map):
    gone = make_map(make_thing(existence=0.0))
    assert gone.find("cup") == [] and gone.nearest([0, 0, 0], min_probability=0.0) == []


def test_within_counts_the_uncertainty_of_the_position(make_thing, make_map):
    sure = make_thing(1, position=[0.5, 0.5, 0.5], position_covariance=1e-8 * np.eye(3), existence=1.0)
    on_the_edge = make_thing(2, position=[1.0, 0.5, 0.5], position_covariance=1e-4 * np.eye(3), existence=1.0)
    outside = make_thing(3, position=[1.5, 0.5, 0.5], position_covariance=1e-4 * np.eye(3), existence=1.0)
    object_map = make_map(outside, on_the_edge, sure)
    unit_box = ((0, 0, 0), (1, 1, 1))
    answers = object_map.within(unit_box, min_probability=0.1)
    assert ids(answers) == ["thing-0001", "thing-0002"]
    assert [a.probability for a in answers] == pytest.approx([1.0, 0.5], abs=0.01)
    assert ids(object_map.within(unit_box, min_probability=0.6)) == ["thing-0001"]
    assert object_map.within(unit_box, "cup")[0].probability == pytest.approx(0.9)
    assert ids(object_map.within(((0.5, 0.5, 0.5), 0.1))) == ["thing-0001"]


def test_ids_are_unique_and_frames_are_known(make_thing, make_map):
    with pytest.raises(ValueError, match="thing-0001 more than once"):
        make_map(make_thing(1), make_thing(1))
    with pytest.raises(ValueError, match="somewhere"):
        make_map(frame="somewhere")
    assert make_map(frame="gravity-aligned").frame is MapFrame.GRAVITY_ALIGNED


def test_up_is_a_unit_vector():
    with pytest.raises(ValueError, match="unit vector"):
        UpDirection(np.array([0.0, 0.0, 2.0]), 0.1, "planes")
    with pytest.raises(ValueError, match="std_rad"):
        UpDirection(np.array([0.0, 0.0, 1.0]), np.nan, "planes")


def test_upright_axes_follow_up(make_map):
    np.testing.assert_allclose(make_map().R_world_upright[:, 2], [0, -1, 0])

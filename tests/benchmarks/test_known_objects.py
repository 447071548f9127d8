"""Checks of a map against known objects: each verdict can be reached."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from known_objects import KnownObject, check_things, read_known_objects

from thingmap.datasets.errors import InputError
from thingmap.mapper.evaluation.inputs.case import Alignment
from thingmap.mapper.map.thing import Evidence, Thing

SAME_AXES = Alignment(np.eye(3), np.zeros(3))


def make_thing(
    number: int, x: float, label: str = "cup", existence: float = 1.0, posterior: dict[str, float] | None = None
) -> Thing:
    posterior = posterior or {label: 1.0}
    return Thing(
        id=f"thing-{number:04d}",
        label=label,
        probability=posterior[label],
        existence=existence,
        class_posterior=posterior,
        position=np.array([x, 0.0, 0.0]),
        position_covariance=1e-4 * np.eye(3),
        size=np.full(3, 0.1),
        size_std=np.full(3, 0.01),
        yaw=0.0,
        first_seen=0.0,
        last_seen=1.0,
        evidence=Evidence(3, 0, 0),
    )


def known(x: float = 0.0, label: str = "cup", is_false: bool = False, tolerance: float = 0.1) -> KnownObject:
    return KnownObject("it", label, np.array([x, 0.0, 0.0]), tolerance, is_false)


def passed(*things: Thing, of: KnownObject | None = None) -> bool:
    return check_things(things, [of or known()], SAME_AXES)[0].passed


def test_an_object_is_found_once_within_its_tolerance() -> None:
    assert passed(make_thing(1, 0.09), make_thing(2, 0.5))
    assert not passed(make_thing(1, 0.11))
    assert not passed()


def test_existence_and_label_must_be_sure() -> None:
    assert not passed(make_thing(1, 0.0, existence=0.89))
    assert not passed(make_thing(1, 0.0, label="bowl"))
    assert not passed(make_thing(1, 0.0, label="bowl", posterior={"bowl": 0.55, "cup": 0.45}))


def test_a_second_thing_on_the_same_object_fails_unless_it_is_not_believed() -> None:
    assert not passed(make_thing(1, 0.0), make_thing(2, 0.05, existence=0.6))
    assert passed(make_thing(1, 0.0), make_thing(2, 0.05, existence=0.4))
    assert passed(make_thing(1, 0.0), make_thing(2, 0.05, label="bowl"))


def test_one_thing_does_not_stand_for_two_objects() -> None:
    both = [known(0.0), known(0.1)]
    near_the_first, near_each = (make_thing(1, 0.04),), (make_thing(1, 0.04), make_thing(2, 0.07))
    assert [c.passed for c in check_things(near_the_first, both, SAME_AXES)] == [True, False]
    assert [c.passed for c in check_things(near_each, both, SAME_AXES)] == [True, True]


def test_a_false_detection_must_not_be_believed_whatever_the_label() -> None:
    bowl = known(label="bowl", is_false=True, tolerance=0.25)
    assert passed(of=bowl)
    assert not passed(make_thing(1, 0.2, label="bowl", existence=0.6), of=bowl)
    assert passed(make_thing(1, 0.2, label="bowl", existence=0.49), of=bowl)
    assert passed(make_thing(1, 0.26, label="bowl"), of=bowl)
    assert passed(make_thing(1, 0.0, label="cup", posterior={"cup": 0.7, "bowl": 0.3}), of=bowl)


def test_things_are_moved_to_the_world_of_the_objects() -> None:
    turned = Alignment(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.0, 0.0, 2.0]))
    there = KnownObject("it", "cup", np.array([0.0, 1.0, 2.0]), 0.01, False)
    check = check_things((make_thing(1, 1.0),), [there], turned)[0]
    assert check.passed
    assert check.distance == pytest.approx(0.0)


def test_the_best_candidate_is_named_even_where_the_check_fails() -> None:
    check = check_things((make_thing(1, 0.3), make_thing(2, 0.5)), [known()], SAME_AXES)[0]
    assert check.nearest is not None
    assert (check.nearest.id, check.distance) == ("thing-0001", pytest.approx(0.3))
    assert check_things((), [known()], SAME_AXES)[0].nearest is None


def test_reading_a_file(tmp_path: Path) -> None:
    path = tmp_path / "objects.json"
    content = {
        "objects": [{"name": "mug", "class": "cup", "position": [1, 2, 3], "tolerance": 0.1}],
        "known_false_detections": [
            {"class": "bowl", "position": [1, 2, 3], "truth": "the mug"},
            {"class": "car", "position": [1, 2, 3], "tolerance": 0.4},
        ],
    }
    path.write_text(json.dumps(content))
    mug, bowl, car = read_known_objects(path)
    assert (mug.label, mug.tolerance, mug.is_false) == ("cup", 0.1, False)
    assert (bowl.tolerance, bowl.is_false, "the mug" in bowl.name) == (0.25, True, True)
    assert car.tolerance == 0.4


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{", "JSON"),
        ("{}", "objects"),
        ('{"objects": [{"name": "a", "class": "b", "position": [1, 2], "tolerance": 1}]}', "position"),
        ('{"objects": [{"name": "a", "class": "b", "position": [1, 2, 3]}]}', "tolerance"),
        ('{"objects": [{"name": "a", "class": "b", "position": [1, 2, 3], "tolerance": 0}]}', "tolerance"),
        ("[]", "an object"),
    ],
)
def test_a_wrong_file_is_an_input_error(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "objects.json"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        read_known_objects(path)
    with pytest.raises(InputError, match="no such file"):
        read_known_objects(tmp_path / "absent.json")

"""The benchmark of viewpoints: what is right, what is left open, and how choices are compared."""

from __future__ import annotations

import argparse

import numpy as np
import pytest
import where_to_look
from where_to_look import GAIN, POLICIES, RANDOM, describe, interval
from where_to_look_answers import answer, bits_of, match_truth, right_answer
from where_to_look_job import Tried

from thingmap.datasets.truth import TrueObject
from thingmap.mapper.map.thing import Evidence, Thing


def thing(number: int, x: float, existence: float = 0.8) -> Thing:
    return Thing(
        id=f"thing-{number:04d}",
        label="cup",
        probability=0.75,
        existence=existence,
        class_posterior={"cup": 0.75, "bowl": 0.25},
        position=np.array([x, 0.0, 0.0]),
        position_covariance=1e-4 * np.eye(3),
        size=np.full(3, 0.1),
        size_std=np.full(3, 0.01),
        yaw=0.0,
        first_seen=0.0,
        last_seen=1.0,
        evidence=Evidence(3, 0, 0),
    )


def cup(number: int, x: float) -> TrueObject:
    return TrueObject(number, "cup", np.array([x, 0.0, 0.0]), np.full(3, 0.1), 0.0)


def test_answers_are_probabilities_of_what_is_asked() -> None:
    classes = ("bowl", "cup")
    np.testing.assert_allclose(answer(thing(1, 0.0), None, classes), [0.2, 0.2, 0.6])
    np.testing.assert_allclose(answer(thing(1, 0.0), "cup", classes), [0.4, 0.6])
    assert answer(None, None, classes).tolist() == [1.0, 0.0, 0.0]
    assert right_answer("cup", None, classes).tolist() == [0.0, 0.0, 1.0]
    assert right_answer(None, None, classes).tolist() == [1.0, 0.0, 0.0]
    assert right_answer("bowl", "cup", classes).tolist() == [1.0, 0.0]


def test_entropy_is_in_bits() -> None:
    assert bits_of(np.full(4, 0.25)) == pytest.approx(2.0)
    assert bits_of(np.array([1.0, 0.0])) == 0.0


def test_a_thing_stands_for_the_nearest_object_in_reach_and_no_two_for_one() -> None:
    things = [thing(1, 0.03), thing(2, 0.01), thing(3, 0.2)]
    assert match_truth(things, [cup(0, 0.0)]) == [None, "cup", None]
    assert match_truth(things, []) == [None, None, None]


def tried(scene: str, gain: tuple[float, ...], brier: tuple[float, ...]) -> Tried:
    return Tried(scene, True, gain, (0.1, 0.5, 0.9), 1.0, 0.8, brier, brier)


def test_every_policy_takes_its_own_view() -> None:
    one = tried("a", (0.1, 0.9, 0.2), (0.5, 0.3, 0.1))
    left = {name: choose(one, one.brier_after) for name, choose in POLICIES.items()}
    assert left == pytest.approx({GAIN: 0.3, RANDOM: 0.3, "nearest": 0.5, "farthest": 0.1, "best in hindsight": 0.1})


def test_the_interval_is_that_of_scenes_drawn_again() -> None:
    several = [tried(str(k), (1.0, 0.0, 0.0), (0.1, 0.2, 0.3)) for k in range(40)]
    values = np.random.default_rng(0).normal(0.5, 1.0, 40)
    found = interval(several, values)
    assert found.value == pytest.approx(values.mean())
    half = 1.96 * values.std() / np.sqrt(40)
    assert found.high - found.low == pytest.approx(2.0 * half, rel=0.25)
    # twenty questions of one scene are no twenty scenes
    same = [tried(str(k % 2), (1.0, 0.0, 0.0), (0.1, 0.2, 0.3)) for k in range(40)]
    split = np.where(np.arange(40) % 2, 1.0, 0.0)
    assert (interval(same, split).low, interval(same, split).high) == (0.0, 1.0)


def test_the_section_says_what_was_saved() -> None:
    options = argparse.Namespace(scenes=2, first_seed=1)
    text = describe(
        [tried("a", (0.9, 0.1, 0.0), (0.1, 0.4, 0.4)), tried("b", (0.0, 0.0, 0.9), (0.6, 0.6, 0.0))], options
    )
    row = next(line for line in text.splitlines() if line.startswith(f"| {GAIN}"))
    # Brier 0.8 before, 0.05 after the best views, 0.35 after any: saved 0.75 against 0.45
    assert "0.050" in row
    assert row.rstrip(" |").endswith("1.67")
    assert "seeds 1 to 2" in text


def test_only_the_whole_benchmark_may_be_written(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["--quick", "--write"], ["--scenes", "3", "--write"], ["--scenes", "0"]):
        with pytest.raises(SystemExit):
            where_to_look.main(arguments)
        assert "--" in capsys.readouterr().err

"""Costs are what the run wrote down."""

from __future__ import annotations

from dataclasses import replace

import pytest

from thingmap.mapper.evaluation.protocols.cost import evaluate
from thingmap.mapper.evaluation.result import NotEvaluated


@pytest.fixture
def cost_of(scene_truth, perfect_run, make_case):
    """`cost_of(**changes)`: the protocol on a report with other values; None removes one."""

    def judge(**changes: object):
        run = perfect_run(scene_truth)
        report = {name: value for name, value in {**run.report, **changes}.items() if value is not None}
        return evaluate(make_case(replace(run, report=report), scene_truth))

    return judge


def test_numbers_are_those_of_the_report(cost_of) -> None:
    result = cost_of(skipped={"no valid depth": ["frame-000003", "frame-000004"]}, frames_skipped=2)
    expected = {
        "frames per second": 20.0,
        "mapping per frame, mean": 40.0,
        "mapping per frame, median": 38.0,
        "mapping per frame, p95": 61.0,
        "wall time": 2.0,
        "peak memory": 512.0,
        "frames": 40,
        "keyframes": 10,
        "skipped frames": 2,
    }
    assert {metric.name: metric.value for metric in result.metrics} == expected
    assert result.notes == ("Skipped frames: 2 with no valid depth.",)


def test_stages_of_the_loop_and_of_the_mapper_are_listed(cost_of) -> None:
    odometry = {"count": 40, "median_ms": 9.0, "p95_ms": 15.0, "total_s": 0.4}
    loop, mapper = cost_of(mapper={"stages": {"odometry": odometry}}).tables
    assert [row[0] for row in loop.rows] == ["reading", "mapping"]
    assert loop.rows[1] == ("mapping", 40, 40.0, 38.0, 61.0, pytest.approx(1.6))
    assert mapper.rows == (("odometry", 40, pytest.approx(10.0), 9.0, 15.0, 0.4),)


def test_what_the_system_did_not_tell_is_undefined(cost_of) -> None:
    assert cost_of(peak_memory_mb=None).value("peak memory") is None
    assert cost_of(keyframes="many").value("keyframes") is None
    assert len(cost_of(mapper={"stages": [1]}).tables) == 1


def test_a_report_without_times_is_not_judged(cost_of) -> None:
    for change in ({"stages": None}, {"frames_per_second": None}, {"stages": "none"}):
        with pytest.raises(NotEvaluated, match="no times"):
            cost_of(**change)

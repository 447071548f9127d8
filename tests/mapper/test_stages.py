"""The clock of the loop's stages."""

from __future__ import annotations

import json
import time

import pytest

from thingmap.mapper.stages import StageClock


def test_every_stage_has_its_own_readings():
    clock = StageClock()
    for pause in (0.002, 0.004, 0.03):
        with clock.stage("slow"):
            time.sleep(pause)
    for _ in range(5):
        with clock.stage("quick"):
            pass
    summary = clock.summary()
    assert list(summary) == ["slow", "quick"]
    slow, quick = summary["slow"], summary["quick"]
    assert (slow["count"], quick["count"]) == (3, 5)
    assert slow["median_ms"] >= 4.0
    assert slow["median_ms"] < slow["p95_ms"] <= 1e3 * slow["total_s"]
    assert slow["total_s"] >= 0.036
    assert quick["median_ms"] < slow["median_ms"]
    assert json.loads(json.dumps(summary)) == summary


def test_a_stage_that_fails_is_timed_too_and_the_error_goes_on():
    clock = StageClock()
    with pytest.raises(ValueError, match="broken"), clock.stage("failing"):
        raise ValueError("broken")
    assert clock.summary()["failing"]["count"] == 1


def test_stages_within_stages_both_count():
    clock = StageClock()
    with clock.stage("outer"), clock.stage("inner"):
        time.sleep(0.005)
    summary = clock.summary()
    assert summary["outer"]["total_s"] >= summary["inner"]["total_s"] >= 0.005


def test_nothing_timed_is_an_empty_summary():
    assert StageClock().summary() == {}

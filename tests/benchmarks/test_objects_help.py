"""Whether objects help: the paired comparison is right where the answer is known, and the benchmark runs small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import objects_help
import pytest
from objects_help import CONDITIONS, SEEDS, Condition
from objects_help_report import compare, describe
from suite import FIRST_SEED

from thingmap.datasets.errors import UserError
from thingmap.mapper.config import MapperConfig


def test_a_gain_in_every_scene_is_shown_and_its_opposite_is_harm() -> None:
    gains = np.random.default_rng(0).uniform(0.001, 0.003, 20)
    found = compare(gains)
    assert found.low < found.mean < found.high and found.mean == pytest.approx(gains.mean())
    assert found.low > 0.0 and found.positive == 20 and found.verdict == "yes"
    assert found.p == pytest.approx(2.0 * 0.5**20)  # all signs alike: the smallest p that 20 pairs can have
    assert compare(-gains).verdict == "they harm" and compare(-gains).p == pytest.approx(found.p)


def test_no_difference_is_not_shown() -> None:
    assert compare(np.zeros(20)).verdict == "not shown" and compare(np.zeros(20)).p == 1.0
    rng = np.random.default_rng(1)
    shown = [compare(rng.normal(0.0, 0.01, 20)).verdict != "not shown" for _ in range(60)]
    assert sum(shown) <= 9  # of 60, with 5 % each: 9 or fewer in 998 of 1000 such tests
    one_lucky_scene = np.array([0.1, *np.full(19, -0.001)])
    assert compare(one_lucky_scene).mean > 0.0 and compare(one_lucky_scene).verdict == "not shown"


def test_the_interval_is_that_of_the_mean() -> None:
    values = np.random.default_rng(2).normal(0.004, 0.002, 40)
    found = compare(values)
    sigma = values.std() / np.sqrt(40)
    assert found.low == pytest.approx(values.mean() - 1.96 * sigma, abs=0.15 * sigma)
    assert found.high == pytest.approx(values.mean() + 1.96 * sigma, abs=0.15 * sigma)
    assert compare(values) == found


def test_the_table_shows_millimetres_and_what_is_missing() -> None:
    ate = np.stack([np.full(20, 0.004), 0.00605 + 0.0001 * np.arange(20)], axis=1)
    text = describe({"as it is": ate}, ["loops: there are none"])
    line = " ".join(text.split("\n")[-3].replace("|", " ").split())
    assert line.startswith("as it is 20 4.0 (4.0) 7.0 (7.0) +3.00 [+2.")
    assert line.endswith("yes") and "20 of 20" in line
    assert text.endswith("Not measured: loops: there are none.")


def test_conditions_differ_by_what_objects_say_and_their_scenes_are_held_out() -> None:
    by_name = {condition.name: condition for condition in CONDITIONS}
    assert set(by_name) == {"normal", "few-features", "steps", "few-objects", "constellation"}
    whole = by_name["normal"].config(True)
    assert whole == MapperConfig()
    assert by_name["normal"].config(False) == replace(whole, smoother=replace(whole.smoother, joint=False))
    assert (
        not by_name["few-features"].config(True).visual.enabled and by_name["few-features"].config(True).smoother.joint
    )
    assert [scene.object_count for scene in by_name["few-objects"].scenes(2, None, 320)] == [3, 3]
    for condition in CONDITIONS:
        seeds = [scene.seed for scene in condition.scenes(SEEDS, 40, 320)]
        assert seeds == list(range(FIRST_SEED, FIRST_SEED + SEEDS)) and SEEDS >= 20
        assert all(scene.frames == 40 for scene in condition.scenes(2, 40, 320))
    with pytest.raises(UserError, match=r"no\.such"):
        Condition("later", "later", {}, {"no.such": 1}).config(True)


def test_the_command_compares_a_small_scene(tmp_path, monkeypatch, capsys) -> None:
    later = Condition("later", "with something new", CONDITIONS[0].scene, {"no.such": 1})
    monkeypatch.setattr(objects_help, "CONDITIONS", (CONDITIONS[0], later))
    small = ["--seeds", "1", "--frames", "6", "--width", "160", "--jobs", "0", "--folder", str(tmp_path)]
    assert objects_help.main(small) == 0
    said = capsys.readouterr().out
    assert "| as it is  | 1 " in said and "with something new: the mapper's configuration has no no.such" in said
    assert [place.name for place in (tmp_path / "scenes").iterdir()] == ["tabletop-seed=1000-frames=6-width=160"]
    with pytest.raises(SystemExit):
        objects_help.main(["--write", *small])

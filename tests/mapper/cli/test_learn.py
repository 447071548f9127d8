"""`thingmap learn`: what it writes, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.factors.evidence_model import load_evidence_model
from thingmap.mapper.cli.main import app

SMALL = ("--frames", "6", "--width", "240", "--objects", "5", "--clutter", "low")


def thingmap(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


def refused(*arguments: object) -> str:
    result = thingmap("learn", *arguments)
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1, result.stderr
    return result.stderr


@pytest.fixture(scope="module")
def scenes(tmp_path_factory) -> list[Path]:
    folder = tmp_path_factory.mktemp("scenes")
    for seed in (1, 2):
        made = thingmap("synth", "--preset", "tabletop", *SMALL, "--seed", seed, "-o", folder / str(seed))
        assert made.exit_code == 0, made.stderr
    return [folder / "1", folder / "2"]


def test_a_model_and_its_page(scenes, tmp_path):
    output = tmp_path / "new" / "appearance.json"
    arguments = (*scenes, "--detector", "simulated?seed=1", "-o", output)
    result = thingmap("learn", *arguments)
    assert result.exit_code == 0, result.stderr
    assert "comparing: 12/12 frames" in result.stderr
    assert f"the model is in {output}; open {output.with_suffix('.html')}" in result.stdout
    assert "whole objects" in result.stdout and "calibration error" in result.stdout
    model = load_evidence_model(output)
    assert model.learned_from == "2 sequences (1, 2), 12 frames, detector simulated?seed=1"
    assert model.scores.own_parameters(0, 0.0)[0][-1] > model.scores.background_mean[-1, 0]
    hidden, seen = model.detection.probability(np.array([0.1, 1.0]), 15.0)
    assert hidden < 0.2 < seen - hidden
    assert str(tmp_path) not in output.read_text() + output.with_suffix(".html").read_text()

    before = output.read_bytes()
    assert "add --overwrite" in refused(*arguments)
    assert thingmap("learn", *arguments, "--overwrite").exit_code == 0
    assert output.read_bytes() == before


def test_truth_and_recorded_detections_of_each_sequence(scenes, tmp_path):
    recordings, truths = [], []
    for scene in scenes:
        file = tmp_path / f"{scene.name}.json"
        assert thingmap("detect", scene, "--detector", "simulated?seed=1", "-o", file).exit_code == 0
        recordings += ["--detector", f"recorded:{file}"]
        truths += ["--truth", scene]
    models = []
    for name, options in (("own", []), ("given", truths)):
        output = tmp_path / f"{name}.json"
        result = thingmap("learn", *scenes, *recordings, *options, "-o", output)
        assert result.exit_code == 0, result.stderr
        models.append(json.loads(output.read_text()))
    assert models[0] == models[1]
    assert models[0]["learned_from"].endswith("detector recorded:1.json, recorded:2.json")


def test_what_it_refuses(scenes, tmp_path):
    first, second = scenes
    model = tmp_path / "a.json"
    simulated = ("--detector", "simulated", "-o", model)
    assert "2 sequences but 1 of --truth" in refused(first, second, *simulated, "--truth", first)
    three = ("--detector", "none") * 3
    assert "2 sequences but 3 of --detector" in refused(first, second, *three, "-o", model)
    assert "detector none found nothing in 6 frames" in refused_after_frames(first, "--detector", "none", "-o", model)
    assert "end it in .json" in refused(first, "--detector", "simulated", "-o", tmp_path / "a.html")
    assert "choose another name" in refused(first, "--detector", "simulated", "-o", tmp_path)
    assert "no such folder" in refused(tmp_path / "gone", *simulated)
    bare = tmp_path / "bare"
    bare.mkdir()
    for name in ("color", "depth", "intrinsics.json", "poses.txt"):
        (bare / name).symlink_to(first / name)
    assert "--truth" in refused(bare, "--detector", "none", "-o", model)
    (bare / "poses.txt").unlink()
    objects = tmp_path / "objects.json"
    thing = {"name": "cup", "class": "cup", "position": [0, 0, 1], "tolerance": 0.1, "size": [0.1, 0.1, 0.1]}
    objects.write_text(json.dumps({"objects": [thing]}))
    assert "no camera poses" in refused(bare, "--detector", "none", "-o", model, "--truth", objects)
    assert not model.exists()


def refused_after_frames(*arguments: object) -> str:
    """The last line, after those of the progress."""
    result = thingmap("learn", *arguments)
    assert result.exit_code == 2 and result.stdout == "", result.output
    return result.stderr.splitlines()[-1]

"""`thingmap learn`: what it writes, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.factors.evidence_model import load_evidence_model
from thingmap.factors.existence import ExistenceModel
from thingmap.mapper.cli.main import app
from thingmap.mapper.map.object_map import ObjectMap

SMALL = ("--preset", "survey", "--frames", "12", "--width", "240", "--objects", "8", "--clutter", "low")
DETECTOR = ("--detector", "simulated?seed=1")


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
    for seed in (3, 4):
        made = thingmap("synth", *SMALL, "--seed", seed, "-o", folder / str(seed))
        assert made.exit_code == 0, made.stderr
    return [folder / "3", folder / "4"]


@pytest.fixture(scope="module")
def learned(scenes, tmp_path_factory) -> tuple[Path, str]:
    """The model of both stages, and what was said."""
    output = tmp_path_factory.mktemp("learned") / "appearance.json"
    result = thingmap("learn", *scenes, *DETECTOR, "-o", output)
    assert result.exit_code == 0, result.stderr
    return output, result.output


def test_a_model_and_its_page(scenes, tmp_path):
    output = tmp_path / "new" / "appearance.json"
    arguments = (*scenes, *DETECTOR, "--scores-only", "-o", output)
    result = thingmap("learn", *arguments)
    assert result.exit_code == 0, result.stderr
    assert "comparing: 24/24 frames" in result.stderr and "mapping" not in result.stderr
    assert f"the model is in {output}; open {output.with_suffix('.html')}" in result.stdout
    assert "whole objects" in result.stdout and "calibration error" in result.stdout
    assert "how sure" not in result.stdout and "existence" not in result.stdout
    model = load_evidence_model(output)
    assert model.learned_from == "2 sequences (3, 4), 24 frames, detector simulated?seed=1"
    assert model.scores.own_parameters(0, 0.0)[0][-1] > model.scores.background_mean[-1, 0]
    assert model.existence == ExistenceModel() and model.background_size is None
    hidden, seen = model.detection.probability(np.array([0.1, 1.0]), 25.0)
    assert hidden < 0.3 < seen - hidden
    assert str(tmp_path) not in output.read_text() + output.with_suffix(".html").read_text()

    before = output.read_bytes()
    assert "add --overwrite" in refused(*arguments)
    assert thingmap("learn", *arguments, "--overwrite").exit_code == 0
    assert output.read_bytes() == before


def test_how_sure_to_be_is_learned_by_mapping(scenes, learned):
    output, said = learned
    assert "mapping: 48/48 frames" in said and "2 times 2 sequences" in said
    assert re.search(r"existence of \d+ records of landmarks|learned from \d+ records of landmarks", said)
    model = load_evidence_model(output)
    assert model.existence != ExistenceModel()
    mean, covariance = model.background_size
    page = output.with_suffix(".html").read_text()
    assert "How sure to be" in page and "What a kind of evidence counts" in page
    assert np.all(np.exp(mean) < 1.0) and np.all(np.linalg.eigvalsh(covariance) > 0.0)


def things(folder: Path) -> dict[str, float]:
    """Existence of everything in a map."""
    return {thing.id: thing.existence for thing in ObjectMap.load(folder).things}


def test_run_uses_the_model_that_its_configuration_names(scenes, learned, tmp_path):
    output, _ = learned
    doubtful = json.loads(output.read_text())
    doubtful["existence"]["null_prior"] = 0.999
    (tmp_path / "doubtful.json").write_text(json.dumps(doubtful))
    found = {}
    for name, model in (("own", output), ("doubtful", tmp_path / "doubtful.json"), ("generic", "generic")):
        config = tmp_path / f"{name}.yaml"
        config.write_text(f"evidence: {{model: {model}}}")
        folder = tmp_path / name
        result = thingmap("run", scenes[0], *DETECTOR, "--config", config, "--all", "-o", folder)
        assert result.exit_code == 0, result.stderr
        assert str(model) in (folder / "config.yaml").read_text()
        found[name] = things(folder)
    assert found["own"] and max(found["own"].values()) > 0.5
    assert np.mean(list(found["doubtful"].values()) or 0.0) < np.mean(list(found["own"].values())) - 0.1
    assert found["generic"] and found["generic"] != found["own"]


@pytest.mark.parametrize(
    ("content", "part"), [(None, "no such file"), ("{}", "thingmap-evidence/1"), ("[1", "thingmap-evidence/1")]
)
def test_a_model_that_is_none_is_named(scenes, tmp_path, content, part):
    model, config = tmp_path / "gone.json", tmp_path / "own.yaml"
    config.write_text(f"evidence: {{model: {model}}}")
    if content is not None:
        model.write_text(content)
    result = thingmap("run", scenes[0], *DETECTOR, "--config", config, "-o", tmp_path / "out")
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert str(model) in result.stderr and part in result.stderr and "thingmap learn" in result.stderr


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
        result = thingmap("learn", *scenes, *recordings, *options, "--scores-only", "-o", output)
        assert result.exit_code == 0, result.stderr
        models.append(json.loads(output.read_text()))
    assert models[0] == models[1]
    assert models[0]["learned_from"].endswith("detector recorded:3.json, recorded:4.json")


def test_what_it_refuses(scenes, tmp_path):
    first, second = scenes
    model = tmp_path / "a.json"
    simulated = ("--detector", "simulated", "-o", model)
    assert "2 sequences but 1 of --truth" in refused(first, second, *simulated, "--truth", first)
    three = ("--detector", "none") * 3
    assert "2 sequences but 3 of --detector" in refused(first, second, *three, "-o", model)
    assert "detector none found nothing in 12 frames" in refused_after_frames(first, "--detector", "none", "-o", model)
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

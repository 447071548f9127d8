"""`thingmap label`."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app
from thingmap.mapper.evaluation.inputs.load_run import load_run

SYNTH = "synth:tabletop?seed=3&frames=12&width=160&clutter=low"


def thingmap(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    out = tmp_path_factory.mktemp("mapped") / "out"
    result = thingmap("run", SYNTH, "-o", out, "--odometry", "poses")
    assert result.exit_code == 0, result.output
    return out


@pytest.fixture
def out(mapped, tmp_path):
    return shutil.copytree(mapped, tmp_path / "out")


def change_report(out, **changes):
    report = json.loads((out / "report.json").read_text())
    report["command"].update(changes)
    (out / "report.json").write_text(json.dumps(report))


def refused(*arguments) -> str:
    result = thingmap("label", *arguments)
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output and result.stderr.count("error: ") == 1
    return result.stderr


def test_a_run_is_labelled_with_what_it_was_mapped_with(out):
    result = thingmap("label", out, "--stride", 3, "--smoothness", "colour", "--bound")
    assert result.exit_code == 0, result.output
    assert "4 frames looked at" in result.stdout and "above the least there can be" in result.stdout
    assert "background" in result.stdout and str(out / "labels.ply") in result.stdout
    points, labels = load_run(out).cloud()
    assert labels is not None and len(points) == len(labels) and len(np.unique(labels)) > 2
    again = thingmap("label", out, "--stride", 3, "--smoothness", "none")
    assert "0 frames looked at, 4 known from before" in again.stdout, again.output
    fast = thingmap("label", out, "--stride", 4, "--fast")
    assert fast.exit_code == 0 and "did not fit" in fast.stdout and "3 frames looked at" in fast.stdout, fast.output


def test_every_tenth_frame_by_default(out):
    assert "2 frames looked at" in thingmap("label", out, "--smoothness", "none").stdout


def test_an_interrupted_run_is_labelled_as_far_as_it_went(out):
    stamps, _ = load_run(out).stamps, None
    lines = (out / "trajectory.txt").read_text().splitlines(keepends=True)
    (out / "trajectory.txt").write_text("".join(lines[: 1 + len(stamps) // 2]))
    result = thingmap("label", out, "--stride", 3)
    assert result.exit_code == 0 and "2 frames looked at" in result.stdout, result.output


def test_part_of_a_sequence_is_opened_as_it_was_mapped(tmp_path):
    out = tmp_path / "out"
    assert thingmap("run", SYNTH, "-o", out, "--odometry", "poses", "--stride", 2, "--max-frames", 5).exit_code == 0
    result = thingmap("label", out, "--stride", 2)
    assert result.exit_code == 0 and "3 frames looked at" in result.stdout, result.output


def test_the_configuration_file_and_the_options_over_it(out, tmp_path):
    (tmp_path / "a.yaml").write_text("stride: 6\nmrf: {smoothness: none}\nsources: {volumes: 0.0}")
    result = thingmap("label", out, "--config", tmp_path / "a.yaml")
    assert "2 frames looked at" in result.stdout and " 0 pairs" in result.stdout, result.output
    assert " 0 pairs" not in thingmap("label", out, "--config", tmp_path / "a.yaml", "--smoothness", "potts").stdout
    with_volumes = (out / "labels.ply").read_bytes()
    (tmp_path / "a.yaml").write_text("stride: 6\nmrf: {smoothness: potts}")
    assert thingmap("label", out, "--config", tmp_path / "a.yaml").exit_code == 0
    assert (out / "labels.ply").read_bytes() != with_volumes
    assert thingmap("label", out, "--config", tmp_path / "a.yaml", "--no-volumes").exit_code == 0
    assert (out / "labels.ply").read_bytes() == with_volumes
    (tmp_path / "a.yaml").write_text("smoothnes: none")
    assert "a.yaml" in refused(out, "--config", tmp_path / "a.yaml")


def test_mistakes_are_told_in_a_line(out, tmp_path):
    assert "thingmap run" in refused(tmp_path / "nothing")
    assert "normals, colour, potts, none" in refused(out, "--smoothness", "bumpy")
    assert "no 'magic'" in refused(out, "--detector", "magic")
    assert "map's classes are" in refused(out, "--detector", "proposals")
    assert "--sequence" in refused(out, "--sequence", "synth:tabletop?seed=4&frames=3&width=160&clutter=low")
    change_report(out, sequence=str(tmp_path / "gone"))
    message = refused(out)
    assert "gone" in message and "no such folder" in message and "--sequence" in message
    assert thingmap("label", out, "--sequence", SYNTH).exit_code == 0
    change_report(out, sequence=None)
    assert "does not say what was mapped" in refused(out)
    (out / "keyframes.npz").unlink()
    assert "keyframes.npz" in refused(out, "--sequence", SYNTH)


def test_a_map_without_classes_has_nothing_to_label(tmp_path):
    out = tmp_path / "out"
    assert thingmap("run", SYNTH, "-o", out, "--odometry", "poses", "--detector", "none").exit_code == 0
    assert "no classes" in refused(out)


def test_ctrl_c_keeps_what_was_gathered(out, monkeypatch):
    from contextlib import contextmanager

    from thingmap.mapper.cli import label

    @contextmanager
    def soon():
        asked = iter([False, True])
        yield lambda: next(asked)

    with monkeypatch.context() as patch:
        patch.setattr(label, "stop_on_interrupt", soon)
        result = thingmap("label", out, "--stride", 3)
    assert result.exit_code == 130 and "1 frames are in" in result.stderr, result.output
    assert not (out / "labels.ply").exists()
    assert "3 frames looked at, 1 known from before" in thingmap("label", out, "--stride", 3).stdout

"""`thingmap run --inference batch`."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app

SAMPLE = "sample:tabletop?frames=12&width=160"


def thingmap(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


@pytest.fixture(scope="module")
def batch_run(tmp_path_factory):
    out = tmp_path_factory.mktemp("batch") / "out"
    options = ["--inference", "batch", "--views", 4, "--odometry", "poses", "--snapshots", "6"]
    return thingmap("run", SAMPLE, "-o", out, *options), out


def test_the_report_and_the_terminal_tell_the_numbers(batch_run):
    result, out = batch_run
    assert result.exit_code == 0, result.output
    report = json.loads((out / "report.json").read_text())
    assert report["command"]["inference"] == "batch" and report["command"]["views"] == 4
    batch = report["mapper"]["batch"]
    assert batch["views"] == 4 and batch["samples"] == 300
    assert "batch inference over 4 views: 300 samples" in result.stdout
    assert f"{batch['after_suppression']} after suppression" in result.stdout
    assert f"{batch['iterations_most']} at most" in result.stdout


def test_snapshots_have_the_views_so_far(batch_run):
    _, out = batch_run
    index = json.loads((out / "snapshots" / "index.json").read_text())
    assert [entry["frames"] for entry in index["snapshots"]] == [6]
    assert (out / "snapshots" / index["snapshots"][0]["file"]).is_file()


def test_views_without_batch_are_refused(tmp_path):
    result = thingmap("run", SAMPLE, "-o", tmp_path / "out", "--views", 4)
    assert result.exit_code == 2, result.output
    assert "--views 4" in result.stderr and "--inference batch" in result.stderr
    assert "Traceback" not in result.output and not (tmp_path / "out").exists()

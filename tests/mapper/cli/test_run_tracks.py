"""`thingmap run --inference tracks`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.map.object_map import ObjectMap

SYNTH = "synth:tabletop?seed=3&frames=8&width=320&clutter=low"
TRACKS = ["--inference", "tracks", "--odometry", "poses"]


def thingmap(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


@pytest.fixture(scope="module")
def simulated_run(tmp_path_factory):
    out = tmp_path_factory.mktemp("tracks") / "out"
    return thingmap("run", SYNTH, "-o", out, *TRACKS, "--snapshots", 4), out


@pytest.fixture(scope="module")
def proposals_run(tmp_path_factory):
    out = tmp_path_factory.mktemp("proposals") / "out"
    return thingmap("run", SYNTH, "-o", out, *TRACKS, "--detector", "proposals"), out


def test_the_report_counts_tracks(simulated_run):
    result, out = simulated_run
    assert result.exit_code == 0, result.output
    report = json.loads((out / "report.json").read_text())
    assert report["command"]["inference"] == "tracks" and "views" not in report["command"]
    tracks = report["mapper"]["tracks"]
    assert tracks["tracks"] == tracks["kept"] + tracks["background"] + tracks["dropped"] > 0
    assert tracks["kept"] == report["things"] == len(ObjectMap.load(out))
    assert tracks["views"] == report["keyframes"] > 1
    assert [entry["frames"] for entry in json.loads((out / "snapshots" / "index.json").read_text())["snapshots"]] == [4]
    assert thingmap("query", out, ObjectMap.load(out).things[0].label, "--why").exit_code == 0


def test_without_masks_no_points_are_labelled(simulated_run):
    _, out = simulated_run
    assert not (out / "labels.ply").exists() and load_run(out).cloud()[1] is None


def test_proposals_label_the_points_of_what_they_found(proposals_run):
    result, out = proposals_run
    assert result.exit_code == 0, result.output
    run = load_run(out)
    points, labels = run.cloud()
    things = run.object_map.things
    assert len(things) >= 2 and {thing.label for thing in things} == {"unknown"}
    assert set(labels.tolist()) == {-1, 0}
    near = np.min([np.linalg.norm(points - t.position, axis=1) - np.linalg.norm(t.size) / 2 for t in things], axis=0)
    assert np.mean(near[labels == 0] < 0.03) > 0.98 > np.mean(near < 0.03)


def test_the_same_run_gives_the_same_files(proposals_run, tmp_path):
    _, out = proposals_run
    again = tmp_path / "again"
    assert thingmap("run", SYNTH, "-o", again, *TRACKS, "--detector", "proposals").exit_code == 0
    for name in ("map.json", "labels.ply", "evidence.npz"):
        assert (out / name).read_bytes() == (again / name).read_bytes(), name


def test_views_are_for_batch_inference_only(tmp_path):
    result = thingmap("run", SYNTH, "-o", tmp_path / "out", *TRACKS, "--views", 4)
    assert result.exit_code == 2, result.output
    assert "--views 4" in result.stderr and "--inference batch" in result.stderr
    assert "Traceback" not in result.output and not (tmp_path / "out").exists()


def test_a_judge_decides_about_tracks(tmp_path):
    out = tmp_path / "out"
    detector = ["--detector", "shape-context?confidence=0"]
    result = thingmap("run", SYNTH, "-o", out, *TRACKS, *detector, "--judge", "shipped")
    assert result.exit_code == 0, result.output
    report = json.loads((out / "report.json").read_text())
    assert report["command"]["judge"] == "shipped"
    tracks = report["mapper"]["tracks"]
    fates = sum(tracks[fate] for fate in ("kept", "background", "dropped", "repeated"))
    assert fates == tracks["tracks"] > 0
    assert f"became {tracks['tracks']} tracks" in result.output


def test_a_judge_is_for_tracks_of_its_classes_only(tmp_path):
    out = tmp_path / "out"
    for arguments, told in (
        (["--judge", "shipped"], "--inference tracks"),
        ([*TRACKS, "--judge", tmp_path / "none.json"], "none.json"),
        ([*TRACKS, "--judge", "shipped", "--detector", "proposals"], "the detector has unknown"),
    ):
        result = thingmap("run", SYNTH, "-o", out, *arguments)
        assert result.exit_code == 2 and told in result.stderr, result.output
        assert "Traceback" not in result.output


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("max_distance: -0.1", "max_distance must be positive, but got -0.1"),
        ("min_share: 1.5", "min_share must be in [0, 1], but got 1.5"),
        ("least_probability: 0.0", "least_probability must be above 0"),
        ("window: 2", "window must be an odd number"),
        ("margin: 0.5", "margin must be"),
        ("points: 0", "points must be at least 1"),
        ("extent: [98.0, 2.0]", "two growing percentiles"),
        ("hidden: -1.0", "hidden must be at least 0"),
    ],
)
def test_numbers_out_of_range_are_told(tmp_path, text, told):
    (tmp_path / "a.yaml").write_text(f"multiview: {{{text}}}")
    result = thingmap("run", SYNTH, "-o", tmp_path / "out", *TRACKS, "--config", tmp_path / "a.yaml")
    assert result.exit_code == 2 and "a.yaml" in result.stderr and told in result.stderr, result.output
    assert not (tmp_path / "out").exists()

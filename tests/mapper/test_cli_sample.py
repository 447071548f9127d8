"""The bundled sample through the real mapper, from the command line to the exported files."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.datasets.open import open_sequence
from thingmap.mapper.cli.main import app
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.config_file import load_config
from thingmap.mapper.map.store import OutputFolder

FRAMES, STRIDE = 10, 4


def thingmap(*arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")
    assert result.exit_code == 0, result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    path = tmp_path_factory.mktemp("sample") / "out"
    thingmap("run", "sample:tabletop", "-o", path, "--stride", STRIDE, "--max-frames", FRAMES, "--seed", 5)
    return path


def test_the_folder_is_complete(out):
    folder = OutputFolder.open(out)
    assert load_config(folder.config_file, MapperConfig).seed == 5
    report = folder.read_report()
    assert report["frames_used"] == FRAMES and report["command"]["detector"] == "simulated"
    assert len(folder.read_cloud()[0]) > 1000 and folder.ledger_file.stat().st_size > 0
    assert sorted(path.name for path in out.iterdir()) == [
        *("cloud.ply", "config.yaml", "evidence.npz", "keyframes.npz", "ledger.npz", "map.json", "report.json"),
        "trajectory.txt",
    ]


def test_the_trajectory_follows_the_true_camera(out):
    stamps, poses = OutputFolder.open(out).read_trajectory()
    truth = open_sequence("sample:tabletop", stride=STRIDE, max_frames=FRAMES)
    assert truth.poses is not None
    np.testing.assert_allclose(stamps, truth.stamps, atol=1e-5)
    moved = np.linalg.inv(truth.poses[0]) @ truth.poses[-1]
    assert np.linalg.norm(np.linalg.inv(poses[0]) @ poses[-1] - moved) < 0.1


def test_true_objects_are_found_where_they_are(out):
    object_map = OutputFolder.open(out).read_map()
    truth = open_sequence("sample:tabletop")
    assert truth.poses is not None and len(object_map) >= 4
    T_map_world = np.linalg.inv(truth.poses[0])  # the map is in the first camera's frame
    positions = np.array([T_map_world[:3, :3] @ o.position + T_map_world[:3, 3] for o in truth.objects])
    gaps = [np.linalg.norm(positions - thing.position, axis=1).min() for thing in object_map.things]
    assert np.median(gaps) < 0.08


def test_the_map_answers_and_exports(out, tmp_path):
    label = OutputFolder.open(out).read_map().things[0].label
    assert json.loads(thingmap("query", out, label, "--json"))[0]["answer_probability"] > 0.0
    for name in ("json", "csv", "ply"):
        thingmap("export", out, "--format", name, "-o", tmp_path / f"sample.{name}")
    assert "sample:tabletop" in thingmap("info", out)

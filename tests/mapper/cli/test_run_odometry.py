"""`thingmap run --odometry`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from thingmap.datasets.open import open_sequence
from thingmap.mapper.cli.main import app
from thingmap.mapper.map.store import OutputFolder

SAMPLE = "sample:tabletop?frames=16&width=160"


def thingmap(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


@pytest.fixture(scope="module")
def truth():
    sequence = open_sequence(SAMPLE)
    assert sequence.poses is not None
    return sequence.stamps, sequence.poses


def write(path, stamps, poses):
    rows = [
        " ".join(f"{v:.9f}" for v in (t, *T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()))
        for t, T in zip(stamps, poses, strict=True)
    ]
    path.write_text("\n".join(rows) + "\n")
    return path


def assert_mistake(result, out, *parts):
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1 and result.stderr.startswith("error: ")
    for part in parts:
        assert part in result.stderr
    assert not out.exists()


def test_a_trajectory_file_leads_the_camera_from_the_first_one(truth, tmp_path):
    stamps, poses = truth
    # another system's world: turned and far away
    T_other_world = np.eye(4)
    T_other_world[:3, :3] = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix()
    T_other_world[:3, 3] = [30.0, -7.0, 2.0]
    path, out = write(tmp_path / "slam.txt", stamps, T_other_world @ poses), tmp_path / "out"
    result = thingmap("run", SAMPLE, "-o", out, "--odometry", path)
    assert result.exit_code == 0, result.output
    assert json.loads((out / "map.json").read_text())["frame"] == "first camera"
    _, estimated = OutputFolder.open(out).read_trajectory()
    expected = np.linalg.inv(poses[0]) @ poses
    assert np.linalg.norm(expected[-1][:3, 3]) > 0.05
    assert np.linalg.norm(estimated[:, :3, 3] - expected[:, :3, 3], axis=1).max() < 0.01
    config = (out / "config.yaml").read_text()
    assert "source: file" in config and str(path) in config
    again = thingmap("run", SAMPLE, "-o", tmp_path / "again", "--config", out / "config.yaml")
    assert again.exit_code == 0, again.output
    assert (tmp_path / "again" / "trajectory.txt").read_text() == (out / "trajectory.txt").read_text()


def test_frames_without_a_pose_are_counted(truth, tmp_path):
    stamps, poses = truth
    path = write(tmp_path / "keyframes.txt", stamps[::5], poses[::5])
    result = thingmap("run", SAMPLE, "-o", tmp_path / "out", "--odometry", path)
    assert result.exit_code == 0, result.output
    assert "skipped frames: 12 with missing pose" in result.stderr and "between its neighbours" in result.stderr
    assert json.loads((tmp_path / "out" / "report.json").read_text())["frames_used"] == 4


def test_small_gicp_by_its_word(tmp_path):
    out = tmp_path / "out"
    result = thingmap("run", SAMPLE, "-o", out, "--odometry", "small-gicp")
    assert result.exit_code == 0, result.output
    assert "source: small-gicp" in (out / "config.yaml").read_text()
    assert len(OutputFolder.open(out).read_trajectory()[0]) == 16


def test_mistakes_are_one_line_and_leave_nothing(truth, tmp_path):
    stamps, poses = truth
    out = tmp_path / "out"
    run = ("run", SAMPLE, "-o", out, "--odometry")
    assert_mistake(thingmap(*run, "kis-icp"), out, "kiss-icp, small-gicp, poses or a file", "did you mean kiss-icp?")
    late = write(tmp_path / "late.txt", stamps + 1e9, poses)
    assert_mistake(thingmap(*run, late), out, str(late), "stamps 1000000000.000000 to", f"{stamps[-1]:.6f} s")
    (tmp_path / "table.csv").write_text("stamp,tx\n0,1\n")
    assert_mistake(thingmap(*run, tmp_path / "table.csv"), out, "table.csv", "stamp tx ty tz qx qy qz qw")
    (tmp_path / "a.yaml").write_text("odometry: {source: file}")
    assert_mistake(thingmap("run", SAMPLE, "-o", out, "--config", tmp_path / "a.yaml"), out, "a.yaml", "needs a path")

"""Trajectories, read back by the loaders of the datasets and by evo."""

from __future__ import annotations

import os
import shutil
import subprocess

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import InputError
from thingmap.datasets.poses import read_tum_poses
from thingmap.mapper.export.trajectory_files import export_kitti, export_tum


@pytest.mark.parametrize(("keyframes", "count"), [(False, 5), (True, 3)])
def test_poses_come_back(folder, tmp_path, keyframes, count):
    assert export_tum(folder, tmp_path / "a.tum", keyframes=keyframes) == count
    assert export_kitti(folder, tmp_path / "a.kitti", keyframes=keyframes) == count
    stamps, poses = folder.read_trajectory()
    step = 2 if keyframes else 1
    read = read_tum_poses(tmp_path / "a.tum")
    np.testing.assert_allclose(read.stamps, stamps[::step])
    np.testing.assert_allclose(read.matrices, poses[::step], atol=1e-7)
    rows = np.loadtxt(tmp_path / "a.kitti").reshape(-1, 3, 4)
    np.testing.assert_allclose(rows, poses[::step, :3], atol=1e-7)


def test_quaternions_are_x_y_z_w(folder, tmp_path):
    export_tum(folder, tmp_path / "a.tum")
    row = np.loadtxt(tmp_path / "a.tum")[4]
    np.testing.assert_allclose(row[4:], Rotation.from_euler("y", 8.0, degrees=True).as_quat(), atol=1e-7)


@pytest.mark.parametrize("name", ["tum", "kitti"])
def test_evo_reads_them(folder, tmp_path, name):
    programs = os.environ.get("THINGMAP_EVO")
    program = shutil.which("evo_traj", path=f"{programs}{os.pathsep}{os.environ['PATH']}" if programs else None)
    if program is None:
        pytest.skip("evo is absent: put its programs on PATH, or their folder into THINGMAP_EVO")
    export = {"tum": export_tum, "kitti": export_kitti}[name]
    assert export(folder, tmp_path / "a.txt") == 5
    environment = {**os.environ, "HOME": str(tmp_path), "MPLBACKEND": "Agg"}  # it keeps settings in the home folder
    command = [program, name, tmp_path / "a.txt", "--full_check"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120.0)
    assert done.returncode == 0, done.stderr or done.stdout
    said = dict(line.strip().split("\t", 1) for line in done.stdout.splitlines() if "\t" in line)
    assert (said["nr. of poses"], said["SE(3) conform"]) == ("5", "yes")
    _, poses = folder.read_trajectory()
    length = np.sum(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1))
    assert float(said["path length (m)"]) == pytest.approx(length, abs=1e-3)


def test_what_is_missing_is_named(empty_folder, folder, tmp_path):
    with pytest.raises(InputError, match=r"trajectory\.txt"):
        export_tum(empty_folder, tmp_path / "a.tum")
    folder.keyframes_file.unlink()
    with pytest.raises(InputError, match=r"keyframes\.npz"):
        export_kitti(folder, tmp_path / "a.kitti", keyframes=True)
    assert not list(tmp_path.glob("a.*"))

"""Trajectory errors: as evo computes them, and exactly what was put in."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.mapper.evaluation.inputs.alignment import align_positions, align_similarity, anchor
from thingmap.mapper.evaluation.inputs.case import Alignment
from thingmap.mapper.evaluation.protocols.trajectory import evaluate
from thingmap.mapper.evaluation.protocols.trajectory_errors import (
    ErrorSummary,
    absolute_errors,
    neighbours,
    pairs_apart,
    relative_errors,
    rotation_angles,
)
from thingmap.mapper.evaluation.result import NotEvaluated
from thingmap.mapper.map.object_map import MapFrame

SAME = Alignment(np.eye(3), np.zeros(3))
RATE = 10.0  # Hz
TIMEOUT = 120.0  # s; evo takes a few to start


def random_walk(seed: int, count: int = 60) -> np.ndarray:
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.cumsum(0.1 * rng.normal(size=(count, 3)), axis=0)).as_matrix()
    poses[:, :3, 3] = np.cumsum(0.05 * rng.normal(size=(count, 3)), axis=0)
    return poses


def noisy(poses: np.ndarray, seed: int) -> np.ndarray:
    """Turned, shifted, 5 % too large, and with noise."""
    rng, other = np.random.default_rng(seed), poses.copy()
    other[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(0.02 * rng.normal(size=(len(poses), 3))).as_matrix()
    other[:, :3, 3] = 1.05 * poses[:, :3, 3] + 0.01 * rng.normal(size=(len(poses), 3))
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix(), [1.0, 2.0, -0.5]
    return motion @ other


def shifted(run, metres: float, first: int, last: int):
    """The run with its cameras first to last - 1 moved along the map's x axis."""
    poses = run.poses.copy()
    poses[first:last, 0, 3] += metres
    return replace(run, poses=poses)


# -- beside evo


def write_tum(path: Path, poses: np.ndarray) -> Path:
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    np.savetxt(path, np.c_[100.0 + np.arange(len(poses)) / RATE, poses[:, :3, 3], quaternions], fmt="%.12f")
    return path


@pytest.fixture
def evo(tmp_path: Path) -> Callable[..., dict[str, float]]:
    """`evo("evo_ape", "-a")`: what evo, a program of its own, says of `random_walk(1)` and `noisy(..., 2)`."""
    folder = os.environ.get("THINGMAP_EVO")
    path = f"{folder}{os.pathsep}{os.environ.get('PATH', '')}" if folder else None
    if shutil.which("evo_ape", path=path) is None:
        pytest.skip("evo is absent: put its programs on PATH, or their folder into THINGMAP_EVO")
    truth = random_walk(1)
    files = [write_tum(tmp_path / "truth.txt", truth), write_tum(tmp_path / "estimate.txt", noisy(truth, 2))]

    def run(program: str, *options: str) -> dict[str, float]:
        results = tmp_path / f"results-{len(list(tmp_path.glob('*.zip')))}.zip"
        arguments = ["tum", *files, *options, "--save_results", results, "--no_warnings"]
        environment = {**os.environ, "HOME": str(tmp_path), "MPLBACKEND": "Agg"}  # it keeps settings in the home folder
        command = [shutil.which(program, path=path), *arguments]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=TIMEOUT)
        assert done.returncode == 0, done.stderr or done.stdout
        with ZipFile(results) as archive:
            return json.loads(archive.read("stats.json"))

    return run


def assert_same(errors: np.ndarray, statistics: dict[str, float]) -> None:
    ours = ErrorSummary.of(errors)
    for name in ("rmse", "mean", "median", "max"):
        assert getattr(ours, name) == pytest.approx(statistics[name], abs=1e-6), name
    assert ours.rmse is not None and ours.rmse > 1e-3  # there was something to agree on


def test_absolute_errors_are_those_of_evo(evo) -> None:
    truth = random_walk(1)
    estimate = noisy(truth, 2)
    assert_same(absolute_errors(estimate, truth, SAME), evo("evo_ape"))
    assert_same(absolute_errors(estimate, truth, anchor(estimate, truth)), evo("evo_ape", "--align_origin"))
    assert_same(absolute_errors(estimate, truth, align_positions(estimate, truth)), evo("evo_ape", "-a"))
    rigid, scale = align_similarity(estimate, truth)
    assert_same(absolute_errors(estimate, truth, rigid, scale), evo("evo_ape", "-as"))


@pytest.mark.parametrize("frames", [1, 10])
def test_relative_errors_are_those_of_evo(evo, frames: int) -> None:
    truth = random_walk(1)
    stamps = 100.0 + np.arange(len(truth)) / RATE
    pairs = neighbours(len(truth)) if frames == 1 else pairs_apart(stamps, frames / RATE)
    metres, radians = relative_errors(noisy(truth, 2), truth, pairs)
    options = ("--delta", str(frames), "--delta_unit", "f", *(("--all_pairs",) if frames > 1 else ()))
    assert_same(metres, evo("evo_rpe", "-r", "trans_part", *options))
    assert_same(np.degrees(radians), evo("evo_rpe", "-r", "angle_deg", *options))


# -- errors


def test_small_angles_keep_their_digits() -> None:
    angles = np.array([0.0, 1e-9, 1e-3, 2.0, np.pi])
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(angles[:, None] * np.array([0.0, 0.6, 0.8])).as_matrix()
    np.testing.assert_allclose(rotation_angles(poses), angles, rtol=1e-6, atol=1e-15)


def test_pairs_take_the_nearest_frame_a_second_later_and_none_across_a_gap() -> None:
    stamps = np.array([0.0, 0.5, 0.98, 1.03, 1.5, 5.0])
    assert pairs_apart(stamps).tolist() == [[0, 2], [1, 4]]
    assert pairs_apart(np.array([0.0, 0.3])).tolist() == []


def test_no_error_has_no_summary() -> None:
    assert ErrorSummary.of(np.empty(0)) == ErrorSummary(None, None, None, None)


# -- the protocol


def test_a_perfect_trajectory_has_no_error(scene_truth, perfect_run, make_case) -> None:
    result = evaluate(make_case(perfect_run(scene_truth), scene_truth))
    lower = [m.value for m in result.metrics if m.unit in ("m", "degrees")]
    assert len(lower) == 11 and all(value is not None and value < 1e-9 for value in lower)
    assert result.value("scale") == pytest.approx(1.0)
    assert result.value("coverage") == 1.0
    assert result.worst == ()


def test_one_jump_costs_two_relative_errors_of_its_length(scene_truth, perfect_run, make_case) -> None:
    result = evaluate(make_case(shifted(perfect_run(scene_truth), 0.2, 20, 21), scene_truth))
    assert result.value("RPE per frame") == pytest.approx(0.2 * np.sqrt(2 / 39))
    assert result.value("RPE per second") == pytest.approx(0.2 * np.sqrt(2 / 30))
    assert result.value("RPE rotation per frame") == pytest.approx(0.0, abs=1e-9)
    assert result.value("ATE rmse, first pose") == pytest.approx(0.2 / np.sqrt(40))
    assert result.value("ATE max") == pytest.approx(0.2, abs=0.02)


def test_a_trajectory_too_large_has_its_scale_and_no_error_but_for_it(scene_truth, perfect_run, make_case) -> None:
    run = perfect_run(scene_truth)
    poses = run.poses.copy()
    poses[:, :3, 3] *= 1.1
    result = evaluate(make_case(replace(run, poses=poses), scene_truth))
    assert result.value("scale") == pytest.approx(1 / 1.1)
    assert result.value("ATE rmse, Sim(3)") == pytest.approx(0.0, abs=1e-9)
    assert result.value("ATE rmse") > 0.05


def test_the_worst_frames_are_named_and_not_neighbours(scene_truth, perfect_run, make_case) -> None:
    run = shifted(shifted(perfect_run(scene_truth), 0.5, 10, 14), 0.3, 30, 31)
    worst = evaluate(make_case(run, scene_truth)).worst
    assert worst[0].frame in range(10, 14) and worst[1].frame == 30
    assert "frame-000030" in worst[1].text
    frames = [case.frame for case in worst]
    assert min(abs(a - b) for a in frames for b in frames if a != b) >= 10


def test_frames_without_a_pose_or_not_mapped_are_left_out(scene_truth, perfect_run, make_case) -> None:
    run = perfect_run(scene_truth)
    half = replace(run, stamps=run.stamps[::2], poses=run.poses[::2])
    assert evaluate(make_case(half, scene_truth)).value("coverage") == pytest.approx(0.5)
    poses = scene_truth.poses.copy()
    poses[5:15] = np.nan
    result = evaluate(make_case(run, replace(scene_truth, poses=poses)))
    assert result.value("ATE rmse") < 1e-9
    assert any("30 of 40" in note for note in result.notes)


def test_a_straight_path_is_judged_by_poses_and_says_so(scene_truth, perfect_run, make_case) -> None:
    poses = scene_truth.poses.copy()
    poses[:, :3, 3] = poses[0, :3, 3] + np.linspace(0.0, 1.0, len(poses))[:, None] * np.array([0.0, 1.0, 0.0])
    truth = replace(scene_truth, poses=poses)
    result = evaluate(make_case(perfect_run(truth), truth))
    assert result.value("ATE rmse") < 1e-9
    assert result.value("scale") is None and result.value("ATE rmse, Sim(3)") is None
    assert any("one line" in note for note in result.notes) and any("by poses" in note for note in result.notes)


def test_paths_are_drawn_from_above_in_the_axes_of_the_truth(scene_truth, perfect_run, make_case) -> None:
    above, over_time = evaluate(make_case(perfect_run(scene_truth), scene_truth)).plots
    assert above.equal
    for series in above.series:
        np.testing.assert_allclose(np.c_[series.x, series.y], scene_truth.poses[:, :2, 3], atol=1e-9)
    assert over_time.series[0].x[-1] == pytest.approx(3.9)


def test_without_alignment_only_in_the_axes_of_the_dataset(scene_truth, perfect_run, make_case) -> None:
    run = perfect_run(scene_truth)
    own = {row[0] for row in evaluate(make_case(run, scene_truth)).tables[0].rows}
    same = replace(run, poses=scene_truth.poses, object_map=replace(run.object_map, frame=MapFrame.DATASET))
    rows = {row[0]: row[1] for row in evaluate(make_case(same, scene_truth)).tables[0].rows}
    assert "none" not in own and rows["none"] == 0.0


def test_no_poses_no_result(scene_truth, perfect_run, make_case) -> None:
    run = perfect_run(scene_truth)
    case = make_case(run, scene_truth)
    with pytest.raises(NotEvaluated, match="no poses"):
        evaluate(replace(case, truth=replace(scene_truth, poses=None)))
    with pytest.raises(NotEvaluated, match="two frames"):
        evaluate(replace(case, truth_index=case.truth_index[:1], run_index=case.run_index[:1]))

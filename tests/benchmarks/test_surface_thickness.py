"""Thickness of fused surfaces: what is known of a wall, and that worse trajectories give thicker surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
import surface_thickness
from scipy.spatial.transform import Rotation
from surface_thickness import FusedSurfaces, ThicknessConfig, poses_at

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.synthetic.config import Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence

CAMERA = Intrinsics(160, 120, 131.0, 131.0, 79.5, 59.5)
FRAMES, RATE = 60, 10.0  # frames, frames a second
WALL = ThicknessConfig(every=1, width=160, places=200)


@dataclass
class WallSequence:
    """A camera that stands before a wall at one metre; its depth images are of `z` metres where that is given."""

    z: float | np.ndarray = 1.0
    broken: tuple[int, ...] = ()

    name, intrinsics, gravity, poses = "wall", CAMERA, None, None
    names = tuple(f"frame-{index:06d}" for index in range(FRAMES))
    stamps = np.arange(FRAMES) / RATE

    def __len__(self) -> int:
        return FRAMES

    def __getitem__(self, index: int) -> Frame:
        if index in self.broken:
            raise BrokenFrame(self.names[index], FrameProblem.UNREADABLE)
        depth = np.full((CAMERA.height, CAMERA.width), self.z, dtype=np.float32)
        color = np.zeros((CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
        return Frame(index, self.names[index], float(self.stamps[index]), color, depth, CAMERA)

    def __iter__(self):
        return (self[index] for index in range(FRAMES))


def along_the_view(metres: np.ndarray) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(metres), 1, 1))
    poses[:, 2, 3] = metres
    return poses


def test_a_wall_seen_from_one_place_is_thin_and_gaussian_errors_make_it_as_thick_as_they_are() -> None:
    surfaces = FusedSurfaces(WallSequence(), WALL)
    exact = surfaces.thickness(along_the_view(np.zeros(FRAMES)))
    assert exact.median == pytest.approx(0.0, abs=1e-6) and exact.places == 200
    errors = np.random.default_rng(1).normal(0.0, 0.005, FRAMES)
    assert surfaces.thickness(along_the_view(errors)).median == pytest.approx(0.005, rel=0.25)


def test_a_wall_that_comes_out_double_is_as_thick_as_half_its_layers_distance() -> None:
    surfaces = FusedSurfaces(WallSequence(), WALL)
    late = np.arange(FRAMES) >= FRAMES // 2
    assert surfaces.thickness(along_the_view(0.03 * late)).median == pytest.approx(0.015, rel=0.02)


def test_a_slanted_wall_is_measured_along_its_normal() -> None:
    u = (np.arange(CAMERA.width) - CAMERA.cx) / CAMERA.fx
    surfaces = FusedSurfaces(WallSequence(1.2 / (1.0 + 0.75 * u)[None, :]), WALL)  # 0.75 x + z = 1.2
    late = np.arange(FRAMES) >= FRAMES // 2
    cosine = 1.0 / np.hypot(1.0, 0.75)
    assert surfaces.thickness(along_the_view(0.03 * late)).median == pytest.approx(0.015 * cosine, rel=0.03)
    sideways = along_the_view(np.zeros(FRAMES))
    sideways[late, :3, 3] = 0.03 * np.array([1.0, 0.0, -0.75]) * cosine  # along the wall, which shows nothing
    assert surfaces.thickness(sideways).median == pytest.approx(0.0, abs=3e-4)


def test_who_sees_through_a_surface_contradicts_it_and_who_sees_something_before_it_says_nothing() -> None:
    surfaces = FusedSurfaces(WallSequence(), WALL)
    late = np.arange(FRAMES) >= FRAMES // 2
    offsets = surfaces.offsets(along_the_view(0.3 * late))  # two walls, the late frames' 0.3 m behind
    values = np.unique(np.round(offsets[np.isfinite(offsets)], 6))
    np.testing.assert_allclose(values, [-WALL.reach, 0.0], atol=1e-6)
    early_wall = np.isfinite(offsets).all(axis=1)  # the late frames look through it, the early ones see it
    late_wall = np.isfinite(offsets).sum(axis=1) == late.sum()  # the early ones have their own wall before it
    assert early_wall.any() and late_wall.any() and (early_wall | late_wall).all()
    assert surfaces.thickness(along_the_view(0.3 * late)).median == pytest.approx(WALL.reach / 2.0, rel=0.02)


def test_frames_without_a_pose_or_an_image_take_no_part() -> None:
    surfaces = FusedSurfaces(WallSequence(broken=(0, 7)), WALL)
    assert len(surfaces.stamps) == FRAMES - 2
    late = surfaces.stamps >= 3.0
    poses = along_the_view(0.03 * late)
    poses[late] = np.nan
    assert surfaces.thickness(poses).median is None  # 3 s are not spanned any more
    poses[-1] = np.eye(4)
    found = surfaces.thickness(poses)
    assert found.median == pytest.approx(0.0, abs=1e-6) and 0 < found.places < 200
    same = poses_at(surfaces.stamps, surfaces.stamps[::-1][:3], np.arange(48.0).reshape(3, 4, 4))
    assert np.isnan(same[:-3]).all()
    np.testing.assert_array_equal(same[-1], np.arange(16.0).reshape(4, 4))


def test_nothing_flat_is_said() -> None:
    rough = np.random.default_rng(0).uniform(0.8, 1.2, (CAMERA.height, CAMERA.width))
    for depth in (rough, np.zeros_like(rough)):
        with pytest.raises(UserError, match="flat patch"):
            FusedSurfaces(WallSequence(depth), WALL)


@pytest.fixture(scope="module")
def orbit() -> SyntheticSequence:
    return SyntheticSequence(SyntheticConfig(Preset.TABLETOP, seed=3, frames=120, width=160))


def test_the_true_trajectory_is_the_thinnest_and_noise_and_drift_make_it_thicker(orbit: SyntheticSequence) -> None:
    surfaces = FusedSurfaces(orbit, ThicknessConfig(every=8, places=600))
    truth = poses_at(surfaces.stamps, orbit.stamps, orbit.poses)
    steps = np.random.default_rng(5).standard_normal((len(truth), 6))
    walk = np.cumsum(steps, axis=0) / np.sqrt(len(steps))
    for errors in (steps, walk):
        found = []
        for scale in (0.0, 0.005, 0.012, 0.03):  # rad and m
            wrong = truth.copy()
            wrong[:, :3, :3] = truth[:, :3, :3] @ Rotation.from_rotvec(scale * errors[:, :3]).as_matrix()
            wrong[:, :3, 3] += scale * errors[:, 3:]
            found.append(surfaces.thickness(wrong).median)
        assert None not in found
        assert 0.0 < found[0] < 0.004  # of a sensor as coarse as the image
        assert all(later > 1.2 * earlier for earlier, later in pairwise(found)), found


def test_the_command_compares_trajectories(tmp_path, capsys) -> None:
    config = SyntheticConfig(Preset.TABLETOP, seed=3, frames=100, width=160)
    written = write_sequence(SyntheticSequence(config), tmp_path / "scene")
    rows = [line.split() for line in (written.folder / "poses.txt").read_text().splitlines() if line[0] != "#"]
    for number, row in enumerate(rows):
        row[3] = str(float(row[3]) + 0.02 * (number % 20 >= 10))
    (tmp_path / "worse.txt").write_text("\n".join(" ".join(row) for row in rows))
    given = ["--trajectory", f"worse={tmp_path / 'worse.txt'}", "--every", "5"]
    assert surface_thickness.main(["--sequence", str(written.folder), *given]) == 0
    said = capsys.readouterr().out
    shown = {
        cells[1].strip(): float(cells[2])
        for cells in (line.split("|") for line in said.splitlines())
        if len(cells) == 5 and cells[2].strip().replace(".", "").isdigit()
    }
    assert set(shown) == {surface_thickness.OWN, "worse"}
    assert shown[surface_thickness.OWN] < 5.0 < 7.0 < shown["worse"]
    assert surface_thickness.main(["--sequence", str(tmp_path / "absent")]) == 2
    assert "no such folder" in capsys.readouterr().err

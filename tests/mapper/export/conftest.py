"""An output folder with two things, a cloud and a path, for tests of what is written from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.map.store import OutputFolder

CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
FRAMES = 5  # every second one is a keyframe


@pytest.fixture
def folder(tmp_path: Path, make_thing, make_map) -> OutputFolder:
    """A cup, and a book that is doubtful and turned; the map's up is not one of its axes."""
    cup = make_thing(1, "cup", 0.9, position=[0.0, 0.0, 1.0], size=[0.2, 0.2, 0.2], yaw=0.0)
    book = make_thing(12, "bücher", 0.8, position=[0.3, 0.1, 1.2], size=[0.5, 0.1, 0.05], existence=0.6)
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(cup, book, classes=("spoon", "cup", "bücher"), camera=CAMERA))
    points = np.random.default_rng(3).uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0], (1000, 3))
    folder.write_cloud(points, np.tile(np.array([[200, 20, 0]], dtype=np.uint8), (1000, 1)))
    stamps, poses = path()
    folder.write_trajectory(stamps, poses)
    folder.write_keyframes(stamps[::2], poses[::2], np.tile(1e-4 * np.eye(6), (3, 1, 1)))
    folder.write_report({"command": {"sequence": str(tmp_path / "gone")}})
    return folder


def path() -> tuple[np.ndarray, np.ndarray]:
    """(5,) stamps and (5, 4, 4) `T_world_camera`."""
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, 0, 3] = 0.05 * np.arange(FRAMES)
    poses[:, :3, :3] = Rotation.from_rotvec(np.radians(2.0 * np.arange(FRAMES))[:, None] * [0.0, 1.0, 0.0]).as_matrix()
    return 10.0 + 0.1 * np.arange(FRAMES), poses


@pytest.fixture
def empty_folder(tmp_path: Path, make_map) -> OutputFolder:
    """A map of nothing, and no other file."""
    folder = OutputFolder.create(tmp_path / "empty")
    folder.write_map(replace(make_map(), things=()))
    return folder

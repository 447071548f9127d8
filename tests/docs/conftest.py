"""A cup and a bowl over a table as a finished run, and the pinhole camera once more, for tests of pictures."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection

# docs/draw_map.py is a script and finds its package beside itself; tests find both the same way
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))

if TYPE_CHECKING:
    from drawing.scene import Scene, View

POSITIONS = {"cup": (-0.2, 0.1, 1.0), "bowl": (0.25, 0.05, 1.3)}


def _make_thing(number: int, label: str, **changes: Any) -> Thing:
    values: dict[str, Any] = {
        "id": f"thing-{number:04d}",
        "label": label,
        "probability": 0.999,
        "existence": 1.0,
        "class_posterior": {label: 0.999},
        "position": POSITIONS.get(label, POSITIONS["cup"]),
        "position_covariance": 1e-4 * np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 9.0]]),
        "size": [0.2, 0.15, 0.1],
        "size_std": [0.01, 0.01, 0.01],
        "yaw": 0.3,
        "first_seen": 0.0,
        "last_seen": 1.0,
        "evidence": Evidence(5, 0, 0),
    }
    return Thing(**{**values, **changes})


@pytest.fixture(scope="session")
def make_thing() -> Callable[..., Thing]:
    """`make_thing(number, label, **changes)`."""
    return _make_thing


def _table() -> np.ndarray:
    """(M, 3) points 2 cm apart on a plane 10 cm under the things; in the first camera's axes y is down."""
    x, z = np.meshgrid(np.arange(-0.6, 0.6, 0.02), np.arange(0.6, 1.8, 0.02))
    return np.stack([x.ravel(), np.full(x.size, 0.25), z.ravel()], axis=1)


def _poses() -> np.ndarray:
    """(8, 4, 4), from left to right, looking along z."""
    poses = np.tile(np.eye(4), (8, 1, 1))
    poses[:, 0, 3] = np.linspace(-0.1, 0.1, 8)
    return poses


@pytest.fixture
def write_out(tmp_path: Path) -> Callable[..., Path]:
    """`write_out(*things)` writes the folder of a run."""

    def write(*things: Thing) -> Path:
        folder = OutputFolder.create(tmp_path / "out")
        up = UpDirection(np.array([0.0, -1.0, 0.0]), 0.01, "planes")
        folder.write_map(ObjectMap(things, ("cup", "bowl"), "table", MapFrame.FIRST_CAMERA, up), include_doubtful=True)
        folder.write_trajectory(np.arange(8) / 10.0, _poses())
        points = _table()
        folder.write_cloud(points, np.full(points.shape, 120, dtype=np.uint8))
        return folder.path

    return write


@pytest.fixture
def scene(write_out: Callable[..., Path]) -> Scene:
    """The cup, first, and the bowl."""
    from drawing.scene import read_scene

    return read_scene(write_out(_make_thing(1, "cup"), _make_thing(2, "bowl")))


def _pixels(view: View, points: np.ndarray) -> np.ndarray:
    local = np.linalg.inv(view.T_world_view) @ np.column_stack([points, np.ones(len(points))]).T
    k = view.intrinsics
    return np.column_stack([k.fx * local[0] / local[2] + k.cx, k.fy * local[1] / local[2] + k.cy])


@pytest.fixture(scope="session")
def pixels() -> Callable[..., np.ndarray]:
    """`pixels(view, points)`: (N, 3) map coordinates to (N, 2), by the pinhole equations alone."""
    return _pixels

"""Maps as Open3D geometries."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.mapper.export.open3d_scene import PACKAGES, load_open3d, to_open3d
from thingmap.mapper.map.store import OutputFolder


def test_geometries_are_those_of_the_map(tmp_path: Path, make_thing, make_map):
    try:
        load_open3d()
    except UserError as error:
        pytest.skip(str(error))
    folder = OutputFolder.create(tmp_path / "out")
    thing = make_thing(position=np.array([1.0, 2.0, 3.0]), size=np.array([0.2, 0.3, 0.4]))
    folder.write_map(make_map(thing))
    points = np.array([[0.0, 0.0, 1.0], [0.5, 0.0, 1.0]])
    folder.write_cloud(points, np.array([[255, 0, 0], [0, 255, 0]], dtype=np.uint8))

    cloud, box = to_open3d(tmp_path / "out")
    assert np.allclose(np.asarray(cloud.points), points)
    assert np.allclose(np.asarray(cloud.colors), [[1, 0, 0], [0, 1, 0]])
    assert np.allclose(box.get_center(), thing.position)
    assert np.allclose(box.extent, thing.size)
    corners = thing.corners(make_map(thing).R_world_upright)
    found = np.asarray(box.get_box_points())
    assert np.linalg.norm(corners[:, None] - found[None], axis=2).min(axis=1).max() < 1e-6


def test_what_is_missing_is_said_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)  # makes `import open3d` fail
    with pytest.raises(UserError) as error:
        load_open3d()
    assert PACKAGES in str(error.value)
    assert "\n" not in str(error.value)

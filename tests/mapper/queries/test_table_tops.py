"""Tables that no detector named: level surfaces of the cloud, and what is on, under and next to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import UserError
from thingmap.mapper.map.map_file import CLOUD_NAME
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.upright import upright_rotation
from thingmap.mapper.queries.level_surfaces import level_surfaces
from thingmap.mapper.queries.table_tops import means_table

SPACING = 0.02
MUG = [0.08, 0.08, 0.1]


def grid(low: tuple[float, float], high: tuple[float, float]) -> np.ndarray:
    """(M, 2) points of a rectangle, one in every square of the spacing."""
    sides = (np.arange(a + SPACING / 2.0, b, SPACING) for a, b in zip(low, high, strict=True))
    return np.stack([axis.ravel() for axis in np.meshgrid(*sides)], axis=1)


def level(low: tuple[float, float], high: tuple[float, float], height: float) -> np.ndarray:
    return np.column_stack([grid(low, high), np.full(len(grid(low, high)), height)])


@pytest.fixture(scope="module")
def cloud() -> np.ndarray:
    """A floor, a table turned by 30 degrees with a hole where something stands, a wall, a ramp, noise of 3 mm."""
    floor = level((-2.0, -2.0), (2.0, 2.0), 0.0)
    top = level((-0.6, -0.4), (0.6, 0.4), 0.75)
    top = top[np.max(np.abs(top[:, :2] - [0.3, 0.1]), axis=1) > 0.05]
    top = top @ Rotation.from_euler("z", 30, degrees=True).as_matrix().T
    along = grid((-2.0, 0.0), (2.0, 2.4))
    wall = np.column_stack([along[:, 0], np.full(len(along), 1.99), along[:, 1]])
    ramp = level((-1.8, -1.8), (-0.8, -0.8), 0.4)
    ramp[:, 2] += 0.6 * (ramp[:, 0] + 1.3)
    shelf = level((1.0, 1.5), (1.3, 1.8), 0.75)  # too small for a table
    points = np.concatenate([floor, top, wall, ramp, shelf])
    return points + np.random.default_rng(0).normal(0.0, 0.003, points.shape)


@pytest.fixture
def placed(tmp_path: Path):
    """`placed(object_map, points)`: the map with a cloud beside it, whose up is the map's."""

    def make(object_map, points: np.ndarray, carried: float | None = None):
        out = OutputFolder(tmp_path)
        R = upright_rotation(object_map.up.direction)
        out.write_cloud(points @ R.T, np.full((len(points), 3), 128, dtype=np.uint8))
        if carried is not None:
            poses = np.tile(np.eye(4), (3, 1, 1))
            poses[:, :3, 3] = R @ [0.0, 0.0, carried]
            out.write_trajectory(np.array([0.0, 0.1, 0.2]), poses)
        return replace(object_map, cloud=tmp_path / CLOUD_NAME)

    return make


def test_floor_and_table_are_found_and_nothing_else(cloud) -> None:
    floor, table = level_surfaces(cloud, SPACING)
    assert floor.height == pytest.approx(0.0, abs=0.003) and table.height == pytest.approx(0.75, abs=0.003)
    assert floor.area == pytest.approx(16.0, rel=0.1) and table.area == pytest.approx(0.95, rel=0.15)
    assert sorted(table.extents) == pytest.approx([0.8, 1.2], abs=0.04)
    assert np.degrees(table.yaw) % 90.0 == pytest.approx(30.0, abs=2.0)
    assert table.centre == pytest.approx([0.0, 0.0], abs=0.02) and 0.003 < table.height_std < 0.01
    assert level_surfaces(cloud[:0], SPACING) == ()


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.1, -0.9, -0.4)])
def test_what_is_on_under_and_beside_a_table_that_nobody_named(cloud, box, room, placed, up) -> None:
    R = upright_rotation(np.array(up) / np.linalg.norm(up))

    def put(number, label, position, size):
        return box(number, label, R @ np.array(position), size, position_covariance=2.5e-5 * np.eye(3))

    object_map = room(
        put(1, "mug", [0.3, 0.1, 0.80], MUG),
        put(2, "book", [-0.3, 0.0, 0.765], [0.25, 0.2, 0.03]),
        put(3, "mug", [-0.3, 0.0, 0.83], MUG),
        put(4, "mug", [1.5, -1.0, 0.05], MUG),
        put(5, "bag", [0.0, 0.1, 0.15], [0.3, 0.2, 0.3]),
        put(6, "chair", [-0.65, 0.9, 0.45], [0.4, 0.4, 0.9]),
        up=tuple(R[:, 2]),
    )
    things = placed(object_map, cloud)

    def ids(answers):
        return sorted(answer.thing.id[-1] for answer in answers)

    assert ids(things.on("the table")) == ["1", "2"]
    assert min(answer.probability for answer in things.on("table")) > 0.9
    assert ids(things.on("wooden desk", "mug")) == ["1"]
    assert ids(things.under("table")) == ["5"]
    assert ids(things.next_to("table")) == ["6"]
    with pytest.raises(UserError, match="no label 'sofa'"):
        things.on("sofa")
    with pytest.raises(UserError, match="no label 'table'"):
        things.inside("table")
    with pytest.raises(UserError, match="no label 'table'"):
        object_map.on("table")


def test_a_table_of_the_map_counts_before_the_cloud(cloud, box, room, placed) -> None:
    table = box(1, "dining table", [0.0, 5.0, 0.375], [1.2, 0.8, 0.75])
    mugs = box(2, "mug", [0.3, 0.1, 0.80], MUG), box(3, "mug", [0.0, 5.0, 0.80], MUG)
    things = placed(room(table, *mugs), cloud)
    assert [answer.thing.id for answer in things.on("table")] == ["thing-0003"]
    assert things.table_tops("table") == () and len(things.table_tops("counter")) == 1


@pytest.mark.parametrize(("carried", "count"), [(None, 1), (0.5, 1), (1.4, 0)])
def test_a_single_surface_is_a_table_if_the_camera_was_low_above_it(box, room, placed, carried, count) -> None:
    things = placed(room(box(1, "mug", [0.0, 0.0, 0.05], MUG)), level((-0.7, -0.7), (0.7, 0.7), 0.0), carried)
    assert len(things.table_tops("table")) == count
    if count:
        assert [answer.thing.id for answer in things.on("table")] == ["thing-0001"]
    else:
        with pytest.raises(UserError, match="no label 'table'"):
            things.on("table")


def test_words_for_tables() -> None:
    assert all(map(means_table, ("table", "the kitchen table", "my white desk", "Tables", "worktop")))
    assert not any(map(means_table, ("table lamp", "chair", "stool", "", "thing-0001")))

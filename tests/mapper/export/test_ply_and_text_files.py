"""The formats that need nothing else: JSON, CSV and PLY."""

import csv
import json

import numpy as np
import pytest
from plyfile import PlyData

from thingmap.datasets.errors import InputError
from thingmap.mapper.export import exporter
from thingmap.mapper.export.colors import class_color
from thingmap.mapper.map.boxes import EDGES
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder


@pytest.fixture
def cup_and_book(tmp_path, make_thing, make_map):
    """Two things and a cloud: a point in the cup, one in both, one outside."""
    cup = make_thing(1, "cup", 0.9, position=[0.0, 0.0, 1.0], size=[0.2, 0.2, 0.2], yaw=0.0)
    book = make_thing(2, "bücher,\nlarge", 0.8, position=[0.05, 0.0, 1.0], size=[0.5, 0.1, 0.1], yaw=0.0)
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(cup, book, classes=("spoon", "cup", "bücher,\nlarge")))
    points = np.array([[0.0, 0.09, 1.0], [0.0, 0.0, 1.0], [5.0, 5.0, 5.0]])
    folder.write_cloud(points, np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], dtype=np.uint8))
    return folder


def test_json_is_a_map_with_corners(cup_and_book, tmp_path):
    file = tmp_path / "map2.json"
    assert exporter("json")(cup_and_book, file) == 2
    exported, original = ObjectMap.load(file), cup_and_book.read_map()
    assert [thing.id for thing in exported.things] == [thing.id for thing in original.things]

    corners = np.array(json.loads(file.read_text())["things"][0]["corners"])
    np.testing.assert_allclose(corners, original.things[0].corners(original.R_world_upright))


def test_csv_has_a_row_for_every_thing(cup_and_book, tmp_path):
    file = tmp_path / "map.csv"
    assert exporter("csv")(cup_and_book, file) == 2
    with file.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["id"] for row in rows] == ["thing-0001", "thing-0002"]
    assert rows[1]["label"] == "bücher,\nlarge"
    first = rows[0]
    assert [float(first[key]) for key in ("x", "y", "z", "size_x", "std_x", "std_z", "cov_xy")] == pytest.approx(
        [0.0, 0.0, 1.0, 0.2, 0.01, 0.03, 0.0]
    )
    assert (first["second_label"], float(first["second_probability"])) == ("bowl", pytest.approx(0.1))
    assert (first["supporting"], first["occluded"], first["contradicting"]) == ("12", "3", "1")
    pandas = pytest.importorskip("pandas")
    table = pandas.read_csv(file)
    assert table["label"].tolist() == ["cup", "bücher,\nlarge"] and table["size_x"].dtype == np.float64


def test_csv_without_a_second_label(tmp_path, make_thing, make_map):
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(make_thing(1, "cup", 1.0, class_posterior={"cup": 1.0})))
    exporter("csv")(folder, tmp_path / "map.csv")
    with (tmp_path / "map.csv").open(newline="") as stream:
        assert next(csv.DictReader(stream))["second_label"] == ""


def test_ply_holds_boxes_and_cloud(cup_and_book, tmp_path):
    file = tmp_path / "map.ply"
    assert exporter("ply")(cup_and_book, file) == 2
    ply = PlyData.read(str(file))
    vertices, edges = ply["vertex"].data, ply["edge"].data
    things = cup_and_book.read_map().things
    up = cup_and_book.read_map().R_world_upright

    corners = np.stack([vertices[axis] for axis in "xyz"], axis=1)[:16].reshape(2, 8, 3)
    np.testing.assert_allclose(corners, [thing.corners(up) for thing in things], atol=1e-6)
    np.testing.assert_array_equal(np.stack([edges["vertex1"], edges["vertex2"]], axis=1)[12:], EDGES + 8)

    for start, thing, label in ((0, 1, 2), (8, 2, 3)):  # "cup" is the second class, the book the third
        part = vertices[start : start + 8]
        assert set(part["label"].tolist()) == {label} and set(part["thing"].tolist()) == {thing}
        color = class_color(things[thing - 1].label).tolist()
        assert [part["red"][0], part["green"][0], part["blue"][0]] == color
        assert [edges[name][12 * (thing - 1)] for name in ("red", "green", "blue")] == color

    cloud = vertices[16:19]
    assert cloud["label"].tolist() == [2, 3, 0]  # the second point is in both: the book's box is the smaller one
    assert cloud["thing"].tolist() == [1, 2, 0]
    assert cloud["green"].tolist() == [2, 5, 8]
    assert 'label 3 "b\\u00fccher,\\nlarge"' in ply.comments and 'thing 2 "thing-0002"' in ply.comments


def test_dots_lie_on_the_edges(cup_and_book, tmp_path):
    exporter("ply")(cup_and_book, tmp_path / "map.ply")
    vertices = PlyData.read(str(tmp_path / "map.ply"))["vertex"].data[19:]
    dots = np.stack([vertices[axis] for axis in "xyz"], axis=1)
    thing = cup_and_book.read_map().things[0]
    mine = dots[vertices["thing"] == 1]
    relative = np.abs((mine - thing.position) @ cup_and_book.read_map().R_world_upright) / (thing.size / 2)
    on_faces = np.isclose(relative, 1.0, atol=1e-5).sum(axis=1)
    assert (on_faces >= 2).all() and (relative < 1.0 + 1e-5).all()
    assert len(mine) == 12 * 40  # 0.2 m in steps of 5 mm
    assert len(dots) > len(mine)


def test_ply_opens_in_open3d(cup_and_book, tmp_path):
    try:
        import open3d
    except (ImportError, OSError) as error:  # it needs system libraries
        pytest.skip(f"open3d does not import: {error}")
    file = tmp_path / "map.ply"
    exporter("ply")(cup_and_book, file)
    vertices = PlyData.read(str(file))["vertex"].data
    cloud = open3d.io.read_point_cloud(str(file))
    assert len(cloud.points) == len(vertices)
    np.testing.assert_allclose(np.asarray(cloud.colors)[17], np.array([4, 5, 6]) / 255)
    lines = open3d.io.read_line_set(str(file))
    assert len(lines.lines) == 24
    np.testing.assert_array_equal(np.asarray(lines.lines)[:12], EDGES)


def test_a_map_without_things_or_cloud_still_exports(tmp_path, make_map):
    folder = OutputFolder.create(tmp_path / "out")
    whole = make_map()
    folder.write_map(ObjectMap((), whole.classes, whole.source, whole.frame, whole.up))
    for name in ("json", "csv", "ply"):
        assert exporter(name)(folder, tmp_path / f"map.{name}") == 0
    assert len(PlyData.read(str(tmp_path / "map.ply"))["vertex"].data) == 0


def test_damaged_clouds_are_named_and_nothing_is_written(cup_and_book, tmp_path):
    cup_and_book.cloud_file.write_bytes(b"ply\nrubbish")
    with pytest.raises(InputError, match=r"cloud\.ply"):
        exporter("ply")(cup_and_book, tmp_path / "map.ply")
    assert not (tmp_path / "map.ply").exists()


def test_colors_depend_on_the_name_alone():
    names = ["cup", "bowl", "book", "plant", "chair", "keyboard"]
    colors = {tuple(class_color(name).tolist()) for name in names}
    assert len(colors) == len(names)
    assert all(max(color) >= 0.74 * 255 for color in colors)
    np.testing.assert_array_equal(class_color("Cup"), class_color("cup"))

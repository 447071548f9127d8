"""glTF, read by trimesh and by its own specification."""

from __future__ import annotations

import base64
import json
import struct

import numpy as np
import pytest

from thingmap.mapper.export.chosen import read_path
from thingmap.mapper.export.colors import class_color, linear_color
from thingmap.mapper.export.gltf_file import export_glb, export_gltf
from thingmap.mapper.map.map_file import thing_to_dict
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.up_direction import UpDirection
from thingmap.mapper.map.upright import upright_rotation

UPRIGHT_TO_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def read_glb(file) -> tuple[dict, bytes]:
    content = file.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON" and size % 4 == 0
    document = json.loads(content[20 : 20 + size])
    rest = content[20 + size :]
    if rest:
        binary, kind = struct.unpack_from("<I4s", rest)
        assert kind == b"BIN\0" and binary == len(rest) - 8 == document["buffers"][0]["byteLength"]
    return document, rest[8:]


def test_trimesh_finds_every_thing_where_the_map_has_it(folder, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    assert export_glb(folder, tmp_path / "map.glb") == 2
    scene = trimesh.load(tmp_path / "map.glb")
    object_map = folder.read_map()
    R = UPRIGHT_TO_Y_UP @ object_map.R_world_upright.T
    for thing in object_map.things:
        T, _ = scene.graph.get(f"{thing.label} {thing.id}")
        corners = trimesh.transform_points(scene.geometry[thing.label].vertices, T)
        expected = thing.corners(object_map.R_world_upright) @ R.T
        np.testing.assert_allclose(corners, expected, atol=1e-6)
    assert scene.geometry["cup"].volume == pytest.approx(1.0)  # all faces look outwards
    up = R @ object_map.up.direction
    np.testing.assert_allclose(up, [0, 1, 0], atol=1e-9)

    points, _ = folder.read_cloud()
    np.testing.assert_allclose(scene.geometry["cloud"].vertices, points, atol=1e-6)
    T, _ = scene.graph.get("cloud")
    np.testing.assert_allclose(T[:3, :3], R, atol=1e-7)
    _, poses = read_path(folder)
    line = scene.geometry["trajectory"]
    np.testing.assert_allclose(line.length, np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum(), rtol=1e-5)


def test_extras_are_the_numbers_of_the_map(folder, tmp_path):
    export_glb(folder, tmp_path / "map.glb")
    document, _ = read_glb(tmp_path / "map.glb")
    object_map = folder.read_map()
    nodes = {node["name"]: node for node in document["nodes"]}
    for thing in object_map.things:
        assert nodes[f"{thing.label} {thing.id}"]["extras"] == thing_to_dict(thing)
    about = nodes["map"]["extras"]
    assert about["frame"] == "first camera" and about["units"].startswith("metres")
    np.testing.assert_allclose(about["up"], object_map.up.direction)
    assert nodes["trajectory"]["extras"]["stamps"] == pytest.approx(read_path(folder)[0])


def test_colors_are_linear_light(folder, tmp_path):
    export_glb(folder, tmp_path / "map.glb")
    document, binary = read_glb(tmp_path / "map.glb")
    cloud = next(mesh for mesh in document["meshes"] if mesh["name"] == "cloud")["primitives"][0]
    accessor = document["accessors"][cloud["attributes"]["COLOR_0"]]
    view = document["bufferViews"][accessor["bufferView"]]
    light = np.frombuffer(binary, "<u2", 4, view["byteOffset"]) / 65535.0
    # sRGB 200 is ((200/255 + 0.055) / 1.055)^2.4, 20 likewise
    np.testing.assert_allclose(light, [0.5776, 0.00700, 0.0, 1.0], atol=2e-4)
    cup = next(one for one in document["materials"] if one["name"] == "cup")
    factor = cup["pbrMetallicRoughness"]["baseColorFactor"]
    np.testing.assert_allclose(factor[:3], linear_color(class_color("cup")), atol=1e-6)


def test_fewer_points_are_the_same_ones_every_time(folder, tmp_path):
    for name in ("one.glb", "two.glb"):
        export_glb(folder, tmp_path / name, points=100)
    assert (tmp_path / "one.glb").read_bytes() == (tmp_path / "two.glb").read_bytes()
    document, _ = read_glb(tmp_path / "one.glb")
    cloud = next(mesh for mesh in document["meshes"] if mesh["name"] == "cloud")["primitives"][0]
    assert document["accessors"][cloud["attributes"]["POSITION"]]["count"] == 100
    export_glb(folder, tmp_path / "none.glb", points=0)
    assert "cloud" not in [node["name"] for node in read_glb(tmp_path / "none.glb")[0]["nodes"]]


def test_gltf_has_the_same_in_json(folder, tmp_path):
    export_glb(folder, tmp_path / "map.glb")
    assert export_gltf(folder, tmp_path / "map.gltf") == 2
    binary, (document, buffer) = json.loads((tmp_path / "map.gltf").read_text()), read_glb(tmp_path / "map.glb")
    uri = binary["buffers"][0].pop("uri")
    assert base64.b64decode(uri.split(",", 1)[1]) == buffer
    assert binary == document


def test_doubtful_things_can_be_left_out(folder, tmp_path):
    assert export_glb(folder, tmp_path / "map.glb", min_existence=0.7) == 1
    names = [node["name"] for node in read_glb(tmp_path / "map.glb")[0]["nodes"]]
    assert "cup thing-0001" in names and not any("thing-0012" in name for name in names)


def test_a_map_of_nothing_is_a_valid_file(empty_folder, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    assert export_glb(empty_folder, tmp_path / "map.glb") == 0
    document, binary = read_glb(tmp_path / "map.glb")
    assert binary == b"" and not {"meshes", "accessors", "buffers", "materials"} & set(document)
    assert len(trimesh.load(tmp_path / "map.glb").geometry) == 0


def test_y_is_up_whatever_the_map(make_map, make_thing, tmp_path):
    """A map whose up is +z keeps x, and its z becomes y."""
    trimesh = pytest.importorskip("trimesh")
    folder = OutputFolder.create(tmp_path / "out")
    up = UpDirection(np.array([0.0, 0.0, 1.0]), 0.01, "planes")
    folder.write_map(make_map(make_thing(1, position=[1.0, 2.0, 3.0]), up=up))
    np.testing.assert_array_equal(upright_rotation(up.direction), np.eye(3))
    export_glb(folder, tmp_path / "map.glb")
    T, _ = trimesh.load(tmp_path / "map.glb").graph.get("cup thing-0001")
    np.testing.assert_allclose(T[:3, 3], [1.0, 3.0, -2.0], atol=1e-9)

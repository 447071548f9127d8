"""Scene graphs, read by spark_dsg."""

from __future__ import annotations

import json

import numpy as np
import pytest

from thingmap.mapper.export.colors import class_color
from thingmap.mapper.export.dsg_file import export_dsg
from thingmap.mapper.export.trajectory_files import read_poses
from thingmap.mapper.map.store import OutputFolder

dsg = pytest.importorskip("spark_dsg", reason="spark_dsg is not installed")


def load(folder: OutputFolder, tmp_path, **options):
    export_dsg(folder, tmp_path / "map.dsg.json", **options)
    return dsg.DynamicSceneGraph.load(str(tmp_path / "map.dsg.json"))


def test_objects_are_the_things(folder, tmp_path):
    graph, object_map = load(folder, tmp_path), folder.read_map()
    R = object_map.R_world_upright
    assert graph.get_layer(dsg.DsgLayers.OBJECTS).num_nodes() == 2
    for number, thing in zip((1, 12), object_map.things, strict=True):
        own = graph.get_node(dsg.NodeSymbol("O", number)).attributes
        assert isinstance(own, dsg.ObjectNodeAttributes)
        assert own.name == f"{thing.label} {thing.id}" and own.registered
        assert graph.get_labelspace(2, 0).get_category(own.semantic_label) == thing.label
        np.testing.assert_allclose(own.position, R.T @ thing.position)
        np.testing.assert_allclose(own.bounding_box.dimensions, thing.size, rtol=1e-6)
        np.testing.assert_array_equal(own.color[:3], class_color(thing.label))
        corners, expected = np.array(own.bounding_box.corners()), thing.corners(R) @ R
        assert np.linalg.norm(corners[:, None] - expected[None], axis=2).min(axis=1).max() < 1e-6
        numbers = own.metadata.get()
        assert (numbers["existence"], numbers["class_posterior"]) == (thing.existence, dict(thing.class_posterior))
        assert numbers["position"] == thing.position.tolist()


def test_agents_are_the_keyframes(folder, tmp_path):
    graph = load(folder, tmp_path)
    stamps, poses = read_poses(folder, keyframes=True)
    R = folder.read_map().R_world_upright
    layer = graph.get_layer(2, ord("a"))
    assert layer.num_nodes() == len(stamps) == 3 and graph.num_edges() == 2
    for k, (stamp, pose) in enumerate(zip(stamps, poses, strict=True)):
        own = graph.get_node(dsg.NodeSymbol("a", k)).attributes
        assert own.timestamp.total_seconds() == pytest.approx(stamp)
        np.testing.assert_allclose(own.position, R.T @ pose[:3, 3], atol=1e-12)
        turn = own.world_R_body
        w, x, y, z = (getattr(turn, name) for name in "wxyz")
        forward = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        np.testing.assert_allclose(forward, R.T @ pose[:3, 2], atol=1e-9)


def test_metadata_lead_back_to_the_map(folder, tmp_path):
    about = load(folder, tmp_path).metadata.get()["thingmap"]
    R, thing = np.array(about["R_map_upright"]), folder.read_map().things[1]
    np.testing.assert_allclose(R @ [0.0, 0.0, 1.0], folder.read_map().up.direction)
    assert about["frame"] == "first camera"
    position = load(folder, tmp_path).get_node(dsg.NodeSymbol("O", 12)).attributes.position
    np.testing.assert_allclose(R @ position, thing.position, atol=1e-12)


def test_what_spark_dsg_writes_again_is_the_same(folder, tmp_path):
    """The file says nothing that it does not know, and leaves out nothing that it writes."""
    load(folder, tmp_path).save(str(tmp_path / "again.json"))
    mine, again = (json.loads((tmp_path / name).read_text()) for name in ("map.dsg.json", "again.json"))
    assert set(mine) == set(again) and mine["SPARK_DSG_header"]["version"]["major"] == 1
    for one, other in zip(mine["nodes"], sorted(again["nodes"], key=lambda n: n["id"]), strict=True):
        assert set(one) == set(other) and set(one["attributes"]) == set(other["attributes"])


def test_ids_without_a_number_of_their_own(make_thing, make_map, tmp_path):
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(*(make_thing(1, id=name) for name in ("a-7", "b-7", "mug", "thing-0009"))))
    graph = load(folder, tmp_path)
    ids = {graph.get_node(dsg.NodeSymbol("O", n)).attributes.metadata.get()["id"]: n for n in (9, 10, 11, 12)}
    assert ids == {"thing-0009": 9, "a-7": 10, "b-7": 11, "mug": 12}


def test_a_map_of_nothing_and_of_sure_things(empty_folder, folder, tmp_path):
    assert load(empty_folder, tmp_path).num_nodes() == 0
    graph = load(folder, tmp_path, min_existence=0.7)
    assert graph.get_layer(dsg.DsgLayers.OBJECTS).num_nodes() == 1

"""Exports are of the map as people left it."""

from __future__ import annotations

import csv
import json
import struct

import pytest

from thingmap.mapper.edits.editor import MapEditor
from thingmap.mapper.export import exporter
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder


@pytest.fixture
def edited(folder: OutputFolder) -> OutputFolder:
    """The cup is a spoon of a certain name, and the book is gone."""
    editor = MapEditor(folder.path, who="ann")
    editor.relabel("thing-0001", "spoon", why="I looked")
    editor.name("thing-0001", "grandma's")
    editor.delete("thing-0012")
    return folder


def test_tables(edited, tmp_path):
    assert exporter("csv")(edited, tmp_path / "a.csv") == 1
    with (tmp_path / "a.csv").open(newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert (row["id"], row["label"], row["name"]) == ("thing-0001", "spoon", "grandma's")
    pandas = pytest.importorskip("pandas")
    assert exporter("parquet")(edited, tmp_path / "a.parquet") == 1
    table = pandas.read_parquet(tmp_path / "a.parquet")
    assert table[["label", "name"]].values.tolist() == [["spoon", "grandma's"]]


def test_json_keeps_who_and_why(edited, tmp_path):
    assert exporter("json")(edited, tmp_path / "a.json") == 1
    thing = ObjectMap.load(tmp_path / "a.json").thing("thing-0001")
    assert (thing.label, thing.name) == ("spoon", "grandma's")
    assert [(edit.who, edit.why) for edit in thing.edits] == [("ann", "I looked"), ("ann", "")]


def test_scenes(edited, tmp_path):
    assert exporter("glb")(edited, tmp_path / "a.glb") == 1
    content = (tmp_path / "a.glb").read_bytes()
    document = json.loads(content[20 : 20 + struct.unpack_from("<I", content, 12)[0]])
    node = next(one for one in document["nodes"] if one["name"] == "grandma's thing-0001")
    assert node["extras"]["label"] == "spoon"
    assert document["meshes"][node["mesh"]]["name"] == "spoon"
    assert exporter("dsg")(edited, tmp_path / "a.dsg.json") == 1
    graph = json.loads((tmp_path / "a.dsg.json").read_text())
    own = next(one["attributes"] for one in graph["nodes"] if one["attributes"]["type"] == "ObjectNodeAttributes")
    names = dict(graph["metadata"]["labelspaces"]["_l2p0"])
    assert (own["name"], names[own["semantic_label"]]) == ("grandma's thing-0001", "spoon")

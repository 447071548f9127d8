"""Points of things: `ObjectMap.points`, and what labelling has written into the map's file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.map.labels_file import PointLabels, write_labels
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection
from thingmap.mapper.map.volume import Volume

POINTS = np.array([[0.0, 0.0, 0.25], [1.0, 0.5, 0.0], [0.5, 0.0, 0.0], [2.0, 0.0, 0.0], [0.25, 0.0, 0.125]])
LABELS = np.array([0, 1, 0, NO_OBJECT, 0])
NUMBERS = np.array([2, 1, 2, 0, 0])  # of things, from 1 on
COUNTS = {"cup": 3, "bowl": 1, "background": 1}


def make_thing(number: int, **changes) -> Thing:
    values = {
        "id": f"thing-{number:04d}",
        "label": "cup",
        "probability": 1.0,
        "existence": 0.9,
        "class_posterior": {"cup": 1.0},
        "position": np.zeros(3),
        "position_covariance": np.eye(3) * 1e-4,
        "size": np.full(3, 0.1),
        "size_std": np.full(3, 0.01),
        "yaw": 0.0,
        "first_seen": 0.0,
        "last_seen": 1.0,
        "evidence": Evidence(1, 0, 0),
    }
    return Thing(**(values | changes))


def make_map(*things: Thing) -> ObjectMap:
    up = UpDirection(np.array([0.0, 0.0, 1.0]), 0.01, "test")
    return ObjectMap(things, ("cup", "bowl"), "a table", MapFrame.DATASET, up)


@pytest.fixture
def bare(tmp_path) -> Path:
    """A folder with a map of three things."""
    make_map(make_thing(3), make_thing(7), make_thing(9)).save(tmp_path)
    return tmp_path


@pytest.fixture
def out(bare) -> Path:
    """The same, labelled: the second thing has two points, the first one, the third none."""
    ids = [thing.id for thing in ObjectMap.load(bare).things]
    colors = np.zeros((5, 3), np.uint8)
    labels = PointLabels(LABELS, instance=NUMBERS)
    write_labels(OutputFolder(bare).labels_file, POINTS, colors, labels, ("cup", "bowl"), ids)
    change(bare, labels={"file": "labels.ply", "points": COUNTS})
    change_things(bare, lambda n, thing: thing | {"points": [1, 2, 0][n]})
    return bare


def change(folder: Path, **values) -> None:
    document = json.loads((folder / "map.json").read_text())
    (folder / "map.json").write_text(json.dumps(document | values))


def change_things(folder: Path, of) -> None:
    things = json.loads((folder / "map.json").read_text())["things"]
    change(folder, things=[of(n, thing) for n, thing in enumerate(things)])


def test_a_thing_has_its_points(out):
    object_map = ObjectMap.load(out)
    first, second, third = object_map.things
    assert object_map.points(first).tolist() == [[1.0, 0.5, 0.0]]
    assert object_map.points(second).tolist() == [[0.0, 0.0, 0.25], [0.5, 0.0, 0.0]]
    assert object_map.points("thing-0007").tolist() == object_map.points(second).tolist()
    assert object_map.points(third).shape == (0, 3)
    assert [thing.points for thing in object_map.things] == [1, 2, 0]


def test_a_map_keeps_what_labelling_wrote(out):
    volume = {"position": [0.5, 0.0, 0.1], "size": [0.2, 0.1, 0.1], "size_std": [0.03, 0.01, 0.01], "yaw": 0.3}
    change_things(out, lambda n, thing: thing | ({"volume": volume} if n == 1 else {}))
    object_map = ObjectMap.load(out)
    before = json.loads((out / "map.json").read_text())
    object_map.save(out / "map.json")
    after = json.loads((out / "map.json").read_text())
    assert after == before and list(after)[-1] == "things"
    again = ObjectMap.load(out)
    assert again.labels is not None and dict(again.labels.points) == COUNTS
    assert again.things[1].volume.to_dict() == volume and again.things[0].volume is None
    before_labelling = again.things[1].volume.of(again.things[1])
    assert before_labelling.size.tolist() == volume["size"] and before_labelling.yaw == 0.3
    assert before_labelling.volume is None
    assert len(again.points("thing-0007")) == 2


def test_things_are_found_by_name_also_where_some_are_left_out(out):
    """A map that is written again without doubtful things numbers the rest differently."""
    change_things(out, lambda n, thing: thing | {"existence": 0.3 if n == 0 else 0.9})
    ObjectMap.load(out).save(out)
    object_map = ObjectMap.load(out)
    assert [thing.id for thing in object_map.things] == ["thing-0007", "thing-0009"]
    assert len(object_map.points("thing-0007")) == 2


def test_a_map_that_is_not_labelled_says_so(bare):
    object_map = ObjectMap.load(bare)
    assert object_map.labels is None and object_map.things[0].points is None
    with pytest.raises(UserError, match=r"not labelled.*thingmap label"):
        object_map.points("thing-0003")
    with pytest.raises(UserError, match=r"thing-0004.*no such thing"):
        object_map.points("thing-0004")
    assert "labels" not in json.loads((bare / "map.json").read_text())


def test_labels_without_things_say_so(out):
    change_things(out, lambda n, thing: {key: value for key, value in thing.items() if key != "points"})
    with pytest.raises(UserError, match=r"which points are thing-0003's.*thingmap label"):
        ObjectMap.load(out).points("thing-0003")


def test_the_cloud_of_another_map_is_refused(out):
    write_labels(
        OutputFolder(out).labels_file,
        POINTS,
        np.zeros((5, 3), np.uint8),
        PointLabels(LABELS, instance=NUMBERS),
        ("cup",),
        ["thing-0007", "x"],
    )
    with pytest.raises(InputError, match=r"labels\.ply.*2 points for thing-0007.*found 1"):
        ObjectMap.load(out).points("thing-0007")


@pytest.mark.parametrize("what", ["missing", "no ply", "unnumbered", "cut"])
def test_a_damaged_cloud_is_named(out, what):
    file = out / "labels.ply"
    if what == "missing":
        file.unlink()
    elif what == "no ply":
        file.write_text("no cloud")
    elif what == "cut":
        file.write_bytes(file.read_bytes()[:-20])
    else:
        write_labels(
            OutputFolder(out).labels_file, POINTS, np.zeros((5, 3), np.uint8), PointLabels(LABELS), ("cup", "bowl")
        )
    with pytest.raises(InputError, match=r"labels\.ply.*thingmap label"):
        ObjectMap.load(out).points("thing-0007")


@pytest.mark.parametrize(
    "labels", [3, {"points": {}}, {"file": "../x.ply", "points": {}}, {"file": "x.ply", "points": {"cup": -1}}]
)
def test_mistakes_in_the_map_are_named(out, labels):
    change(out, labels=labels)
    with pytest.raises(InputError, match=r"map\.json.*labels"):
        ObjectMap.load(out)


@pytest.mark.parametrize(
    "values",
    [
        {"points": -1},
        {"points": 1.5},
        {"volume": 3},
        {"volume": {"position": [0.0] * 3, "size": [0.1] * 3, "size_std": [0.1] * 3}},
        {"volume": {"position": [0.0] * 3, "size": [0.1] * 2, "size_std": [0.1] * 3, "yaw": 0.0}},
        {"volume": {"position": [0.0] * 3, "size": [-0.1] * 3, "size_std": [0.1] * 3, "yaw": 0.0}},
    ],
)
def test_mistakes_in_things_are_named(out, values):
    change_things(out, lambda n, thing: thing | (values if n == 1 else {}))
    with pytest.raises(InputError, match=r"map\.json.*things\[1\]"):
        ObjectMap.load(out)


def test_a_thing_checks_its_points():
    with pytest.raises(ValueError, match="points"):
        make_thing(1, points=-1)


@pytest.mark.parametrize("wrong", [{"size": np.ones(2)}, {"size_std": -np.ones(3)}, {"yaw": np.nan}])
def test_a_volume_checks_its_values(wrong):
    with pytest.raises(ValueError, match=r"size|yaw"):
        Volume(**({"position": np.zeros(3), "size": np.ones(3), "size_std": np.ones(3), "yaw": 0.0} | wrong))

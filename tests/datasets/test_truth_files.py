import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.truth import TrueObject
from thingmap.datasets.truth_files import TruthPaths, TruthRecord, read_record, write_record, write_whole

METRES = st.floats(-1e6, 1e6)
UNKNOWN = st.just(np.full(3, np.nan))
POSITIONS = st.one_of(UNKNOWN, st.lists(METRES, min_size=3, max_size=3).map(np.array))
SIZES = st.one_of(UNKNOWN, st.lists(st.floats(1e-9, 1e3), min_size=3, max_size=3).map(np.array))


def record(**changes) -> TruthRecord:
    cup = TrueObject(0, "cup", np.array([0.1, 0.2, 0.3]), np.array([0.08, 0.08, 0.1]), 0.5)
    book = TrueObject(1, "book", np.array([1.0, 0.0, 0.8]), np.array([0.2, 0.15, 0.03]), -1.0)
    values: dict = {
        "source": "synth:tabletop",
        "up": np.array([0.0, 0.0, 1.0]),
        "classes": ("cup", "bowl"),
        "objects": (cup,),
        "clutter": (book,),
        "configuration": {"kind": "SyntheticConfig", "seed": 3, "camera": {"gain": 0.1}},
        "names": ("frame-000000", "frame-000001"),
        "has_cloud": True,
    }
    return TruthRecord(**{**values, **changes})


@given(position=POSITIONS, size=SIZES, yaw=st.floats(-10, 10), label=st.text(min_size=1))
def test_a_record_comes_back_digit_by_digit(tmp_path_factory, position, size, yaw, label) -> None:
    path = tmp_path_factory.mktemp("truth") / "truth.json"
    thing = TrueObject(7, "cup", position, size, yaw)
    written = record(objects=(thing,), clutter=(TrueObject(8, label, position, size, yaw),), source=label)
    write_record(path, written)
    back = read_record(path)
    for one, other in zip((*back.objects, *back.clutter), (*written.objects, *written.clutter), strict=True):
        assert (one.id, one.label, one.yaw) == (other.id, other.label, other.yaw)
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(one.size, other.size)
    np.testing.assert_array_equal(back.up, written.up)
    for name in ("source", "classes", "configuration", "names", "has_cloud"):
        assert getattr(back, name) == getattr(written, name)


def damaged(path: Path, change) -> None:
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


def put(*keys_and_value):
    """Sets a value deep in a document."""
    *keys, last, value = keys_and_value

    def change(document) -> None:
        for key in keys:
            document = document[key]
        document[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (put("schema", "thingmap-truth/9"), ['"thingmap-truth/1"', "thingmap-truth/9"]),
        (lambda d: d.pop("schema"), ["schema", "none"]),
        (lambda d: d.pop("classes"), ["the key classes"]),
        (put("classes", ["cup", "cup"]), ["classes", "cup twice"]),
        (put("classes", ["bowl"]), ["labels of the classes bowl", "cup"]),
        (put("objects", 0, "position", [1, 2]), ["three numbers", "objects[0].position", "[1, 2]"]),
        (put("objects", 0, "position", [1, 2, "x"]), ["objects[0].position"]),
        (put("objects", 0, "position", [1, 2, float("inf")]), ["objects[0].position"]),
        (put("objects", 0, "size", [1, 0, 1]), ["three numbers > 0", "objects[0].size"]),
        (put("objects", 0, "yaw", None), ["a number", "objects[0].yaw", "null"]),
        (put("objects", 0, "id", -1), ["objects[0].id"]),
        (put("objects", 0, "id", True), ["objects[0].id"]),
        (put("objects", 0, "label", ""), ["objects[0].label"]),
        (put("objects", 0, 5), ["an object", "objects[0]"]),
        (put("clutter", 0, "id", 0), ["an id of its own"]),
        (put("clutter", "none"), ["a list", "clutter"]),
        (put("up", [0, 0, 2]), ["length 1", "up"]),
        (put("cloud", "yes"), ["true or false", "cloud"]),
        (put("configuration", []), ["configuration"]),
        (put("names", [1, 2]), ["a list of names", "names"]),
        (put("names", ["../frame-000000", "b"]), ["without a folder", "../frame-000000"]),
        (put("source", 3), ["source"]),
    ],
)
def test_damage_is_told_with_its_place(tmp_path: Path, change, parts: list[str]) -> None:
    path = tmp_path / "truth.json"
    write_record(path, record())
    damaged(path, change)
    with pytest.raises(InputError) as error:
        read_record(path)
    for part in (str(path), "thingmap synth", *parts):
        assert part in str(error.value)


@pytest.mark.parametrize(
    ("content", "found"),
    [(b"", "an empty file"), (b"{", "no JSON"), (b"[]", "[]"), (b"\xff\xfe\x00", "not text"), (b"[" * 9999, "nested")],
)
def test_what_is_no_json_object_is_told(tmp_path: Path, content: bytes, found: str) -> None:
    path = tmp_path / "truth.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"truth\.json") as error:
        read_record(path)
    assert found in str(error.value)


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_record(TruthPaths(tmp_path).record)


def test_a_file_that_cannot_be_written_keeps_its_old_content(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be written"):
        write_whole(tmp_path / "absent" / "file", b"new")
    place = tmp_path / "place"
    place.mkdir()
    with pytest.raises(UserError, match="cannot be written"):
        write_whole(place, b"new")
    assert list(tmp_path.iterdir()) == [place]

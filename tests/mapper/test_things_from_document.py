"""Things are read the same way at once as one by one."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.json_record import JsonRecord
from thingmap.mapper.map import things_from_document
from thingmap.mapper.map.map_file import format_document, thing_to_dict, to_document
from thingmap.mapper.map.thing import Thing
from thingmap.mapper.map.things_from_document import things_from
from thingmap.mapper.map.views_file import EvidenceFile
from thingmap.mapper.map.volume import Volume

FILE = Path("map.json")
VIEWS = EvidenceFile(Path("evidence.npz"), "", FILE)


def read(document: dict) -> tuple[Thing, ...]:
    return things_from(JsonRecord(document, FILE, "write it again"), VIEWS, None)


def one_by_one(document: dict, monkeypatch) -> tuple[Thing, ...]:
    def refuse(*_):
        raise ValueError

    with monkeypatch.context() as patch:
        patch.setattr(things_from_document, "_at_once", refuse)
        return read(document)


@pytest.fixture
def document(make_map, make_thing) -> dict:
    """Some things with what labelling and people add, some without."""
    volume = Volume(np.zeros(3), np.array([0.1, 0.2, 0.3]), np.full(3, 0.01), 0.5)
    things = [
        make_thing(0),
        make_thing(1, points=12),
        make_thing(2, volume=volume, points=3),
        make_thing(3, name="my mug"),
    ]
    return json.loads(format_document(to_document(make_map(*things, make_thing(4, points=0)))))


def test_all_fields_are_the_same(document, monkeypatch):
    quick, slow = read(document), one_by_one(document, monkeypatch)
    assert [thing_to_dict(thing) for thing in quick] == [thing_to_dict(thing) for thing in slow]
    assert [thing.id for thing in quick] == [f"thing-{k:04d}" for k in range(5)]
    for a, b in zip(quick, slow, strict=True):
        for field in fields(Thing):
            ours, other = getattr(a, field.name), getattr(b, field.name)
            assert type(ours) is type(other), field.name
            if isinstance(ours, np.ndarray):
                assert not ours.flags.writeable and ours.dtype == other.dtype and np.array_equal(ours, other)
            elif field.name != "volume":  # compared as a dictionary above
                assert ours == other


def test_no_things():
    assert read({"things": []}) == ()


def test_things_that_are_well_are_not_read_one_by_one(document, monkeypatch):
    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(things_from_document, "_thing_from", refuse)
    plain = {"things": [document["things"][k] for k in (0, 1, 4)]}
    assert [thing.points for thing in read(plain)] == [None, 12, 0]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("id", 3, r"a string at things\[1\].id"),
        ("label", "", r"valid values at things\[1\]"),
        ("existence", True, r"a number at things\[1\].existence"),
        ("existence", 1.2, r"things\[1\], found existence must be in \[0, 1\]"),
        ("yaw", float("nan"), r"a number at things\[1\].yaw"),
        ("last_seen", None, r"a number at things\[1\].last_seen"),
        ("position", [0.0, 1.0], r"3 numbers at things\[1\].position"),
        ("position", [0.0, 1.0, float("inf")], r"position must be finite"),
        ("position", ["0", "1", "2"], r"3 numbers at things\[1\].position"),
        ("size", [0.1, -0.1, 0.1], "size and size_std must not be negative"),
        ("position_covariance", [[1, 0, 0], [1, 1, 0], [0, 0, 1]], "must be symmetric"),
        ("position_covariance", [[1, 2, 0], [2, 1, 0], [0, 0, 1]], "no negative eigenvalue"),
        ("class_posterior", {"lamp": 0.9}, "probability 0.[0-9]+ must be class_posterior"),
        ("class_posterior", {"cup": 0.9, "lamp": "much"}, r"a number at things\[1\].class_posterior.lamp"),
        ("class_posterior", {"cup": 0.9, "lamp": 0.9}, "class_posterior must be probabilities"),
        ("evidence", {"supporting": 1, "occluded": -1, "contradicting": 0}, "a whole number >= 0 at"),
        ("evidence", {"supporting": 1}, r"the key things\[1\].evidence"),
        ("points", None, r"a whole number >= 0 at things\[1\].points"),
        ("points", True, r"a whole number >= 0 at things\[1\].points"),
    ],
)
def test_one_wrong_value_among_others_is_named(document, key, value, message):
    document["things"][1][key] = value
    if key == "class_posterior" and "cup" in value:
        document["things"][1] |= {"label": "cup", "probability": 0.9}
    with pytest.raises(InputError, match=message):
        read(document)


def test_whole_numbers_are_numbers(document):
    document["things"][1] |= {"label": "cup", "probability": 1, "class_posterior": {"cup": 1}, "yaw": 0}
    thing = read(document)[1]
    assert (thing.probability, thing.class_posterior, thing.yaw) == (1.0, {"cup": 1.0}, 0.0)
    assert type(thing.class_posterior["cup"]) is type(thing.yaw) is float

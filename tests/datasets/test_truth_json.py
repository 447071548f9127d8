import json
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.truth_json import FALSE_RADIUS, read_known_objects, truth_of_known_objects

MUG = {"name": "white mug", "class": "cup", "position": [1, 2.5, 3], "tolerance": 0.08}
CHAIR = {"name": "chair", "class": "chair", "position": [0, 0, 1], "tolerance": 0.3, "size": [0.5, 0.5, 1], "yaw": 0.4}
BOWL = {"class": "bowl", "position": [1, 2, 3], "truth": "the white mug"}


def write(path: Path, objects=(MUG, CHAIR), **more) -> Path:
    path.write_text(json.dumps({"objects": list(objects), **more}))
    return path


def test_objects_and_false_detections(tmp_path: Path) -> None:
    far = BOWL | {"tolerance": 0.5, "class": "cup"}
    del far["truth"]
    path = write(tmp_path / "objects.json", frame="world", known_false_detections=[BOWL, far])
    known = read_known_objects(path)
    assert [item.name for item in known.objects] == ["white mug", "chair"]
    assert [item.name for item in known.false_detections] == ["no bowl: the white mug", "no cup: nothing"]
    assert [item.tolerance for item in known.false_detections] == [FALSE_RADIUS, 0.5]
    truth = truth_of_known_objects(path)
    assert (truth.name, truth.classes, truth.complete) == ("objects", ("cup", "chair", "bowl"), False)
    assert truth.tolerance == {0: 0.08, 1: 0.3, 2: FALSE_RADIUS, 3: 0.5}
    assert [thing.id for thing in (*truth.objects, *truth.false_detections)] == [0, 1, 2, 3]
    mug, chair = truth.objects
    np.testing.assert_array_equal(mug.position, [1, 2.5, 3])
    assert np.isnan(mug.size).all() and mug.yaw == 0.0
    np.testing.assert_array_equal(chair.size, [0.5, 0.5, 1])
    assert chair.yaw == 0.4
    assert truth.located == truth.objects and truth.poses is None


def test_a_place_without_known_false_detections(tmp_path: Path) -> None:
    truth = truth_of_known_objects(write(tmp_path / "objects.json"))
    assert (truth.false_detections, truth.classes) == ((), ("cup", "chair"))


@pytest.mark.parametrize("key", ["name", "class", "position", "tolerance"])
def test_a_missing_key_is_told(tmp_path: Path, key: str) -> None:
    item = {name: value for name, value in MUG.items() if name != key}
    with pytest.raises(InputError, match=rf"the key objects\[1\]\.{key}"):
        read_known_objects(write(tmp_path / "objects.json", [CHAIR, item]))


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"position": [1, 2]}, "three numbers"),
        ({"position": [1, 2, float("nan")]}, "three numbers"),
        ({"position": "here"}, "three numbers"),
        ({"position": [1, [2], 3]}, "three numbers"),
        ({"position": [1, 10**400, 3]}, "too large"),
        ({"tolerance": 10**400}, "too large"),
        ({"tolerance": 0}, "> 0"),
        ({"tolerance": "small"}, "a number"),
        ({"size": [0.1, 0.1, -0.1]}, "objects[0].size"),
        ({"yaw": "left"}, "objects[0].yaw"),
        ({"class": 3}, "objects[0].class"),
        ({"name": ""}, "objects[0].name"),
    ],
)
def test_an_impossible_value_is_told(tmp_path: Path, change: dict, part: str) -> None:
    with pytest.raises(InputError) as error:
        read_known_objects(write(tmp_path / "objects.json", [MUG | change]))
    assert part in str(error.value) and "truth_json.py" in str(error.value)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "an empty file"),
        ("[]", "an object at the top"),
        ('{"things": []}', "the key objects"),
        ('{"objects": {}}', "a list at objects"),
        ('{"objects": [3]}', "an object at objects[0]"),
        ('{"objects": [], "known_false_detections": 3}', "known_false_detections"),
        ("{'objects': []}", "no JSON"),
        ('{"objects": ' + "9" * 5000 + "}", "too many digits"),
    ],
)
def test_another_form_is_told(tmp_path: Path, text: str, part: str) -> None:
    (tmp_path / "objects.json").write_text(text)
    with pytest.raises(InputError) as error:
        read_known_objects(tmp_path / "objects.json")
    assert part in str(error.value)


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_known_objects(tmp_path / "objects.json")


def test_the_objects_of_redkitchen(real_data: Path) -> None:
    known = read_known_objects(real_data / "redkitchen" / "objects_derived.json")
    assert len(known.objects) == 7 and len(known.false_detections) == 3
    assert known.objects[0].name == "white mug" and known.objects[0].tolerance == 0.08
    np.testing.assert_array_equal(known.objects[0].thing.position, [-0.73, -0.157, 1.93])

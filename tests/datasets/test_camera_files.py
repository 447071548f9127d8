import json
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.camera_files import (
    EXAMPLE_JSON,
    read_camera_json,
    read_camera_matrix,
    read_gravity,
    read_orb_slam_settings,
)
from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Intrinsics

GOOD = {"width": 64, "height": 48, "fx": 60, "fy": 61.5, "cx": 31.5, "cy": 23.5, "depth_scale": 1000}


def test_json_with_and_without_what_is_optional(tmp_path: Path) -> None:
    path = tmp_path / "intrinsics.json"
    path.write_text(json.dumps(GOOD))
    camera = read_camera_json(path)
    assert camera.intrinsics == Intrinsics(64, 48, 60.0, 61.5, 31.5, 23.5)
    assert (camera.depth_scale, camera.fps, camera.gravity) == (1000.0, 30.0, None)
    path.write_text(json.dumps(GOOD | {"fps": 15, "gravity": [0, 0, -2]}))
    camera = read_camera_json(path)
    assert camera.fps == 15.0
    np.testing.assert_array_equal(camera.gravity, [0, 0, -1])


def test_the_example_that_errors_show_is_itself_correct(tmp_path: Path) -> None:
    (tmp_path / "intrinsics.json").write_text(EXAMPLE_JSON)
    assert read_camera_json(tmp_path / "intrinsics.json").intrinsics.fx == 525


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, ["no such file", EXAMPLE_JSON]),
        ("{'width': 640}", ["expected JSON", "line 1", EXAMPLE_JSON]),
        ("[1, 2]", ["found list"]),
        ({"fx": None}, ["positive number", '"fx"', "None"]),
        ({"fy": "61"}, ["'61'"]),
        ({"fy": -61}, ["-61"]),
        ({"width": True}, ["True"]),
        ({"width": 64.5}, ["whole pixels", "64.5 x 48"]),
        ({"depth_scale": 0.001}, ["metres per unit", "write 1000"]),
        ({"cx": 700}, ["principal point inside the image", "(700, 23.5) in 64 x 48"]),
        ({"distortion": [0.1]}, ["also distortion", "free of distortion"]),
        ({"gravity": [0, 0]}, ["[0, 0]"]),
        ({"gravity": [0, 0, 0]}, ["not zero"]),
        ({"gravity": "down"}, ["'down'"]),
        ({"fps": 0}, ['"fps"']),
    ],
)
def test_a_wrong_json_says_what_to_write(tmp_path: Path, content: object, words: list[str]) -> None:
    path = tmp_path / "intrinsics.json"
    if content is not None:
        path.write_text(content if isinstance(content, str) else json.dumps(GOOD | content))
    with pytest.raises(InputError) as error:
        read_camera_json(path)
    assert all(word in str(error.value) for word in [str(path), *words]), str(error.value)


@pytest.mark.parametrize("key", GOOD)
def test_each_missing_key_is_named(tmp_path: Path, key: str) -> None:
    (tmp_path / "i.json").write_text(json.dumps({k: v for k, v in GOOD.items() if k != key}))
    with pytest.raises(InputError, match=f"found no {key}; write it like"):
        read_camera_json(tmp_path / "i.json")


def test_a_camera_matrix(tmp_path: Path) -> None:
    (tmp_path / "k.txt").write_text("5.85e+02 0 320\n0 5.86e+02 240\n0 0 1\n")
    assert read_camera_matrix(tmp_path / "k.txt", 640, 480) == Intrinsics(640, 480, 585, 586, 320, 240)


@pytest.mark.parametrize(
    "text", ["585 0 320\n0 585 240\n", "585 3 320\n0 585 240\n0 0 1\n", "585 0 320\n0 585 240\n0 0 2\n",
             "-585 0 320\n0 585 240\n0 0 1\n", "585 0 320 0\n0 585 240 0\n0 0 1 0\n"]
)  # fmt: skip
def test_what_is_no_camera_matrix_is_told(tmp_path: Path, text: str) -> None:
    (tmp_path / "k.txt").write_text(text)
    with pytest.raises(InputError, match=r"k\.txt"):
        read_camera_matrix(tmp_path / "k.txt", 640, 480)


def test_orb_slam_settings_of_both_generations(tmp_path: Path) -> None:
    path = tmp_path / "TUM3.yaml"
    values = "Camera{0}.fx: 535.4\nCamera{0}.fy: 539.2\nCamera{0}.cx: 320.1\nCamera{0}.cy: 247.6\n"
    path.write_text("%YAML:1.0\n# Camera.fx: 1\n" + values.format("") + "Camera.k1: 0.0\nDepthMapFactor: 5000.0\n")
    assert read_orb_slam_settings(path, 640, 480) == (Intrinsics(640, 480, 535.4, 539.2, 320.1, 247.6), 5000.0)
    path.write_text(values.format("1"))
    assert read_orb_slam_settings(path, 640, 480) == (Intrinsics(640, 480, 535.4, 539.2, 320.1, 247.6), None)
    path.write_text("Camera.fx: 535.4\nCamera.cx: 320\n")
    with pytest.raises(InputError, match=r"no Camera\.fy, Camera\.cy"):
        read_orb_slam_settings(path, 640, 480)


def test_gravity_is_a_unit_vector_or_an_error_or_absent(tmp_path: Path) -> None:
    path = tmp_path / "gravity-direction.txt"
    assert read_gravity(path) is None
    path.write_text("0\n3\n4\n")
    np.testing.assert_allclose(read_gravity(path), [0, 0.6, 0.8])
    for wrong in ("0 0", "0 0 0", "0 down 1", "nan 0 1"):
        path.write_text(wrong)
        with pytest.raises(InputError):
            read_gravity(path)

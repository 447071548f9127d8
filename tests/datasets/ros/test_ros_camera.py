"""The pinhole camera of a bag."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.ros.camera import read_camera

BAG = Path("a.mcap")
LENS = (0.25, -0.1, 0.002, -0.001, 0.0)


@pytest.fixture
def messages(record: Callable[..., Any]) -> Any:
    return record("mcap").messages


@pytest.mark.parametrize(("model", "lens"), [("plumb_bob", LENS), ("equidistant", (0.2, 0.05, 0.0, 0.0))])
def test_a_point_is_found_where_the_pinhole_camera_sees_it(messages: Any, model: str, lens: tuple[float, ...]) -> None:
    camera = read_camera(BAG, "/info", messages.info(0, lens, model), rectified=False)
    k = camera.intrinsics
    for x, y in ((-0.4, 0.3), (0.35, -0.25), (0.0, 0.0)):
        point = np.array([[[x, y, 1.0]]])
        if model == "plumb_bob":
            pixel, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), k.matrix, np.array(lens))
        else:
            pixel, _ = cv2.fisheye.projectPoints(point, np.zeros(3), np.zeros(3), k.matrix, np.array(lens))
        u, v = pixel.ravel()
        columns, rows = np.meshgrid(np.arange(k.width), np.arange(k.height))
        recorded = np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / 8.0).astype(np.float32)
        seen = camera.undistort_color(np.dstack([recorded] * 3))[..., 0]
        centre = np.array([(seen * columns).sum(), (seen * rows).sum()]) / seen.sum()
        np.testing.assert_allclose(centre, k.project(point[0])[0], atol=0.3)


def test_depth_is_moved_and_never_mixed(messages: Any) -> None:
    camera = read_camera(BAG, "/info", messages.info(0, LENS), rectified=False)
    depth = np.full((48, 64), 1.0, np.float32)
    depth[:, 32:] = 3.0
    assert set(np.unique(camera.undistort_depth(depth))) <= {0.0, 1.0, 3.0}


def test_a_lens_that_moves_nothing_is_left_alone(tmp_path: Path, record: Callable[..., Any], messages: Any) -> None:
    assert read_camera(BAG, "/info", messages.info(0, (0.001, 0, 0, 0, 0)), rectified=False).maps is None
    made = record("mcap", distortion=LENS)
    frame = open_sequence(made.write(tmp_path / "a.mcap"))[0]
    assert (frame.color != made.rgb[0]).any()


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"k": (0.0, 0.0, 0.0, 0.0)}, "calibrat"),
        ({"binning": 2}, "binning 2 x 2"),
        ({"offset": 8}, "region from"),
        ({"k": (60.0, 60.0, 99.0, 24.0)}, "principal point"),
        ({"model": "double_sphere", "distortion": LENS}, "'double_sphere'"),
    ],
)
def test_cameras_that_are_refused(messages: Any, changes: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        read_camera(BAG, "/info", messages.info(0, **changes), rectified=False)


def test_a_calibration_of_another_size(tmp_path: Path, record: Callable[..., Any], known: Any) -> None:
    made = record("mcap")
    for row in made.rows:
        if row[0] == known.names["info"]:
            row[2].width = 128
    with pytest.raises(InputError, match="64 x 48, the camera 128 x 48"):
        open_sequence(made.write(tmp_path / "a.mcap"))

"""Which topics are taken, and what is said where that cannot be told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.open import open_sequence

LEFT = "/camera/infra1/image_rect_raw"
OWN_DEPTH = "/camera/depth/image_rect_raw"


@pytest.fixture
def realsense(record: Callable[..., Any]) -> Any:
    """With its infrared and its unaligned depth, which come before the aligned one by name."""
    made = record("mcap")
    grey = made.rgb[..., 0]
    for i, stamp in enumerate(made.stamps):
        frame = "camera_depth_optical_frame"
        made.rows += [
            (LEFT, stamp, made.messages.image(stamp, grey[i], "mono8", frame)),
            (OWN_DEPTH, stamp, made.messages.image(stamp, made.depth[i] + 1, "16UC1", frame)),
            ("/camera/depth/camera_info", stamp, made.messages.info(stamp, frame=frame)),
        ]
    return made


def test_colour_and_the_depth_in_its_frame_are_chosen(tmp_path: Path, realsense: Any, known: Any) -> None:
    sequence = open_sequence(realsense.write(tmp_path / "a.mcap"))
    topics = sequence.topics
    assert (topics.color.topic.name, topics.depth.topic.name) == (known.names["color"], known.names["depth"])
    assert topics.info == known.names["info"]
    np.testing.assert_allclose(sequence[0].depth, realsense.depth[0] / 1000.0, rtol=1e-6)


def test_depth_of_another_frame_is_not_taken_for_aligned(tmp_path: Path, realsense: Any, known: Any) -> None:
    realsense.rows = [row for row in realsense.rows if row[0] != known.names["depth"]]
    path = realsense.write(tmp_path / "a.mcap")
    with pytest.raises(InputError) as caught:
        open_sequence(path)
    text = str(caught.value)
    for part in (
        OWN_DEPTH,
        LEFT,
        known.names["color"],
        "16UC1",
        "64 x 48",
        "camera_depth_optical_frame",
        "color=TOPIC",
    ):
        assert part in text
    assert len(open_sequence(f"{path}?depth={OWN_DEPTH}&color={known.names['color']}")) == 3  # the user's word counts


def test_two_colours_in_one_frame_have_to_be_told(tmp_path: Path, realsense: Any, known: Any) -> None:
    other = "/other/image"
    for stamp, rgb in zip(realsense.stamps, realsense.rgb, strict=True):
        realsense.rows.append((other, stamp, realsense.messages.image(stamp, 255 - rgb, "rgb8")))
    path = realsense.write(tmp_path / "a.mcap")
    with pytest.raises(InputError, match="2 that could be"):
        open_sequence(path)
    chosen = open_sequence(f"{path}?color={other}")
    np.testing.assert_array_equal(chosen[0].color, 255 - realsense.rgb[0])
    assert chosen.topics.info == known.names["info"]  # by frame and size


def test_raw_is_taken_before_compressed(tmp_path: Path, record: Callable[..., Any], known: Any, png: Any) -> None:
    made = record("db3")
    compressed = known.names["color"] + "/compressed"
    for stamp, rgb in zip(made.stamps, made.rgb, strict=True):
        data = png(255 - rgb[:, :, ::-1])
        made.rows.append((compressed, stamp, made.messages.compressed(stamp, data, "rgb8; png compressed bgr8")))
    path = made.write(tmp_path / "a.db3")
    np.testing.assert_array_equal(open_sequence(path)[0].color, made.rgb[0])
    np.testing.assert_array_equal(open_sequence(f"{path}?color={compressed}")[0].color, 255 - made.rgb[0])


def test_rectified_is_taken_before_what_it_was_made_of(tmp_path: Path, record: Callable[..., Any], known: Any) -> None:
    made = record("mcap", distortion=(0.3, 0.1, 0.0, 0.0, 0.0))
    rectified = "/camera/color/image_rect_color"
    projection = np.array([50.0, 0, 30, 0, 0, 51, 22, 0, 0, 0, 1, 0])
    for i, (topic, logged, _) in enumerate(made.rows):
        if topic == known.names["info"]:
            message = made.messages.info(logged, (0.3, 0.1, 0.0, 0.0, 0.0), p=projection)
            made.rows[i] = (topic, logged, message)
    for stamp, rgb in zip(made.stamps, made.rgb, strict=True):
        made.rows.append((rectified, stamp, made.messages.image(stamp, 255 - rgb, "rgb8")))
    sequence = open_sequence(made.write(tmp_path / "a.mcap"))
    assert sequence.topics.color.topic.name == rectified
    k = sequence.intrinsics
    assert (k.fx, k.fy, k.cx, k.cy) == (50.0, 51.0, 30.0, 22.0)
    np.testing.assert_array_equal(sequence[0].color, 255 - made.rgb[0])


@pytest.mark.parametrize("option", ["color", "depth", "info"])
def test_names_that_are_no_such_topics(tmp_path: Path, realsense: Any, known: Any, option: str) -> None:
    path = realsense.write(tmp_path / "a.mcap")
    with pytest.raises(InputError, match="/nowhere") as caught:
        open_sequence(f"{path}?{option}=/nowhere")
    assert known.names["info" if option == "info" else "color"] in str(caught.value)
    wrong = known.names["color" if option == "info" else "info"]
    with pytest.raises(InputError, match=wrong):
        open_sequence(f"{path}?{option}={wrong}")


def test_without_a_calibration(tmp_path: Path, record: Callable[..., Any], known: Any) -> None:
    made = record("mcap")
    made.rows = [row for row in made.rows if row[0] != known.names["info"]]
    with pytest.raises(InputError, match="CameraInfo"):
        open_sequence(made.write(tmp_path / "a.mcap"))


def test_a_bag_without_images_lists_what_it_has(tmp_path: Path, record: Callable[..., Any], known: Any) -> None:
    made = record("bag")
    made.rows = [row for row in made.rows if row[0] == known.names["info"]]
    with pytest.raises(InputError, match=r"camera_info \(sensor_msgs/msg/CameraInfo, 3\)"):
        open_sequence(made.write(tmp_path / "a.bag"))

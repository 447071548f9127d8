"""Frames from bags of ROS 1 and 2."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import BrokenFrame, FrameProblem
from thingmap.datasets.open import open_sequence
from thingmap.datasets.ros.open import find_bags
from thingmap.datasets.ros.sequence import Unpaired
from thingmap.datasets.sequence import Sequence

KINDS = ("bag", "db3", "mcap")


@pytest.mark.parametrize("kind", KINDS)
def test_frames_are_what_was_recorded(tmp_path: Path, record: Callable[..., Any], known: Any, kind: str) -> None:
    made = record(kind)
    sequence = open_sequence(made.write(tmp_path / f"a.{kind}"))
    assert isinstance(sequence, Sequence)
    assert sequence.name == "a" and len(sequence) == 3
    assert sequence.poses is None and sequence.gravity is None and sequence.unpaired == Unpaired(0, 0)
    k = sequence.intrinsics
    assert (k.width, k.height) == known.size and (k.fx, k.fy, k.cx, k.cy) == known.k
    np.testing.assert_allclose(sequence.stamps, np.array(made.stamps) / 1e9, atol=1e-6)
    for i in (2, 0, 1):  # any order
        frame = sequence[i]
        assert frame.index == i and frame.name == sequence.names[i]
        assert int(frame.name.replace(".", "")) == made.stamps[i]
        np.testing.assert_array_equal(frame.color, made.rgb[i])
        np.testing.assert_allclose(frame.depth, made.depth[i] / 1000.0, rtol=1e-6)
        assert frame.depth.dtype == np.float32 and frame.depth[0, 0] == 0.0
    np.testing.assert_array_equal(sequence[-1].color, made.rgb[2])
    with pytest.raises(IndexError):
        sequence[3]


@pytest.mark.parametrize("kind", KINDS)
def test_a_bare_file_or_the_folder_around_it_will_do(tmp_path: Path, record: Callable[..., Any], kind: str) -> None:
    (tmp_path / "inner").mkdir()
    path = record(kind).write(tmp_path / "inner" / f"b.{kind}")
    if path.is_dir():
        (path / "metadata.yaml").unlink()
        path = next(path.glob(f"*.{kind}"))
    assert len(open_sequence(path)) == len(open_sequence(path.parent)) == 3
    assert find_bags(path) == find_bags(path.parent) == [path]


def test_compressed_bags(tmp_path: Path, record: Callable[..., Any]) -> None:
    made = record("db3")
    np.testing.assert_array_equal(open_sequence(made.write(tmp_path / "a.db3", compress=True))[1].color, made.rgb[1])


def test_pairs_are_by_header_stamps_and_the_rest_is_counted(
    tmp_path: Path, record: Callable[..., Any], known: Any
) -> None:
    made = record("mcap", frames=5)
    color, depth = known.names["color"], known.names["depth"]
    lost = {(depth, 1), (color, 3)}
    count = dict.fromkeys((color, depth, known.names["info"]), -1)
    kept = []
    for topic, logged, message in made.rows:
        count[topic] += 1
        if (topic, count[topic]) not in lost:
            kept.append((topic, made.stamps[-1] * 2 - logged if topic == depth else logged, message))
    made.rows = kept  # depth was recorded in reverse: only its headers tell
    sequence = open_sequence(made.write(tmp_path / "a.mcap"))
    assert sequence.unpaired == Unpaired(1, 1)
    for frame, i in zip(sequence, (0, 2, 4), strict=True):
        np.testing.assert_array_equal(frame.color, made.rgb[i])
        np.testing.assert_allclose(frame.depth, made.depth[i] / 1000.0, rtol=1e-6)


def test_messages_recorded_in_one_nanosecond_are_told_apart(tmp_path: Path, record: Callable[..., Any]) -> None:
    made = record("mcap")
    made.rows = [(topic, made.stamps[0], message) for topic, _, message in made.rows]
    sequence = open_sequence(made.write(tmp_path / "a.mcap"))
    for i, frame in enumerate(sequence):
        np.testing.assert_array_equal(frame.color, made.rgb[i])


def test_headers_never_set_leave_the_times_of_recording(tmp_path: Path, record: Callable[..., Any], known: Any) -> None:
    made = record("bag")
    for _, _, message in made.rows:
        message.header.stamp.sec = message.header.stamp.nanosec = 0
    sequence = open_sequence(made.write(tmp_path / "a.bag"))
    assert len(sequence) == 3
    np.testing.assert_allclose(np.diff(sequence.stamps), known.period / 1e9, atol=1e-6)
    np.testing.assert_array_equal(sequence[2].color, made.rgb[2])


def test_images_too_far_apart_are_no_frames(tmp_path: Path, record: Callable[..., Any]) -> None:
    path = record("mcap", frames=1, lag=30_000_000).write(tmp_path / "a.mcap")
    with pytest.raises(InputError, match=r"within 0\.02 s"):
        open_sequence(path)


def test_one_damaged_message_is_one_broken_frame(tmp_path: Path, record: Callable[..., Any], known: Any) -> None:
    made = record("mcap", frames=5)
    at = [i for i, row in enumerate(made.rows) if row[0] == known.names["color"]]
    topic, logged, message = made.rows[at[1]]
    raw = bytes(made.messages.store.serialize_cdr(message, message.__msgtype__))
    made.rows[at[1]] = (topic, logged, raw[:60])
    topic, logged, message = made.rows[at[2]]
    made.rows[at[2]] = (topic, logged, made.messages.image(made.stamps[2], made.rgb[2][:, :32], "rgb8"))
    topic, logged, message = made.rows[at[3] - 1]
    empty = np.zeros_like(made.depth[3])
    made.rows[at[3] - 1] = (topic, logged, made.messages.image(made.stamps[3], empty, "16UC1"))
    sequence = open_sequence(made.write(tmp_path / "a.mcap"))
    problems = (FrameProblem.UNREADABLE, FrameProblem.SIZE_MISMATCH, FrameProblem.NO_DEPTH)
    for i, problem in zip((1, 2, 3), problems, strict=True):
        with pytest.raises(BrokenFrame) as caught:
            sequence[i]
        assert caught.value.problem is problem
        assert known.names["depth" if i == 3 else "color"] in caught.value.detail
    np.testing.assert_array_equal(sequence[4].color, made.rgb[4])


def test_a_file_cut_off_is_the_users_mistake(tmp_path: Path, record: Callable[..., Any]) -> None:
    path = record("bag").write(tmp_path / "a.bag")
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(InputError, match="reindex"):
        open_sequence(path)
    (tmp_path / "text.mcap").write_text("no bag at all")
    with pytest.raises(InputError, match="magic"):
        open_sequence(tmp_path / "text.mcap")
    (tmp_path / "empty.bag").touch()
    with pytest.raises(InputError, match="empty"):
        open_sequence(tmp_path / "empty.bag")


def test_options_that_do_not_exist(tmp_path: Path, record: Callable[..., Any]) -> None:
    path = record("mcap").write(tmp_path / "a.mcap")
    with pytest.raises(UserError, match="unknown option 'colour'; known are color, depth"):
        open_sequence(f"{path}?colour=/a")
    with pytest.raises(UserError, match="KEY=VALUE"):
        open_sequence(f"{path}?color")
    with pytest.raises(UserError, match="color twice"):
        open_sequence(f"{path}?color=/a&color=/b")
    (tmp_path / "plain" / "color").mkdir(parents=True)
    with pytest.raises(UserError, match="folder has no options"):
        open_sequence(f"{tmp_path / 'plain'}?color=/a")


def test_without_the_library_one_line_names_the_extra(
    tmp_path: Path, record: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = record("mcap").write(tmp_path / "a.mcap")
    for name in [name for name in sys.modules if name.split(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(UserError, match=r'pip install ".+\[ros\]"'):
        open_sequence(path)

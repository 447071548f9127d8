"""A sequence to and fro, and where a mapper's memory goes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from laps import BackAndForth
from memory import deep_size, resident_mb

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.sequence import Sequence


class ThreeFrames:
    """Frames a, b, c at 10 Hz from 5 s on."""

    name = "three"
    names = ("a", "b", "c")
    intrinsics = Intrinsics(4, 2, 3.0, 3.0, 2.0, 1.0)
    poses = np.tile(np.eye(4), (3, 1, 1)) * np.array([1.0, 2.0, 3.0])[:, None, None]
    stamps = np.array([5.0, 5.1, 5.2])
    gravity = None

    def __len__(self) -> int:
        return 3

    def __getitem__(self, index: int) -> Frame:
        images = np.zeros((2, 4, 3), dtype=np.uint8), np.ones((2, 4), dtype=np.float32)
        return Frame(index, self.names[index], float(self.stamps[index]), *images, self.intrinsics)

    def __iter__(self):
        return (self[i] for i in range(3))


def test_laps_go_to_the_end_and_back_with_even_stamps() -> None:
    laps = BackAndForth(ThreeFrames(), 2)
    assert isinstance(laps, Sequence)
    frames = list(laps)
    assert laps.names == [frame.name for frame in frames]
    assert "".join(frame.name for frame in frames) == "abccbaabccba"
    assert [frame.index for frame in frames] == list(range(12))
    np.testing.assert_allclose([frame.stamp for frame in frames], 5.0 + 0.1 * np.arange(12))
    np.testing.assert_allclose(laps.stamps, [frame.stamp for frame in frames])
    assert laps.poses is not None
    assert laps.poses[:, 3, 3].tolist() == [1, 2, 3, 3, 2, 1] * 2


@dataclass(slots=True)
class Slotted:
    array: np.ndarray
    more: object = None


def test_deep_size_counts_arrays_inside_and_each_once() -> None:
    array = np.zeros(100_000)
    size = deep_size([Slotted(array, {"again": array, "view": array[::2]})])
    assert array.nbytes < size < array.nbytes + 5_000
    assert deep_size({"a": (np.zeros(1000), [np.zeros(1000)])}) > 16_000


def test_deep_size_counts_the_array_behind_a_view() -> None:
    row = np.zeros((1000, 100))[3]
    assert deep_size(row) > 800_000


def test_resident_memory_grows_with_what_is_held() -> None:
    before = resident_mb()
    if before is None:
        pytest.skip("this system does not tell a process's memory")
    held = np.ones(10_000_000)
    after = resident_mb()
    assert after is not None
    assert after - before > 0.5 * held.nbytes / 1e6

import pickle
from collections.abc import Iterator

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.truth import (
    FrameTruth,
    HasClutter,
    HasInstances,
    HasPointTruth,
    HasTruth,
    PointTruth,
    TrueObject,
)
from thingmap.datasets.views import subset, usable_frames


class Ten:
    """Ten frames without pixels; the fourth is broken."""

    name = "ten"
    names = tuple(f"f{i}" for i in range(10))
    intrinsics = Intrinsics(4, 3, 5.0, 5.0, 1.5, 1.0)
    gravity = np.array([0.0, 0.0, -1.0])
    poses: np.ndarray | None = np.arange(10.0)[:, None, None] + np.zeros((10, 4, 4))
    stamps = np.arange(10) / 10

    def __len__(self) -> int:
        return 10

    def __getitem__(self, index: int) -> Frame:
        if index == 3:
            raise BrokenFrame("f3", FrameProblem.NO_DEPTH)
        blank = np.zeros((3, 4))
        return Frame(index, f"f{index}", self.stamps[index], blank, blank, self.intrinsics)

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(10))


class TenWithTruth(Ten):
    objects = (TrueObject(0, "mug", np.zeros(3), np.ones(3), 0.0),)
    classes = ("mug",)

    def truth(self, index: int) -> FrameTruth:
        return FrameTruth(np.array([index]), np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1))


@pytest.mark.parametrize(
    ("stride", "most", "kept"),
    [(3, None, [0, 3, 6, 9]), (4, None, [0, 4, 8]), (1, 2, [0, 1]), (2, 3, [0, 2, 4]), (20, 5, [0]), (9, 99, [0, 9])],
)
def test_a_subset_keeps_names_and_renumbers(stride: int, most: int | None, kept: list[int]) -> None:
    part = subset(Ten(), stride, most)
    assert isinstance(part, Sequence)
    assert len(part) == len(kept)
    np.testing.assert_array_equal(part.stamps, np.array(kept) / 10)
    np.testing.assert_array_equal(part.poses[:, 0, 0], kept)
    assert (part.name, part.intrinsics) == ("ten", Ten.intrinsics)
    assert part.names == tuple(f"f{i}" for i in kept)
    np.testing.assert_array_equal(part.gravity, [0, 0, -1])
    for position, original in enumerate(kept):
        if original != 3:
            frame = part[position]
            assert (frame.index, frame.name, frame.stamp) == (position, f"f{original}", original / 10)
    assert part[-1 if kept[-1] != 3 else 0].index == (len(kept) - 1 if kept[-1] != 3 else 0)
    with pytest.raises(IndexError):
        part[len(kept)]


def test_the_whole_sequence_is_itself() -> None:
    ten = Ten()
    assert subset(ten) is ten
    assert subset(ten, 1, 10) is ten
    assert subset(ten, 1, 11) is ten


def test_poses_stay_absent() -> None:
    ten = Ten()
    ten.poses = None
    assert subset(ten, 2).poses is None


def test_truth_follows_the_frames_where_there_is_any() -> None:
    part = subset(TenWithTruth(), 3)
    assert isinstance(part, HasTruth)
    assert (part.objects, part.classes) == (TenWithTruth.objects, ("mug",))
    assert [part.truth(i).object_id[0] for i in range(4)] == [0, 3, 6, 9]
    assert not isinstance(subset(Ten(), 3), HasTruth)


class TenWithEverything(TenWithTruth):
    clutter = (TrueObject(1, "book", np.zeros(3), np.ones(3), 0.0),)

    def instances(self, index: int) -> np.ndarray:
        return np.full((3, 4), index, dtype=np.int32)

    def point_truth(self) -> PointTruth:
        return PointTruth(np.zeros((2, 3), np.float32), np.array([0, -1]), None)


def test_all_truth_is_forwarded_and_none_is_invented() -> None:
    whole = TenWithEverything()
    for part in (subset(whole, 3), pickle.loads(pickle.dumps(subset(whole, 3)))):
        assert isinstance(part, HasClutter) and isinstance(part, HasInstances) and isinstance(part, HasPointTruth)
        assert [thing.label for thing in part.clutter] == ["book"]
        assert [int(part.instances(k)[0, 0]) for k in (0, 1, 3, -1)] == [0, 3, 9, 9]
        np.testing.assert_array_equal(part.point_truth().class_id, [0, -1])
        with pytest.raises(IndexError):
            part.instances(4)
    for protocol in (HasClutter, HasInstances, HasPointTruth):
        assert not isinstance(subset(TenWithTruth(), 3), protocol)
        assert not isinstance(subset(Ten(), 3), protocol)


@pytest.mark.parametrize(("stride", "most"), [(0, None), (-1, None), (1, 0)])
def test_impossible_choices_are_told(stride: int, most: int | None) -> None:
    with pytest.raises(UserError, match="at least 1"):
        subset(Ten(), stride, most)


@pytest.mark.parametrize(("stride", "expected"), [(1, [0, 1, 2, 4, 5, 6, 7, 8, 9]), (3, [0, 6, 9])])
def test_usable_frames_go_on_after_a_broken_one_and_report_it(stride: int, expected: list[int]) -> None:
    broken: list[BrokenFrame] = []
    names = [frame.name for frame in usable_frames(subset(Ten(), stride), broken.append)]
    assert names == [f"f{i}" for i in expected]
    assert [(b.name, b.problem) for b in broken] == [("f3", FrameProblem.NO_DEPTH)]


def test_a_broken_frame_of_the_callers_own_is_not_swallowed() -> None:
    frames = usable_frames(Ten(), lambda broken: None)
    next(frames)
    with pytest.raises(BrokenFrame, match="mine"):
        frames.throw(BrokenFrame("mine", FrameProblem.UNREADABLE))


def test_plain_iteration_ends_at_a_broken_frame() -> None:
    seen = []
    with pytest.raises(BrokenFrame):
        seen.extend(frame.index for frame in subset(Ten(), 1, 9))

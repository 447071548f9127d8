"""Small maps, a small sequence and a mapper that does nothing, for tests of what surrounds the mapper; the sample.

Tests import `lasting_world`, `jumping_camera` and `sample_maps` from their own folder.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.synthetic.sample import TabletopSequence, open_sample
from thingmap.detectors.detections import Detections
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection

sys.path.insert(0, str(Path(__file__).resolve().parent))

UP_IN_FIRST_CAMERA = np.array([0.0, -1.0, 0.0])


def _make_thing(number: int = 1, label: str = "cup", probability: float = 0.9, **changes: object) -> Thing:
    values: dict = {
        "id": f"thing-{number:04d}",
        "label": label,
        "probability": probability,
        "existence": 0.95,
        "class_posterior": {label: probability, "bowl" if label != "bowl" else "cup": 1.0 - probability},
        "position": [0.1 * number, 0.2, 1.0],
        "position_covariance": np.diag([1e-4, 4e-4, 9e-4]),
        "size": [0.08, 0.09, 0.1],
        "size_std": [0.01, 0.01, 0.02],
        "yaw": 0.3,
        "first_seen": 0.0,
        "last_seen": 2.5,
        "evidence": Evidence(12, 3, 1),
    }
    return Thing(**{**values, **changes})


@pytest.fixture(scope="session")
def make_thing() -> Callable[..., Thing]:
    """`make_thing(number, label, probability, **changes)`."""
    return _make_thing


@pytest.fixture(scope="session")
def make_map() -> Callable[..., ObjectMap]:
    """`make_map(*things, **changes)`; three things where none is given."""

    def make(*things: Thing, **changes: object) -> ObjectMap:
        chosen = things or (_make_thing(1), _make_thing(2, "bowl", 0.7), _make_thing(3, "book", 0.6, existence=0.4))
        values: dict = {
            "things": chosen,
            "classes": ("cup", "bowl", "book"),
            "source": "table",
            "frame": MapFrame.FIRST_CAMERA,
            "up": UpDirection(UP_IN_FIRST_CAMERA, 0.02, "planes"),
        }
        return ObjectMap(**{**values, **changes})

    return make


class TinySequence:
    """Small grey frames of a wall; positions in `broken` raise `BrokenFrame`, those in `failing` ValueError."""

    name = "tiny"
    intrinsics = Intrinsics(8, 6, 10.0, 10.0, 3.5, 2.5)
    gravity = None

    def __init__(self, length: int = 6, broken: tuple[int, ...] = (), failing: tuple[int, ...] = ()) -> None:
        self.length, self.broken, self.failing = length, broken, failing
        self.stamps = 0.1 * np.arange(length)
        self.poses: np.ndarray | None = None
        self.read: list[int] = []

    def __len__(self) -> int:
        return self.length

    def __iter__(self):
        return (self[i] for i in range(self.length))

    def __getitem__(self, index: int) -> Frame:
        self.read.append(index)
        if index in self.failing:
            raise ValueError(f"disk gone at {index}")
        if index in self.broken:
            raise BrokenFrame(f"frame-{index:06d}", FrameProblem.UNREADABLE, "truncated")
        color = np.full((6, 8, 3), index % 256, dtype=np.uint8)
        depth = np.ones((6, 8), dtype=np.float32)
        return Frame(index, f"frame-{index:06d}", float(self.stamps[index]), color, depth, self.intrinsics)


@dataclass
class FakeUpdate:
    frame_index: int
    is_keyframe: bool
    T_world_camera: np.ndarray
    things: int


@dataclass
class FakeMapper:
    """Remembers the frames it was given; raises `error` at the frame `fail_at`. Every second frame is a keyframe."""

    fail_at: int | None = None
    error: BaseException | None = None
    frames: list[int] = field(default_factory=list)
    stamps: list[float] = field(default_factory=list)

    def process_frame(self, frame: Frame, detections: object = None) -> FakeUpdate:
        if frame.index == self.fail_at and self.error is not None:
            raise self.error
        self.frames.append(frame.index)
        self.stamps.append(frame.stamp)
        return FakeUpdate(frame.index, len(self.frames) % 2 == 1, np.eye(4), len(self.frames))

    def object_map(self, include_doubtful: bool = False) -> ObjectMap:
        things = [_make_thing(number + 1) for number, _ in enumerate(self.frames)]
        if include_doubtful:
            things.append(_make_thing(999, existence=0.2))
        up = UpDirection(UP_IN_FIRST_CAMERA, 0.02, "planes")
        return ObjectMap(tuple(things), ("cup", "bowl"), "tiny", MapFrame.FIRST_CAMERA, up)

    def trajectory(self) -> tuple[np.ndarray, np.ndarray]:
        poses = np.tile(np.eye(4), (len(self.frames), 1, 1))
        poses[:, 0, 3] = self.frames
        return np.array(self.stamps), poses

    def keyframes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        stamps, poses = self.trajectory()
        return stamps[::2], poses[::2], np.tile(0.01 * np.eye(6), (len(stamps[::2]), 1, 1))

    def cloud(self) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.frames)
        return np.arange(3.0 * count).reshape(-1, 3), np.full((count, 3), 7, dtype=np.uint8)

    def statistics(self) -> dict:
        return {"keyframes": len(self.frames)}

    def save_ledger(self, path: Path) -> None:
        path.write_bytes(b"ledger of %d" % len(self.frames))


@pytest.fixture(scope="session")
def tiny_sequence() -> type[TinySequence]:
    """The class `TinySequence`."""
    return TinySequence


@pytest.fixture(scope="session")
def fake_mapper() -> type[FakeMapper]:
    """The class `FakeMapper`."""
    return FakeMapper


@pytest.fixture(scope="session")
def sample() -> TabletopSequence:
    """The rendered sample, small."""
    return open_sample("tabletop?frames=80&width=320")


@pytest.fixture(scope="session")
def sample_frames(sample: TabletopSequence) -> list[Frame]:
    """Twenty of its frames; treat as read-only."""
    return [sample[i] for i in range(0, 80, 4)]


@pytest.fixture(scope="session")
def sample_detections(sample: TabletopSequence, sample_frames: list[Frame]) -> list[Detections]:
    """What the simulated detector finds in them."""
    detector = SimulatedDetector(sample)
    return [detector(frame) for frame in sample_frames]

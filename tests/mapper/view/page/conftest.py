"""A small map with everything that a page shows: two things before a wall, seen by a camera that moves sideways."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from browser import Tab, chromium  # noqa: F401 - a fixture

from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.mapper.estimation.view_log import Verdict, ViewNote
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Thing
from thingmap.mapper.map.views_file import ThingViews

CAMERA = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
FRAMES = 8
CLASSES = ("cup", "bowl", "book")
NAMES = tuple(f"frame-{index:06d}" for index in range(FRAMES))


@dataclass
class WallSequence:
    """Frames whose colour is their number; those in `broken` cannot be read."""

    broken: tuple[int, ...] = ()
    name, intrinsics, gravity, poses, names = "wall", CAMERA, None, None, NAMES
    stamps = 0.5 * np.arange(FRAMES)

    def __len__(self) -> int:
        return FRAMES

    def __getitem__(self, index: int) -> Frame:
        if index in self.broken:
            raise BrokenFrame(NAMES[index], FrameProblem.UNREADABLE)
        color = np.full((120, 160, 3), 20 + 25 * index, dtype=np.uint8)
        return Frame(index, NAMES[index], float(self.stamps[index]), color, np.ones((120, 160), np.float32), CAMERA)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(FRAMES))


def note(index: int, verdict: Verdict, ratio: float) -> ViewNote:
    found = verdict is Verdict.SUPPORTED
    return ViewNote(
        keyframe=index,
        stamp=float(WallSequence.stamps[index]),
        frame=NAMES[index],
        visible=np.full(5, 0.0 if verdict is Verdict.OCCLUDED else 0.8),
        score=0.75 if found else float("nan"),
        part=0 if found else -1,
        class_id=0 if found else -1,
        log_ratio=np.array([ratio, ratio / 2.0, -abs(ratio)]),
        weight=1.0,
        verdict=verdict,
    )


VERDICTS = [(Verdict.SUPPORTED, 1.0 + 0.1 * k) for k in range(5)]
VERDICTS += [(Verdict.OCCLUDED, 0.0), (Verdict.MISSED, -0.6), (Verdict.SUPPORTED, 3.0)]
SEEN = ThingViews(CLASSES, tuple(note(k, *said) for k, said in enumerate(VERDICTS)), {Verdict.OCCLUDED: 2})


@pytest.fixture(scope="session")
def wall_sequence() -> type[WallSequence]:
    """The class `WallSequence`."""
    return WallSequence


@pytest.fixture(scope="session")
def things(make_thing: Callable[..., Thing]) -> tuple[Thing, ...]:
    """A sure cup, a less sure bowl that may be a cup, and a doubtful book; half a metre apart."""
    at = {"size": [0.2, 0.15, 0.12]}
    return (
        make_thing(1, "cup", 0.9, position=[-0.5, 0.0, 1.5], views=SEEN, **at),
        make_thing(2, "bowl", 0.7, position=[0.0, 0.05, 1.5], **at),
        make_thing(3, "book", 0.6, position=[0.5, 0.1, 1.6], existence=0.6, **at),
    )


@pytest.fixture(scope="session")
def make_folder(make_map: Callable[..., ObjectMap]) -> Callable[..., OutputFolder]:
    """`make_folder(path, *things, cloud=True, sequence=..., **changes of the map)`: the output folder of a run."""

    def make(path: Path, *things: Thing, cloud: bool = True, sequence: str = "gone", **changes: Any) -> OutputFolder:
        folder = OutputFolder.create(path)
        folder.write_map(make_map(**{"things": things, **changes}))
        poses = np.tile(np.eye(4), (FRAMES, 1, 1))
        poses[:, 0, 3] = 0.02 * np.arange(FRAMES)
        folder.write_trajectory(WallSequence.stamps, poses)
        folder.write_keyframes(WallSequence.stamps[::2], poses[::2], np.tile(0.01 * np.eye(6), (FRAMES // 2, 1, 1)))
        if cloud:
            u, v = np.meshgrid(np.linspace(-1.0, 1.0, 80), np.linspace(-0.5, 0.5, 50))
            points = np.column_stack([u.ravel(), v.ravel(), np.full(u.size, 2.0)])
            folder.write_cloud(points, np.full((len(points), 3), (180, 170, 160), dtype=np.uint8))
        folder.write_report({"command": {"sequence": sequence, "dataset": None, "stride": 1, "max_frames": None}})
        return folder

    return make


@pytest.fixture(scope="session")
def folder(
    make_folder: Callable[..., OutputFolder], things: tuple[Thing, ...], tmp_path_factory: pytest.TempPathFactory
) -> OutputFolder:
    """Of the three things; read only."""
    return make_folder(tmp_path_factory.mktemp("run"), *things)


@pytest.fixture
def open_tab(chromium: Any) -> Iterator[Callable[..., Tab]]:  # noqa: F811
    """`open_tab(file, width, height)`; it must have complained of nothing and asked for nothing when the test ends."""
    tabs: list[Tab] = []

    def open_(file: Path, *size: int, **more: Any) -> Tab:
        tabs.append(Tab(chromium, file, *size, **more))
        return tabs[-1]

    yield open_
    for tab in tabs:
        asked = [url for url in tab.requests if not url.startswith(("file:", "blob:"))]
        complaints = list(tab.complaints)
        tab.close()
        assert not complaints and not asked

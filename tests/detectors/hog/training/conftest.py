"""A small world to learn from: discs and crosses of card, 0.1 m across, in front of a wall of blotches."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from thingmap.datasets.object_views.backgrounds import Background, Backgrounds
from thingmap.datasets.object_views.object_view import BrokenView, ObjectView, ObjectViews, ViewEntry
from thingmap.detectors.hog.training.config import TrainConfig

FOCAL = 300.0
WALL, CARD = 1.6, 1.2  # metres away
SIDE = 26  # pixels of a card: 0.104 m


def wall(seed: int, size: tuple[int, int] = (128, 96)) -> tuple[np.ndarray, np.ndarray]:
    """Colour and depth of a wall, (height, width, ...) of `size` = (width, height)."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(60, 200, (6, 8, 3)).astype(np.float32)
    color = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC) + rng.normal(0.0, 3.0, (size[1], size[0], 3))
    depth = WALL + rng.normal(0.0, 0.003, size[::-1])
    return np.clip(color, 0, 255).astype(np.uint8), depth.astype(np.float32)


def paint(color: np.ndarray, depth: np.ndarray, label: str, corner: tuple[int, int]) -> np.ndarray:
    """Put a disc or a cross there; returns its box."""
    x, y = corner
    stamp = np.zeros((SIDE, SIDE), np.uint8)
    if label == "disc":
        cv2.circle(stamp, (SIDE // 2, SIDE // 2), SIDE // 2 - 1, 1, -1)
    else:
        stamp[SIDE // 3 : -(SIDE // 3)] = stamp[:, SIDE // 3 : -(SIDE // 3)] = 1
    card = stamp.astype(bool)
    color[y : y + SIDE, x : x + SIDE][card] = 240
    depth[y : y + SIDE, x : x + SIDE][card] = CARD
    return np.array([x, y, x + SIDE, y + SIDE], dtype=np.float64)


class FakeBackgrounds(Backgrounds):
    """Frames from a function; those in `broken` cannot be read."""

    def __init__(self, count: int, make: Callable[[int], Background], broken: tuple[int, ...] = ()) -> None:
        super().__init__()
        self._count, self._make, self._broken = count, make, broken

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"wall {k}" for k in range(self._count))

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> Background:
        if index in self._broken:
            raise BrokenView("torn")
        return self._make(range(self._count)[index])


@pytest.fixture(scope="session")
def make_frame_with() -> Callable[..., Background]:
    """`make_frame_with(seed, *labels)`: a wall with these cards at drawn places, all known."""

    def make(seed: int, *labels: str, depth: bool = True) -> Background:
        color, metres = wall(seed)
        rng = np.random.default_rng([seed, 1])
        places = [(4, 4), (50, 8), (96, 40), (20, 60)]
        chosen = rng.permutation(len(places))[: len(labels)]
        boxes = [paint(color, metres, label, places[k]) for label, k in zip(labels, chosen, strict=True)]
        xyxy = np.array(boxes).reshape(-1, 4)
        return Background(f"wall {seed}", color, metres if depth else None, FOCAL, labels, xyxy, np.ones(len(labels)))

    return make


@pytest.fixture(scope="session")
def make_backgrounds(make_frame_with) -> Callable[..., Backgrounds]:
    """`make_backgrounds(count, broken)`: every second wall has a disc and a cross on it."""

    def make(count: int = 10, broken: tuple[int, ...] = (), depth: bool = True) -> Backgrounds:
        def frame(k: int) -> Background:
            return make_frame_with(100 + k, *(("disc", "cross") if k % 2 else ()), depth=depth)

        return FakeBackgrounds(count, frame, broken)

    return make


@pytest.fixture(scope="session")
def make_views() -> Callable[..., ObjectViews]:
    """`make_views(count)`: so many views of discs and of crosses, each of its own instance, without masks."""

    def make(count: int = 10, labels: tuple[str, ...] = ("disc", "cross"), depth: bool = True, instances: int = 5):
        def read(label: str, number: int) -> ObjectView:
            color, metres = wall(1000 + 7 * number + len(label), (72, 72))
            xyxy = paint(color, metres, label, (22 + number % 3, 24))
            seen = metres if depth else None
            return ObjectView(
                label, f"{label} {number % instances}", f"{label}-{number}", color, seen, None, xyxy, FOCAL
            )

        names = [(label, number) for number in range(count) for label in labels]
        return ObjectViews(
            ViewEntry(label, f"{label} {n % instances}", f"{label}-{n}", lambda label=label, n=n: read(label, n))
            for label, n in names
        )

    return make


@pytest.fixture(scope="session")
def small() -> TrainConfig:
    """Settings for the small world."""
    return TrainConfig(
        cells=16, rounds=2, views=20, other_views=10, random_windows=8, frame_windows=10, round_windows=60, cache=150
    )

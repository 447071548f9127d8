"""A small world to learn from: discs and crosses of card, 0.16 m across, in front of a wall."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.object_views.backgrounds import Background, Backgrounds
from thingmap.datasets.object_views.object_view import BrokenView, ObjectView, ObjectViews, ViewEntry
from thingmap.detectors.shape_context.training.config import TrainConfig

FOCAL = 300.0
WALL = 1.6  # metres away
CARD = 0.16  # metres across
GRAY, WHITE = 110, 235


def wall(seed: int, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Colour and depth of a wall, (height, width, ...) of `size` = (width, height)."""
    rng = np.random.default_rng(seed)
    color = GRAY + rng.normal(0.0, 2.0, (size[1], size[0], 3))
    depth = WALL + rng.normal(0.0, 0.002, size[::-1])
    return color.astype(np.uint8), depth.astype(np.float32)


def stamp(label: str, side: int) -> np.ndarray:
    """(side, side) bool: a disc, a cross, or a triangle, which nobody learns."""
    image = np.zeros((side, side), np.uint8)
    if label == "disc":
        cv2.circle(image, (side // 2, side // 2), side // 2 - 1, 1, -1)
    elif label == "cross":
        image[side // 3 : -(side // 3)] = image[:, side // 3 : -(side // 3)] = 1
    else:
        cv2.fillConvexPoly(image, np.array([[0, side - 1], [side - 1, side - 1], [side // 2, 0]]), 1)
    return image.astype(bool)


def put(color: np.ndarray, depth: np.ndarray, label: str, corner: tuple[int, int], away: float) -> np.ndarray:
    """Hang a card there, `away` metres from the camera; returns its mask."""
    card = stamp(label, round(FOCAL * CARD / away))
    x, y = corner
    mask = np.zeros(depth.shape, bool)
    mask[y : y + len(card), x : x + len(card)] = card
    color[mask] = WHITE
    depth[mask] = away + 0.1 * (depth[mask] - WALL)
    return mask


def box_of(mask: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero(mask)
    return np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1], dtype=np.float64)


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
    """`make_frame_with(seed, *labels)`: a wall with these cards at drawn places and distances, all known."""

    def make(seed: int, *labels: str, depth: bool = True) -> Background:
        color, metres = wall(seed, (280, 210))
        rng = np.random.default_rng([seed, 1])
        places = [(15, 20), (110, 15), (205, 25), (60, 115), (160, 120)]
        chosen = rng.permutation(len(places))[: len(labels)]
        away = rng.uniform(0.8, 1.2, len(labels))
        masks = [put(color, metres, *one) for one in zip(labels, [places[k] for k in chosen], away, strict=True)]
        xyxy = np.array([box_of(mask) for mask in masks]).reshape(-1, 4)
        return Background(f"wall {seed}", color, metres if depth else None, FOCAL, labels, xyxy, np.ones(len(labels)))

    return make


@pytest.fixture(scope="session")
def make_backgrounds(make_frame_with) -> Callable[..., Backgrounds]:
    """`make_backgrounds(count, broken)`: walls with triangles, every second one with a disc and a cross as well."""

    def make(
        count: int = 8,
        broken: tuple[int, ...] = (),
        depth: bool = True,
        things: tuple[str, ...] = ("triangle", "triangle"),
    ) -> Backgrounds:
        def frame(k: int) -> Background:
            return make_frame_with(100 + k, *things, *(("disc", "cross") if k % 2 and things else ()), depth=depth)

        return FakeBackgrounds(count, frame, broken)

    return make


@pytest.fixture(scope="session")
def make_view() -> Callable[..., ObjectView]:
    """`make_view(label, number)`: a card in the middle of a piece of the wall; the number says how far away."""

    def make(label: str, number: int, depth: bool = True, mask: bool = True) -> ObjectView:
        away = (0.8, 0.9, 1.0, 1.1, 1.2)[number % 5]
        side = round(FOCAL * CARD / away)
        color, metres = wall(1000 + 7 * number + len(label), (2 * side, 2 * side))
        where = put(color, metres, label, (side // 2 + number % 3, side // 2), away)
        instance, name = f"{label} {number % 5}", f"{label}-{number}"
        seen, known = metres if depth else None, where if mask else None
        return ObjectView(label, instance, name, color, seen, known, box_of(where), FOCAL)

    return make


@pytest.fixture(scope="session")
def make_views(make_view) -> Callable[..., ObjectViews]:
    """`make_views(count)`: so many views of discs and of crosses, of five instances each."""

    def make(count: int = 10, labels: tuple[str, ...] = ("disc", "cross"), **lacking: bool) -> ObjectViews:
        return ObjectViews(
            ViewEntry(
                label, f"{label} {n % 5}", f"{label}-{n}", lambda label=label, n=n: make_view(label, n, **lacking)
            )
            for n in range(count)
            for label in labels
        )

    return make


@pytest.fixture(scope="session")
def small() -> TrainConfig:
    """Settings for the small world."""
    return TrainConfig(radii=(0.05, 0.1, 0.2), entries=200)


@pytest.fixture(scope="session")
def as_frame() -> Callable[[Background], Frame]:
    """The frame of a background, for a detector."""

    def make(background: Background) -> Frame:
        height, width = background.color.shape[:2]
        camera = Intrinsics(width, height, FOCAL, FOCAL, (width - 1) / 2, (height - 1) / 2)
        assert background.depth is not None
        return Frame(0, background.name, 0.0, background.color, background.depth, camera)

    return make

"""A table top with boxes on it, rendered by slabs, and a detector with moods: for tests that need many frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Detections

SMALL = Intrinsics(160, 120, 131.0, 131.0, 79.5, 59.5)
CLASSES = ("cup", "bowl", "cereal box", "book", "bottle", "monitor")
NOISE_PER_M2 = 0.0015  # m at 1 m, growing with z^2: a Kinect's
WALL = 1.5  # m behind the middle of the table
HZ = 30.0


@dataclass(frozen=True)
class Block:
    """A box along the world's axes that stands on the table, or an occluder where it has no label.

    Attributes:
        label: class; empty for what no detector knows.
        place: (x, y) metres of its middle, and
        size: (x, y, z) metres.
        rate: share of the frames in which it is found where it is in full view.
        score: mean of its own class's scores.
    """

    label: str
    place: tuple[float, float]
    size: tuple[float, float, float]
    rate: float = 0.9
    score: float = 0.6

    @property
    def low(self) -> np.ndarray:
        return np.array([*(np.array(self.place) - np.array(self.size[:2]) / 2.0), 0.0])

    @property
    def high(self) -> np.ndarray:
        return self.low + self.size

    @property
    def centre(self) -> np.ndarray:
        return (self.low + self.high) / 2.0


def around(angle: float, distance: float = 1.1, height: float = 0.55) -> np.ndarray:
    """(4, 4) `T_world_camera` looking at the middle of the table from a bearing in degrees; 0 is before the wall."""
    a = np.radians(angle)
    position = np.array([distance * np.sin(a), -distance * np.cos(a), height])
    forward = np.array([0.0, 0.0, 0.05]) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack([right, np.cross(forward, right), forward]), position
    return T


def render(T: np.ndarray, blocks: Sequence[Block]) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) metres along z, and (H, W) index of the block that is seen, -1 for table and wall."""
    k = SMALL
    v, u = np.mgrid[0 : k.height, 0 : k.width]
    rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones(u.shape)], axis=-1) @ T[:3, :3].T
    origin = T[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        table, wall = -origin[2] / rays[..., 2], (WALL - origin[1]) / rays[..., 1]
        depth = np.minimum(np.where(table > 0.0, table, np.inf), np.where(wall > 0.0, wall, np.inf))
        index = np.full(depth.shape, -1)
        for i, block in enumerate(blocks):
            near, far = (block.low - origin) / rays, (block.high - origin) / rays
            enter, leave = np.minimum(near, far).max(axis=-1), np.maximum(near, far).min(axis=-1)
            hit = (enter < leave) & (enter > 0.0) & (enter < depth)
            depth, index = np.where(hit, enter, depth), np.where(hit, i, index)
    return np.where(np.isfinite(depth), depth, 0.0), index


class Film:
    """Frames of blocks, and a detector that finds them by chance.

    Args:
        seed: of depth noise, boxes, scores and luck.
        copies: noisy depth images that a still camera cycles through.
    """

    def __init__(self, seed: int = 0, copies: int = 8) -> None:
        self._rng, self._copies, self._count = np.random.default_rng(seed), copies, 0
        self._color = np.zeros((SMALL.height, SMALL.width, 3), dtype=np.uint8)
        self._seen: list[tuple[Block, np.ndarray, float]] = []

    def still(self, angle: float, blocks: Sequence[Block], frames: int) -> Iterator[Frame]:
        """A camera that stands still."""
        T = around(angle)
        clean, index = render(T, blocks)
        noisy = [self._noisy(clean) for _ in range(self._copies)]
        self._seen = [(b, *_whole_box(T, b, index == i)) for i, b in enumerate(blocks) if b.label]
        for t in range(frames):
            yield Frame(
                self._count, f"{self._count:06d}", self._count / HZ, self._color, noisy[t % self._copies], SMALL, T
            )
            self._count += 1

    def walk(self, angles: Iterable[float], *blocks: Block) -> Iterator[Frame]:
        """A camera that goes round the table, one frame from every bearing."""
        for angle in angles:
            yield from self.still(float(angle), blocks, 1)

    def detect(self, frame: Frame) -> Detections:
        """Of the last frame. Found by their rates where half or more is visible, never below 0.3; sides off by 4 %."""
        rng, boxes, scores = self._rng, [], []
        for block, box, visible in self._seen:
            if rng.random() < block.rate * np.clip((visible - 0.3) / 0.2, 0.0, 1.0):
                boxes.append(box + 0.04 * np.tile(box[2:] - box[:2], 2) * rng.normal(size=4))
                row = np.minimum(rng.exponential(0.02, len(CLASSES)), 1.0)
                row[CLASSES.index(block.label)] = np.clip(rng.normal(block.score, 0.12), 0.1, 0.98)
                scores.append(row)
        if not boxes:
            return Detections.empty(CLASSES)
        return Detections(CLASSES, np.array(boxes), np.array(scores)).clip(SMALL.width, SMALL.height)

    def _noisy(self, depth: np.ndarray) -> np.ndarray:
        return (depth + NOISE_PER_M2 * depth**2 * self._rng.normal(size=depth.shape)).astype(np.float32)


def visible_share(T: np.ndarray, block: Block, blocks: Sequence[Block]) -> float:
    """Share of a block's pixels that the others leave in view."""
    return _whole_box(T, block, render(T, blocks)[1] == list(blocks).index(block))[1]


def _whole_box(T: np.ndarray, block: Block, seen: np.ndarray) -> tuple[np.ndarray, float]:
    """(4,) pixels from the image's edge, of the whole block, and the share of it that is seen."""
    corners = np.array(np.meshgrid(*zip(block.low, block.high, strict=True))).reshape(3, -1).T
    uv = SMALL.project((corners - T[:3, 3]) @ T[:3, :3])
    alone = np.count_nonzero(render(T, [block])[1] == 0)
    return np.concatenate([uv.min(axis=0), uv.max(axis=0)]) + 0.5, np.count_nonzero(seen) / max(alone, 1)

"""Small recordings written on the fly."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

WriteImages = Callable[..., tuple[np.ndarray, np.ndarray]]


@pytest.fixture
def write_images() -> WriteImages:
    """Writes a colour and a depth image; returns the RGB colours and the raw depth that a loader must find again."""

    def write(
        color: Path, depth: Path, seed: int = 0, size: tuple[int, int] = (64, 48)
    ) -> tuple[np.ndarray, np.ndarray]:
        width, height = size
        rng = np.random.default_rng(seed)
        rgb = rng.integers(0, 256, (height // 8, width // 8, 3), dtype=np.uint8).repeat(8, axis=0).repeat(8, axis=1)
        raw = rng.integers(500, 4000, (height // 8, width // 8), dtype=np.uint16).repeat(8, axis=0).repeat(8, axis=1)
        raw[0, 0] = 0
        for path, image in ((color, rgb[:, :, ::-1]), (depth, raw)):
            path.parent.mkdir(parents=True, exist_ok=True)
            assert cv2.imwrite(str(path), image)
        return rgb, raw

    return write


@pytest.fixture
def pose() -> Callable[[int], np.ndarray]:
    """A pose for each seed, (4, 4)."""

    def make(seed: int) -> np.ndarray:
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        matrix[:3, 3] = np.random.default_rng(seed + 1000).uniform(-3, 3, 3)
        return matrix

    return make


@pytest.fixture
def tum_row() -> Callable[[float, np.ndarray], str]:
    """A line of a TUM trajectory."""

    def write(stamp: float, matrix: np.ndarray) -> str:
        quaternion = Rotation.from_matrix(matrix[:3, :3]).as_quat()  # x y z w
        return " ".join(f"{v:.9f}" for v in (stamp, *matrix[:3, 3], *quaternion)) + "\n"

    return write

"""Bags with a RealSense's three topics."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the extra `ros` (rosbags) is not installed")
sys.path.insert(0, str(Path(__file__).resolve().parent))  # `bags` is there

import bags


@pytest.fixture
def record() -> Callable[..., bags.Recording]:
    """`record(kind, frames, lag, distortion)`; see `bags.record`."""
    return bags.record


@pytest.fixture
def png() -> Callable[[np.ndarray], bytes]:
    """An image's bytes as PNG."""
    return lambda image: cv2.imencode(".png", image)[1].tobytes()


@pytest.fixture
def known() -> SimpleNamespace:
    """Names and numbers of the recordings."""
    return SimpleNamespace(
        names=bags.NAMES,
        k=bags.K,
        size=(bags.WIDTH, bags.HEIGHT),
        frame=bags.FRAME,
        period=bags.PERIOD,
        start=bags.START,
    )

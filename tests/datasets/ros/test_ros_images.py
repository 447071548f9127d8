"""Each encoding gives the colours and the metres that were put in."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from thingmap.datasets.ros.bag import BadMessage
from thingmap.datasets.ros.images import ImageKind, decode_color, decode_depth, kind_of

BAYER = {
    "bayer_rggb8": (0, 1, 1, 2),
    "bayer_bggr8": (2, 1, 1, 0),
    "bayer_gbrg8": (1, 2, 0, 1),
    "bayer_grbg8": (1, 0, 2, 1),
}


@pytest.fixture
def messages(record: Callable[..., Any]) -> Any:
    return record("mcap").messages


@pytest.fixture
def rgb() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (6, 8, 3), dtype=np.uint8)


@pytest.mark.parametrize("pad", [0, 5])
@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "8UC3", "rgba8", "bgra8"])
def test_colours(messages: Any, rgb: np.ndarray, encoding: str, pad: int) -> None:
    pixels = rgb if encoding.startswith("rgb") else rgb[:, :, ::-1]
    if encoding.endswith("a8"):
        pixels = np.dstack([pixels, np.full(rgb.shape[:2], 9, np.uint8)])
    message = messages.image(0, pixels, encoding, pad=pad)
    assert kind_of(message) is ImageKind.COLOR
    np.testing.assert_array_equal(decode_color(message), rgb)


def test_grey(messages: Any, rgb: np.ndarray) -> None:
    message = messages.image(0, rgb[..., 0], "mono8")
    assert kind_of(message) is ImageKind.GREY
    np.testing.assert_array_equal(decode_color(message), np.repeat(rgb[..., :1], 3, axis=2))


@pytest.mark.parametrize(("encoding", "luma"), [("yuv422", 1), ("yuv422_yuy2", 0)])
def test_yuv(messages: Any, encoding: str, luma: int) -> None:
    bars = np.repeat(np.array([[16, 81, 145, 235]], np.uint8), 4, axis=0)  # of studio range: black to white
    pixels = np.full((4, 4, 2), 128, np.uint8)
    pixels[..., luma] = bars
    decoded = decode_color(messages.image(0, pixels, encoding))
    expected = np.clip((bars.astype(float) - 16) * 255 / 219, 0, 255)
    assert np.abs(decoded - expected[..., None]).max() <= 1.5
    red = np.tile(np.array([[90, 81], [240, 81]] if luma else [[81, 90], [81, 240]], np.uint8), (4, 2, 1))
    assert np.all(decode_color(messages.image(0, red, encoding)) @ np.array([1, -1, -1]) > 200)


@pytest.mark.parametrize("encoding", BAYER)
def test_bayer(messages: Any, encoding: str) -> None:
    colour = np.array([200, 120, 40])  # red, green, blue
    tile = colour[list(BAYER[encoding])].reshape(2, 2).astype(np.uint8)
    decoded = decode_color(messages.image(0, np.tile(tile, (4, 4)), encoding))
    np.testing.assert_array_equal(decoded[2:-2, 2:-2], np.broadcast_to(colour, (4, 4, 3)))


def test_jpeg(messages: Any) -> None:
    rgb = np.full((16, 16, 3), (200, 30, 90), np.uint8)
    data = cv2.imencode(".jpg", rgb[:, :, ::-1])[1].tobytes()
    message = messages.compressed(0, data, "rgb8; jpeg compressed bgr8")
    assert kind_of(message) is ImageKind.COLOR
    assert np.abs(decode_color(message).astype(int) - rgb).max() < 6


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16", "32FC1"])
def test_depth(messages: Any, encoding: str, big: bool) -> None:
    metres = np.array([[0.5, 1.25], [0.0, 3.0]])
    order = ">" if big else "<"
    pixels = metres.astype(order + "f4") if encoding == "32FC1" else (metres * 1000).astype(order + "u2")
    if encoding == "32FC1":
        pixels[1, 0] = np.nan
    message = messages.image(0, pixels, encoding, pad=2, big=big)
    assert kind_of(message) is ImageKind.DEPTH
    decoded = decode_depth(message)
    assert decoded.dtype == np.float32
    np.testing.assert_allclose(decoded, metres, rtol=1e-6)


def test_depth_as_png(messages: Any, png: Any) -> None:
    raw = np.array([[500, 0], [65535, 1]], np.uint16)
    for prefix, format_ in (
        (b"", "16UC1; png compressed "),
        (struct.pack("<iff", 0, 0, 0), "16UC1; compressedDepth png"),
    ):
        message = messages.compressed(0, prefix + png(raw), format_)
        assert kind_of(message) is ImageKind.DEPTH
        np.testing.assert_allclose(decode_depth(message), raw / 1000.0, rtol=1e-6)


def test_inverse_depth(messages: Any, png: Any) -> None:
    """As compressed_depth_image_transport writes floats: a quantum of 100 at 10 m at most."""
    metres = np.array([[0.5, 2.0], [9.0, np.nan]])
    a = 100.0 * (100.0 + 1.0)
    b = 1.0 - a / 10.0
    stored = np.nan_to_num(a / metres + b).astype(np.uint16)
    message = messages.compressed(0, struct.pack("<iff", 0, a, b) + png(stored), "32FC1; compressedDepth png")
    decoded = decode_depth(message)
    np.testing.assert_allclose(decoded[0], metres[0], rtol=1e-3)
    assert decoded[1, 0] == pytest.approx(9.0, rel=0.01) and decoded[1, 1] == 0.0


def test_what_is_not_read_is_said(messages: Any, rgb: np.ndarray) -> None:
    with pytest.raises(BadMessage, match="'64FC1'"):
        decode_depth(messages.image(0, np.ones((2, 2)), "64FC1"))
    with pytest.raises(BadMessage, match="'rgb16'"):
        decode_color(messages.image(0, rgb.astype(np.uint16), "rgb16"))
    assert kind_of(messages.image(0, rgb.astype(np.uint16), "rgb16")) is ImageKind.OTHER
    with pytest.raises(BadMessage, match="RVL is not read"):
        decode_depth(messages.compressed(0, struct.pack("<iff", 1, 0, 0) + bytes(20), "16UC1; compressedDepth rvl"))
    with pytest.raises(BadMessage, match="cannot be decoded"):
        decode_color(messages.compressed(0, b"no jpeg", "jpeg"))
    short = messages.image(0, rgb, "rgb8")
    short.data = short.data[:-1]
    with pytest.raises(BadMessage, match="bytes of data"):
        decode_color(short)

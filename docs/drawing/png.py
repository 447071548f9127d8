"""A PNG of 256 colours: a quarter of the size of one with all. OpenCV chooses the colours, but cannot write one."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable

import cv2
import numpy as np

COLORS = 256  # of a palette, by the format
SAMPLE = 32768  # pixels, about, by which the colours are chosen


def encode_png(image: np.ndarray, keep: Iterable[tuple[int, int, int]] = ()) -> bytes:
    """(H, W, 3) uint8 RGB as a PNG whose colours are those to `keep`, exactly, and the best others."""
    palette = choose_palette(image, keep)
    lines = np.pad(_nearest(image, palette), ((0, 0), (1, 0)))  # each line begins with its filter: none
    height, width = image.shape[:2]
    chunks = {
        b"IHDR": struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0),
        b"PLTE": palette.astype(np.uint8).tobytes(),
        b"IDAT": zlib.compress(lines.tobytes(), 9),
        b"IEND": b"",
    }
    packed = [len(x).to_bytes(4) + kind + x + zlib.crc32(kind + x).to_bytes(4) for kind, x in chunks.items()]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def choose_palette(image: np.ndarray, keep: Iterable[tuple[int, int, int]]) -> np.ndarray:
    """(at most 256, 3) float32 whole RGB: those to `keep`, then the means of the clusters of the image's colours."""
    cv2.setRNGSeed(0)
    kept = np.array(list(keep), dtype=np.float32).reshape(-1, 3)
    pixels = image.reshape(-1, 3).astype(np.float32)
    sample = pixels[:: max(len(pixels) // SAMPLE, 1)]
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 20, 0.5)
    count, labels = min(COLORS - len(kept), len(sample)), np.empty(0, dtype=np.int32)
    _, _, centres = cv2.kmeans(sample, count, labels, stop, 1, cv2.KMEANS_PP_CENTERS)
    return np.concatenate([kept, np.round(centres)])


def _nearest(image: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """(H, W) uint8: the nearest colour of the palette for every pixel."""
    squares = np.sum(palette**2, axis=1)
    # a line at a time: all pixels by all colours would take gigabytes
    index = [np.argmin(squares - 2.0 * line @ palette.T, axis=1) for line in image.astype(np.float32)]
    return np.array(index, dtype=np.uint8)

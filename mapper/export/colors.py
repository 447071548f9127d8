"""A colour for every class, the same in every map and on every machine."""

from __future__ import annotations

import colorsys
import zlib

import numpy as np


def class_color(label: str) -> np.ndarray:
    """(3,) uint8 RGB from the name alone: hue, saturation and brightness from separate bits of its checksum."""
    bits = zlib.crc32(label.casefold().encode())
    hue = (bits & 0xFFFF) / 0x10000
    saturation = 0.65 + 0.35 * ((bits >> 16) & 0xFF) / 0xFF
    brightness = 0.75 + 0.25 * (bits >> 24) / 0xFF
    return np.round(255 * np.array(colorsys.hsv_to_rgb(hue, saturation, brightness))).astype(np.uint8)


def linear_color(srgb: np.ndarray) -> np.ndarray:
    """(..., 3) light in [0, 1] from uint8 sRGB (IEC 61966-2-1): what glTF and USD mean by a colour."""
    value = np.asarray(srgb, dtype=np.float64) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)

"""A colour camera: lens blur, exposure that drifts, noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit


@dataclass(frozen=True, slots=True)
class ColorCamera:
    """How radiance becomes an image. Display values are the root of light; all numbers are own choices.

    Attributes:
        gain: display light for radiance 1.
        blur: pixels, deviation of the lens's Gaussian blur.
        noise: grey levels, deviation of brightness noise.
        chroma_noise: grey levels, of colour noise, alike over 2 x 2 pixels as a Bayer mosaic leaves it.
        drift: deviation of the logarithm of exposure.
        drift_band: Hz, of the drift.
    """

    gain: float = 1.55
    blur: float = 0.55
    noise: float = 2.2
    chroma_noise: float = 1.5
    drift: float = 0.05
    drift_band: tuple[float, float] = (0.03, 0.25)


def develop(radiance: np.ndarray, exposure: float, camera: ColorCamera, rng: np.random.Generator) -> np.ndarray:
    """(H, W, 3) linear RGB to a (H, W, 3) uint8 image; `exposure` multiplies the camera's gain."""
    height, width = radiance.shape[:2]
    grain = camera.noise * rng.standard_normal((height, width), dtype=np.float32)
    half = ((height + 1) // 2, (width + 1) // 2, 2)
    chroma = camera.chroma_noise * rng.standard_normal(half, dtype=np.float32)
    if camera.blur > 0.0:
        radiance = cv2.GaussianBlur(radiance, (5, 5), camera.blur)
    return _expose(radiance, np.float32(camera.gain * exposure), grain, chroma)


@njit(cache=True, fastmath=True)
def _expose(radiance, gain, grain, chroma):
    height, width, _ = radiance.shape
    out = np.empty((height, width, 3), np.uint8)
    for y in range(height):
        for x in range(width):
            red, blue = chroma[y // 2, x // 2, 0], chroma[y // 2, x // 2, 1]
            for channel in range(3):
                colour = red if channel == 0 else (blue if channel == 2 else np.float32(-0.5) * (red + blue))
                value = np.float32(255.0) * np.sqrt(gain * radiance[y, x, channel]) + grain[y, x] + colour
                out[y, x, channel] = min(max(value + np.float32(0.5), np.float32(0.0)), np.float32(255.0))
    return out

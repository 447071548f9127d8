"""A colour camera: lens blur, exposure and white balance that drift, noise, a shutter that stays open for a while."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from ..motion.orbit import Sway


@dataclass(frozen=True, slots=True)
class ColorCamera:
    """How radiance becomes an image. Display values are the root of light; all numbers are own choices.

    Attributes:
        gain: display light for radiance 1.
        blur: pixels, deviation of the lens's Gaussian blur.
        noise: grey levels, deviation of brightness noise.
        chroma_noise: grey levels, of colour noise, alike over 2 x 2 pixels as a Bayer mosaic leaves it.
        drift: deviation of the logarithm of exposure; 0 for none.
        drift_band: Hz, of the drift.
        white_drift: deviation of the logarithm of red against green light, and of blue; 0 for none.
        white_band: Hz, of that drift; automatic white balance settles over tens of seconds.
        shutter: seconds of exposure, which motion blur is averaged over; indoors video cameras take 20 to 30 ms.
    """

    gain: float = 1.55
    blur: float = 0.55
    noise: float = 2.2
    chroma_noise: float = 1.5
    drift: float = 0.05
    drift_band: tuple[float, float] = (0.03, 0.25)
    white_drift: float = 0.05
    white_band: tuple[float, float] = (0.01, 0.1)
    shutter: float = 0.025


def drifting_gains(camera: ColorCamera, stamps: np.ndarray, seed: int) -> np.ndarray:
    """(N, 3) factors on the camera's gain for red, green and blue light at (N,) seconds: exposure and white balance.

    A row depends on its own stamp only.
    """
    exposure = Sway(np.random.default_rng([seed, 2]), 1, camera.drift_band)(stamps)[0]
    red, blue = Sway(np.random.default_rng([seed, 5]), 2, camera.white_band)(stamps)
    white = camera.white_drift * np.stack([red, np.zeros_like(red), blue], axis=1)
    return np.exp(camera.drift * exposure)[:, None] * np.exp(white)


def exposure_poses(stamps: np.ndarray, poses: np.ndarray, index: int, shutter: float, count: int) -> np.ndarray:
    """Where the camera is while the shutter is open, about the stamp of frame `index`.

    Between two frames it moves straight and turns about a fixed axis, both at a constant rate; before the first and
    after the last it goes on as in the nearest pair.

    Args:
        stamps: (N,) seconds, growing.
        poses: (N, 4, 4) `T_world_camera`.
        index: of the frame.
        shutter: seconds.
        count: how many moments, the middles of as many equal parts of the exposure.

    Returns:
        (count, 4, 4) `T_world_camera`; the middle one of an odd count is the frame's pose.
    """
    moments = np.tile(poses[index], (count, 1, 1))
    if len(stamps) == 1:
        return moments
    for k, offset in enumerate(shutter * ((np.arange(count) + 0.5) / count - 0.5)):
        if abs(offset) < 1e-9:
            continue
        first = min(max(index - 1 if offset < 0.0 else index, 0), len(stamps) - 2)
        start, end = poses[first], poses[first + 1]
        share = (stamps[index] + offset - stamps[first]) / (stamps[first + 1] - stamps[first])
        turn = Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).as_rotvec()
        moments[k, :3, :3] = start[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
        moments[k, :3, 3] = start[:3, 3] + share * (end[:3, 3] - start[:3, 3])
    return moments


def develop(
    radiance: np.ndarray, gains: np.ndarray | float, camera: ColorCamera, rng: np.random.Generator
) -> np.ndarray:
    """(H, W, 3) linear RGB to a (H, W, 3) uint8 image; `gains`, one or (3,) for RGB, multiply the camera's gain."""
    height, width = radiance.shape[:2]
    grain = camera.noise * rng.standard_normal((height, width), dtype=np.float32)
    half = ((height + 1) // 2, (width + 1) // 2, 2)
    chroma = camera.chroma_noise * rng.standard_normal(half, dtype=np.float32)
    if camera.blur > 0.0:
        radiance = cv2.GaussianBlur(radiance, (5, 5), camera.blur)
    return _expose(radiance, (camera.gain * np.broadcast_to(gains, 3)).astype(np.float32), grain, chroma)


@njit(cache=True, fastmath=True, nogil=True)
def _expose(radiance, gains, grain, chroma):
    height, width, _ = radiance.shape
    out = np.empty((height, width, 3), np.uint8)
    for y in range(height):
        for x in range(width):
            red, blue = chroma[y // 2, x // 2, 0], chroma[y // 2, x // 2, 1]
            for channel in range(3):
                colour = red if channel == 0 else (blue if channel == 2 else np.float32(-0.5) * (red + blue))
                value = np.float32(255.0) * np.sqrt(gains[channel] * radiance[y, x, channel]) + grain[y, x] + colour
                out[y, x, channel] = min(max(value + np.float32(0.5), np.float32(0.0)), np.float32(255.0))
    return out

"""How a hand carries a camera around a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class OrbitConfig:
    """A hand-held arc around the table. Amplitudes are standard deviations of band-limited noise.

    Attributes:
        radius: metres from the table's axis.
        height: metres above the floor.
        start: radians, azimuth of the first frame.
        speed: metres a second along the arc.
        gaze: metres, the point looked at, on average.
        shake_position: metres.
        shake_gaze: metres at the point looked at.
        shake_roll: radians.
        band: Hz, of the hand's motion.
    """

    radius: float = 1.20
    height: float = 1.24
    start: float = -2.25
    speed: float = 0.34
    gaze: tuple[float, float, float] = (0.0, 0.0, 0.78)
    shake_position: float = 0.035
    shake_gaze: float = 0.05
    shake_roll: float = 0.03
    band: tuple[float, float] = (0.08, 1.6)


def hand_held(stamps: np.ndarray, seed: int, config: OrbitConfig = OrbitConfig()) -> np.ndarray:
    """(N,) seconds to (N, 4, 4) `T_world_camera`. A pose depends on its own stamp only."""
    rng = np.random.default_rng([seed, 1])
    sway = Sway(rng, 7, config.band)(stamps)
    azimuth = config.start + config.speed / config.radius * stamps + 0.03 * sway[0]
    radius = config.radius + config.shake_position * sway[1]
    eye = np.stack(
        [radius * np.cos(azimuth), radius * np.sin(azimuth), config.height + config.shake_position * sway[2]], axis=1
    )
    target = np.array(config.gaze) + config.shake_gaze * sway[3:6].T
    return look_at(eye, target, config.shake_roll * sway[6])


class Sway:
    """Sums of sines with random phases: unit variance, amplitude falling with frequency as a hand's does."""

    def __init__(self, rng: np.random.Generator, channels: int, band: tuple[float, float], tones: int = 10) -> None:
        low, high = np.log(band)
        self._frequency = np.exp(rng.uniform(low, high, (channels, tones)))
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (channels, tones))
        amplitude = 1.0 / (0.15 + self._frequency) ** 1.5
        self._amplitude = amplitude * np.sqrt(2.0 / np.sum(amplitude**2, axis=1, keepdims=True))

    def __call__(self, stamps: np.ndarray) -> np.ndarray:
        """(N,) seconds to (channels, N)."""
        angle = 2.0 * np.pi * self._frequency[..., None] * stamps + self._phase[..., None]
        return np.sum(self._amplitude[..., None] * np.sin(angle), axis=1)


def look_at(eye: np.ndarray, target: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Poses of cameras at `eye` (N, 3) that look at `target` (N, 3), world z up, turned by `roll` (N,) radians."""
    z = target - eye
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(z, x)
    c, s = np.cos(roll)[:, None], np.sin(roll)[:, None]
    poses = np.tile(np.eye(4), (len(eye), 1, 1))
    poses[:, :3, :3] = np.stack([c * x + s * y, c * y - s * x, z], axis=2)
    poses[:, :3, 3] = eye
    return poses

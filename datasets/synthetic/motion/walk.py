"""How somebody carries a camera through the two rooms of `two_rooms.py`, lap after lap."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from .orbit import Sway, look_at

# Where the camera is (x, y) and what it looks at (x, y, z), metres: along the counter, round before the shelf, back
# past the table, through the doorway; then the same in the living room. The last stop leads to the first.
STOPS = (
    ((0.00, 0.45), (-2.4, 0.90, 0.85)),
    ((-0.80, 0.62), (-2.1, 1.70, 0.90)),
    ((-1.60, 0.72), (-2.6, 1.75, 0.95)),
    ((-2.35, 0.72), (-3.7, 1.70, 1.00)),
    ((-3.05, 0.60), (-4.1, 0.75, 0.90)),
    ((-3.10, 0.22), (-4.0, -0.05, 0.80)),
    ((-2.55, 0.08), (-3.4, -0.95, 0.45)),
    ((-1.85, 0.14), (-2.05, -0.75, 0.74)),
    ((-1.25, 0.24), (-0.90, -1.20, 0.45)),
    ((-0.60, 0.38), (0.50, -0.50, 0.60)),
    ((0.20, 0.46), (1.70, 0.80, 0.70)),
    ((1.00, 0.68), (1.80, 1.80, 0.80)),
    ((1.80, 0.84), (2.55, 1.85, 0.85)),
    ((2.60, 0.84), (3.80, 1.40, 0.75)),
    ((3.25, 0.70), (4.40, 0.65, 0.75)),
    ((3.40, 0.34), (4.40, -0.20, 0.70)),
    ((2.85, 0.10), (3.50, -0.85, 0.45)),
    ((2.05, 0.14), (2.30, -0.55, 0.44)),
    ((1.35, 0.26), (1.10, -1.20, 0.35)),
    ((0.75, 0.38), (-0.10, -0.45, 0.55)),
)


@dataclass(frozen=True, slots=True)
class WalkConfig:
    """A hand-held walk. Amplitudes are standard deviations of band-limited noise unless said otherwise.

    Attributes:
        speed: metres a second along the loop, on average.
        height: metres above the floor.
        hurry: metres by which the walker runs ahead of the average or falls behind.
        stray: metres from the loop, along x and along y; no lap is like another.
        wander: metres at the point looked at, slowly.
        slow: Hz, band of these three.
        step: metres a walker covers with one foot; the head goes up and down once a step, aside every other.
        bob: metres up and down, and
        sway: metres from side to side, amplitudes.
        shake_position: metres, of the hand.
        shake_gaze: radians, of the hand, each of up and aside.
        shake_roll: radians.
        band: Hz, of the hand.
    """

    speed: float = 0.49
    height: float = 1.50
    hurry: float = 0.10
    stray: float = 0.035
    wander: float = 0.08
    slow: tuple[float, float] = (0.02, 0.12)
    step: float = 0.35
    bob: float = 0.010
    sway: float = 0.008
    shake_position: float = 0.010
    shake_gaze: float = 0.012
    shake_roll: float = 0.014
    band: tuple[float, float] = (0.08, 1.6)


class Loop:
    """A smooth closed path through stops, by the distance walked (metres, on the floor)."""

    def __init__(
        self, stops: tuple[tuple[tuple[float, float], tuple[float, float, float]], ...], height: float
    ) -> None:
        place = np.array([stop for stop, _ in stops])
        ahead = np.array([look for _, look in stops]) - np.column_stack([place, np.full(len(place), height)])
        azimuth = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
        fall = np.arctan2(ahead[:, 2], np.linalg.norm(ahead[:, :2], axis=1))
        reach = np.linalg.norm(ahead, axis=1)
        rows = np.column_stack([place, azimuth, fall, reach])
        rows = np.vstack([rows, rows[:1]])
        knots = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(rows[:, :2], axis=0), axis=1))]
        spline = CubicSpline(knots, rows, bc_type="periodic")
        # The spline's own parameter runs a little slower than its length: measure it once, finely.
        fine = np.linspace(0.0, knots[-1], 200 * len(knots))
        length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(spline(fine)[:, :2], axis=0), axis=1))]
        self.length = float(length[-1])
        self._spline, self._fine, self._length = spline, fine, length

    def __call__(self, distance: np.ndarray) -> np.ndarray:
        """(N,) metres to (N, 5): x, y, azimuth and elevation of the gaze (radians), metres to what is looked at."""
        return self._spline(np.interp(distance % self.length, self._length, self._fine))

    def sideways(self, distance: np.ndarray) -> np.ndarray:
        """(N, 2) unit vectors to the left of the way."""
        ahead = self(distance + 0.01)[:, :2] - self(distance - 0.01)[:, :2]
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        return np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)


@lru_cache(maxsize=1)
def loop(height: float) -> Loop:
    """The loop through `STOPS` for a camera at this height."""
    return Loop(STOPS, height)


def walk(stamps: np.ndarray, seed: int, config: WalkConfig = WalkConfig()) -> np.ndarray:
    """(N,) seconds to (N, 4, 4) `T_world_camera`. A pose depends on its own stamp only."""
    rng = np.random.default_rng([seed, 1])
    slow = Sway(rng, 5, config.slow)(stamps)
    hand = Sway(rng, 6, config.band)(stamps)
    way = loop(config.height)
    distance = config.speed * stamps + config.hurry * slow[0]
    x, y, azimuth, elevation, reach = way(distance).T
    gait = np.pi * distance / config.step
    eye = np.stack([x, y, config.height + config.bob * np.cos(2.0 * gait)], axis=1)
    eye[:, :2] += config.stray * slow[3:].T + config.sway * np.sin(gait)[:, None] * way.sideways(distance)
    eye += config.shake_position * hand[:3].T
    azimuth = azimuth + config.wander * slow[1] / reach + config.shake_gaze * hand[3]
    elevation = elevation + config.wander * slow[2] / reach + config.shake_gaze * hand[4]
    level = np.cos(elevation)
    gaze = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)
    return look_at(eye, eye + gaze, config.shake_roll * hand[5])

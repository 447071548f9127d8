"""How somebody films a wall on the way along it: sideways, at arm's length from the prints, there and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .orbit import Sway, look_at


@dataclass(frozen=True, slots=True)
class WallWalkConfig:
    """A walk along the x axis that looks along +y. Amplitudes are standard deviations of band-limited noise unless
    said otherwise; they are small, so that no view reaches an end of the wall, the floor or the ceiling.

    Attributes:
        distance: metres from the wall, whose plane is at y = `distance`.
        speed: metres a second along the wall.
        reach: metres from the middle to where the walker turns back.
        start: metres, x of the first frame.
        crispness: of a turn, from 0 (a pendulum) to 1 (at once).
        height: metres above the floor.
        hurry: metres by which the walker runs ahead or falls behind.
        stray: metres nearer to the wall or farther off.
        wander: metres on the wall at the point looked at, each of along and up.
        slow: Hz, band of these three.
        step: metres covered with one step aside; the head goes up and down once a step.
        bob: metres up and down, amplitude.
        shake_position: metres, of the hand.
        shake_gaze: radians, of the hand, each of up and aside.
        shake_roll: radians.
        band: Hz, of the hand.
    """

    distance: float = 1.2
    speed: float = 0.30
    reach: float = 2.2
    start: float = -1.6
    crispness: float = 0.98
    height: float = 1.35
    hurry: float = 0.05
    stray: float = 0.02
    wander: float = 0.04
    slow: tuple[float, float] = (0.02, 0.12)
    step: float = 0.30
    bob: float = 0.008
    shake_position: float = 0.006
    shake_gaze: float = 0.010
    shake_roll: float = 0.012
    band: tuple[float, float] = (0.08, 1.6)


def along_wall(stamps: np.ndarray, seed: int, config: WallWalkConfig = WallWalkConfig()) -> np.ndarray:
    """(N,) seconds to (N, 4, 4) `T_world_camera`. A pose depends on its own stamp only."""
    rng = np.random.default_rng([seed, 1])
    slow = Sway(rng, 4, config.slow)(stamps)
    hand = Sway(rng, 6, config.band)(stamps)
    walked = config.speed * stamps + config.hurry * slow[0]
    eye = np.stack(
        [
            to_and_fro(walked, config.start, config.reach, config.crispness),
            config.stray * slow[1],
            config.height + config.bob * np.cos(2.0 * np.pi * walked / config.step),
        ],
        axis=1,
    )
    eye += config.shake_position * hand[:3].T
    gaze = config.wander * slow[2:] + config.distance * config.shake_gaze * hand[3:5]
    target = np.stack([eye[:, 0] + gaze[0], np.full(len(eye), config.distance), config.height + gaze[1]], axis=1)
    return look_at(eye, target, config.shake_roll * hand[5])


def to_and_fro(walked: np.ndarray, start: float, reach: float, crispness: float) -> np.ndarray:
    """(N,) metres walked to (N,) metres from the middle: evenly from `start` upwards, soft turns at `reach`.

    A triangle wave with round corners, x = reach asin(k sin p) / asin(k), where k is the crispness and the phase p
    grows so that halfway between two turns x changes by as much as is walked.
    """
    bend = np.arcsin(crispness)
    first = np.arcsin(np.sin(start / reach * bend) / crispness)
    phase = first + walked * bend / (crispness * reach)
    return reach * np.arcsin(crispness * np.sin(phase)) / bend

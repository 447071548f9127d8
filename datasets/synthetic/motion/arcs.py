"""Way points of a robot that surveys a table: an arc about the scene's middle, a picture every five degrees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .orbit import look_at


@dataclass(frozen=True, slots=True)
class ArcConfig:
    """A robot's arcs, there and back again; deviations are of normal noise, independent between pictures.

    Attributes:
        step: radians between way points.
        views: way points of an arc.
        start: radians, azimuth of the first.
        radii: metres of one arc after another, and
        heights: metres of its camera above the floor; after the last comes the first again.
        centre: metres, x and y of the arcs' middle.
        gaze: metres, the point looked at.
        position_error: metres, deviation along each axis of the floor.
        heading_error: radians, deviation of the gaze's azimuth and of its elevation.
        roll_error: radians.
    """

    step: float = np.pi / 36.0
    views: int = 37
    start: float = -np.pi
    radii: tuple[float, ...] = (1.9, 1.6, 2.1)
    heights: tuple[float, ...] = (1.40, 1.25, 1.55)
    centre: tuple[float, float] = (0.0, -0.25)
    gaze: tuple[float, float, float] = (0.0, 0.20, 0.75)
    position_error: float = 0.02
    heading_error: float = 0.015
    roll_error: float = 0.004


def survey(count: int, seed: int, config: ArcConfig = ArcConfig()) -> np.ndarray:
    """(count, 4, 4) `T_world_camera`; the first way points do not depend on how many follow."""
    index = np.arange(count)
    arc, place = index // config.views, index % config.views
    place = np.where(arc % 2, config.views - 1 - place, place)  # every other arc goes back
    azimuth = config.start + config.step * place
    radius = np.array(config.radii)[arc % len(config.radii)]
    height = np.array(config.heights)[arc % len(config.heights)]
    error = np.random.default_rng([seed, 1]).standard_normal((count, 5))
    eye = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=1)
    eye[:, :2] += np.array(config.centre) + config.position_error * error[:, :2]
    ahead = np.array(config.gaze) - eye
    distance = np.linalg.norm(ahead, axis=1)
    side = np.cross(ahead, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    off = config.heading_error * distance[:, None] * error[:, 2:4]
    target = eye + ahead + off[:, :1] * side + off[:, 1:] * np.array([0.0, 0.0, 1.0])
    return look_at(eye, target, config.roll_error * error[:, 4])

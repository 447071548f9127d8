"""From ray hits to depth and light: textures, two area lights a room with soft shadows, highlights, ambient light."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...frame import Intrinsics
from .casting import Caster, pixel_rays
from .kernels import TILE, light_pixels, resolve_hits, shadow_rays
from .surfaces import Surfaces

NEIGHBOURHOOD = np.ones((TILE + 1, TILE // 2 + 2), np.uint8)  # pixels whose shadow rays a pixel may use, half as wide


@dataclass(frozen=True, slots=True)
class Lights:
    """Two discs under the ceiling of every room that shine down, and light from everywhere.

    Rooms lie side by side along x. A surface is lit by the lamps of the room it is in only; lamps that mirror each
    other in the wall between two rooms leave no seam in a doorway.

    Attributes:
        centres: metres, world; two a room, rooms by growing x.
        powers: linear RGB of each at one metre.
        radius: metres of a disc; what makes shadows soft.
        sky: linear RGB of the ambient light from above.
        bounce: share of it that comes from below; the floor's light on ceilings.
        walls: metres, world x of the planes between rooms, ascending; none for one room.

    Raises:
        ValueError: not two lamps a room, or walls out of order.
    """

    centres: tuple[tuple[float, float, float], ...] = ((1.3, 0.25, 2.25), (-1.2, -0.9, 2.4))
    powers: tuple[tuple[float, float, float], ...] = ((5.6, 5.1, 4.3), (1.6, 1.75, 2.0))
    radius: float = 0.11
    sky: tuple[float, float, float] = (0.17, 0.18, 0.21)
    bounce: float = 0.45
    walls: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        lamps = 2 * (len(self.walls) + 1)
        if len(self.centres) != lamps or len(self.powers) != lamps:
            found = f"{len(self.centres)} centres and {len(self.powers)} powers"
            raise ValueError(f"{len(self.walls)} walls need {lamps} lamps, but got {found}")
        if list(self.walls) != sorted(self.walls):
            raise ValueError(f"walls must ascend, but got {self.walls}")


@dataclass(frozen=True, slots=True, eq=False)
class Cast:
    """The first hits of an image's rays.

    Attributes:
        directions: (H * W, 3) float32, world, unit along the optical axis.
        triangle: (H * W,) int32, or `MISS`.
    """

    directions: np.ndarray
    triangle: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Rendering:
    """A noiseless image.

    Attributes:
        radiance: (H, W, 3) float32, linear RGB, about 1 for a well-lit white surface.
        depth: (H, W) float32 metres along z; 0 where nothing is hit.
        incidence: (H, W) float32 cosine between the ray and the surface's normal.
    """

    radiance: np.ndarray
    depth: np.ndarray
    incidence: np.ndarray


class Renderer:
    """Renders one set of surfaces.

    Args:
        surfaces: the scene.
        lights: what it is lit by.
    """

    def __init__(self, surfaces: Surfaces, lights: Lights = Lights()) -> None:
        self._surfaces = surfaces
        self._caster = Caster(surfaces.corners)
        self._lamps = _lamp_points(lights)
        self._powers = np.array(lights.powers, np.float32)
        self._sky = np.array(lights.sky, np.float32)
        slope = np.float32((1.0 - lights.bounce) / 2.0)
        self._ambient = np.array([np.float32(lights.bounce) + slope, slope], np.float32)
        self._walls = np.array(lights.walls, np.float32)

    def cast(self, intrinsics: Intrinsics, T_world_camera: np.ndarray) -> Cast:
        """What every pixel sees."""
        size = (intrinsics.width, intrinsics.height)
        origins, directions = pixel_rays(intrinsics, T_world_camera, (0, 0), size)
        return Cast(directions, self._caster.first_hit(origins, directions))

    def render(self, intrinsics: Intrinsics, T_world_camera: np.ndarray, cast: Cast) -> Rendering:
        """Depth and light of a cast."""
        eye = np.ascontiguousarray(T_world_camera[:3, 3], np.float64)
        width, height = intrinsics.width, intrinsics.height
        depth, normal, incidence, albedo, material = resolve_hits(
            cast.triangle, cast.directions, eye, 1.0 / intrinsics.fx, self._surfaces
        )
        origins, to_lamp, reach, asked = shadow_rays(
            cast.directions, eye, depth, normal, self._lamps, self._walls, width
        )
        clear = ~self._caster.blocked(origins, to_lamp, reach).reshape(height, width // 2)
        open_near = cv2.erode(clear.view(np.uint8), NEIGHBOURHOOD)
        radiance = light_pixels(
            material, cast.directions, eye, depth, normal, albedo, asked.reshape(height, width // 2), clear, open_near,
            self._lamps, self._powers, self._walls, self._sky, self._ambient, self._surfaces.shine,
        )  # fmt: skip
        return Rendering(
            radiance.reshape(height, width, 3), depth.reshape(height, width), incidence.reshape(height, width)
        )


def _lamp_points(lights: Lights) -> np.ndarray:
    """(2 R, P, 3) float32: points spread over each disc (a sunflower spiral).

    Every other room has it mirrored, as lamps may be: even the small offset of its first point leaves a seam otherwise.
    """
    count = TILE * TILE // 4
    k = np.arange(count)
    radius, angle = lights.radius * np.sqrt((k + 0.5) / count), k * np.pi * (3.0 - np.sqrt(5.0))
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)], axis=1)
    mirror = np.where(np.arange(len(lights.centres)) // 2 % 2, -1.0, 1.0)
    discs = disc * np.stack([mirror, np.ones_like(mirror), np.ones_like(mirror)], axis=1)[:, None]
    return (np.array(lights.centres)[:, None] + discs).astype(np.float32)

"""Textured models on a virtual turntable: rendered in colour, measured in depth, every pixel of the object known.

The camera looks at the object's middle from three elevations, as the turntable videos of the Washington RGB-D Object
Dataset were taken (Lai et al. 2011: 30, 45 and 60 degrees), and from several distances, because depth gets coarser and
texture finer detail is lost with distance. Light changes from ring to ring (a ring: one elevation and distance), the
exposure from view to view.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from ..errors import UserError
from ..frame import Intrinsics
from ..synthetic.materials.textures import plain
from ..synthetic.mesh import face
from ..synthetic.motion.orbit import look_at
from ..synthetic.rendering.camera import ColorCamera, develop
from ..synthetic.rendering.casting import MISS
from ..synthetic.rendering.render import Lights, Renderer
from ..synthetic.rendering.sensor import DepthSensor, measure
from ..synthetic.rendering.silhouettes import projected_box
from ..synthetic.rendering.surfaces import Surfaces, assemble
from ..synthetic.sequence import kinect_camera
from ..synthetic.things.objects import Model, Part
from ..synthetic.things.scans import load_scans, scan_names
from ..truth import NO_OBJECT
from .object_view import BrokenView, ObjectView, ObjectViews, ViewEntry, margin_about, mask_box

OBJECT = 0  # owner of the object's surfaces
TABLE = 8.0  # m, a side of the plane that the object stands on: it fills every view from above
TILE = 12  # pixels that sizes of renderings are multiples of: twice the renderer's pattern of shadow rays
LIGHT, VIEW = 21, 22  # streams of chance: one does not disturb another


@dataclass(frozen=True, slots=True)
class Turntable:
    """How a model is looked at. A view depends on the seed, its model's position and its own number only.

    Attributes:
        elevations: degrees of the camera above the table, seen from the object's middle.
        azimuths: views a ring, evenly about the object; rings are turned against each other.
        distances: metres from the camera to the object's middle.
        jitter: deviations of elevation (degrees), distance (share) and roll (degrees); own choice.
        light: least and greatest power of the first lamp, in shares of the rooms' lamps; own choice.
        exposure: deviation of the logarithm of a view's exposure; own choice.
        seed: of light, noise and jitter.
        sensor: measures depth.
        camera: takes the picture.

    Raises:
        UserError: no view, or an elevation or a distance from which an object cannot be seen.
    """

    elevations: tuple[float, ...] = (30.0, 45.0, 60.0)
    azimuths: int = 12
    distances: tuple[float, ...] = (0.7, 1.0, 1.4)
    jitter: tuple[float, float, float] = (2.0, 0.03, 1.5)
    light: tuple[float, float] = (0.4, 1.0)
    exposure: float = 0.15
    seed: int = 0
    sensor: DepthSensor = field(default_factory=DepthSensor)
    camera: ColorCamera = field(default_factory=ColorCamera)

    def __post_init__(self) -> None:
        if self.azimuths < 1 or not self.elevations or not self.distances:
            raise UserError("a turntable needs at least one azimuth, one elevation and one distance")
        if not all(10.0 <= elevation <= 85.0 for elevation in self.elevations):
            raise UserError(f"elevations of a turntable lie from 10 to 85 degrees, got {self.elevations}")
        if not all(self.sensor.near < distance < self.sensor.far for distance in self.distances):
            reach = f"{self.sensor.near:g} to {self.sensor.far:g} m"
            raise UserError(f"distances of a turntable lie within the depth sensor's {reach}, got {self.distances}")

    @property
    def rings(self) -> tuple[tuple[float, float], ...]:
        """Elevation and distance of each ring of views."""
        return tuple((elevation, distance) for elevation in self.elevations for distance in self.distances)


def scan_views(folder: Path, turntable: Turntable = Turntable()) -> ObjectViews:
    """Views of all textured meshes below a folder; errors as `load_scans`."""
    return turntable_views(load_scans(folder), scan_names(folder), turntable)


def turntable_views(
    models: Iterable[Model], names: Iterable[str] | None = None, turntable: Turntable = Turntable()
) -> ObjectViews:
    """Views of models, ring by ring, model after model; each is rendered when it is asked for.

    Args:
        models: what to look at; `Model.label` is the class.
        names: what each is called, the views' `instance`; None to number them by class.
        turntable: from where.
    """
    things = tuple(models)
    studio = _Studio(things, tuple(names) if names is not None else _numbered(things), turntable)
    return ObjectViews(studio.entries())


def _numbered(models: tuple[Model, ...]) -> tuple[str, ...]:
    """Names by class: bowl 1, bowl 2, cap 1."""
    labels = [model.label for model in models]
    return tuple(f"{label} {labels[: k + 1].count(label)}" for k, label in enumerate(labels))


class _Studio:
    """Renders views; keeps the surfaces and the renderer of the last ring, since views come ring by ring."""

    def __init__(self, models: tuple[Model, ...], names: tuple[str, ...], turntable: Turntable) -> None:
        self._models, self._names, self._turntable = models, names, turntable
        self._camera = kinect_camera(640)
        self._surfaces = lru_cache(maxsize=1)(self._assembled)
        self._renderer = lru_cache(maxsize=1)(self._lit)

    def entries(self) -> Iterator[ViewEntry]:
        for k, (model, instance) in enumerate(zip(self._models, self._names, strict=True)):
            for ring, (elevation, distance) in enumerate(self._turntable.rings):
                for step in range(self._turntable.azimuths):
                    azimuth = 360.0 * (step + ring / len(self._turntable.rings)) / self._turntable.azimuths
                    name = f"{instance} at {elevation:g} deg, {distance:g} m, azimuth {azimuth:.1f}"
                    yield ViewEntry(model.label, instance, name, partial(self._view, k, ring, step, azimuth, name))

    def _view(self, k: int, ring: int, step: int, azimuth: float, name: str) -> ObjectView:
        model, turntable = self._models[k], self._turntable
        rng = np.random.default_rng([turntable.seed, VIEW, k, ring, step])
        T_world_camera = self._pose(model, ring, azimuth, rng)
        part = self._framed(model, T_world_camera)
        renderer = self._renderer(k, ring)
        cast = renderer.cast(part, T_world_camera)
        seen = renderer.render(part, T_world_camera, cast)
        owner = np.where(cast.triangle == MISS, np.int32(NO_OBJECT), self._surfaces(k).owner[cast.triangle])
        mask = (owner == OBJECT).reshape(part.height, part.width)
        return ObjectView(
            label=model.label,
            instance=self._names[k],
            name=name,
            color=develop(seen.radiance, np.exp(turntable.exposure * rng.standard_normal()), turntable.camera, rng),
            depth=measure(seen.depth, seen.incidence, part, turntable.sensor, rng),
            mask=mask,
            xyxy=mask_box(mask),
            focal=part.fx,
        )

    def _pose(self, model: Model, ring: int, azimuth: float, rng: np.random.Generator) -> np.ndarray:
        """(4, 4) `T_world_camera`; the object stands on z = 0 in the world's middle."""
        elevation, distance = self._turntable.rings[ring]
        off = np.array(self._turntable.jitter) * rng.standard_normal(3)
        up, around = np.radians(elevation + off[0]), np.radians(azimuth)
        target = np.array([0.0, 0.0, model.size[2] / 2.0])
        ray = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        eye = target + distance * (1.0 + off[1]) * ray
        return look_at(eye[None], target[None], np.radians(off[2:]))[0]

    def _framed(self, model: Model, T_world_camera: np.ndarray) -> Intrinsics:
        """The part of the camera's image that holds the object and its margin: only that is rendered."""
        half = model.size[:2] / 2.0
        corners = [(x, y, z) for x in (-half[0], half[0]) for y in (-half[1], half[1]) for z in (0.0, model.size[2])]
        box = projected_box(np.array(corners), self._camera, T_world_camera)
        if box is None or (box[2:] - box[:2] > (self._camera.width, self._camera.height)).any():
            raise BrokenView("the object is too large to be seen whole from there")
        margin, k = margin_about(box), self._camera
        left, top = np.floor(box[:2] - margin)
        width, height = (TILE * int(side) for side in np.ceil((box[2:] - box[:2] + 2.0 * margin) / TILE))
        return Intrinsics(width, height, k.fx, k.fy, k.cx - float(left), k.cy - float(top))

    def _assembled(self, k: int) -> Surfaces:
        model = self._models[k]
        rng = np.random.default_rng([self._turntable.seed, LIGHT, k])
        tint = rng.uniform(60.0, 180.0) + rng.uniform(-25.0, 25.0, 3)
        table = Part(face((TABLE, TABLE, 0.0), "+z"), plain(rng, (int(tint[0]), int(tint[1]), int(tint[2]))))
        return assemble([*((part, OBJECT) for part in model.parts), (table, NO_OBJECT)])

    def _lit(self, k: int, ring: int) -> Renderer:
        """The model under two lamps somewhere above."""
        rng = np.random.default_rng([self._turntable.seed, LIGHT, k, ring])
        usual, around = Lights(), rng.uniform(0.0, 2.0 * np.pi)
        reach, height = rng.uniform(0.3, 1.8, 2), rng.uniform(1.3, 1.9, 2)
        angle = around + np.array([0.0, rng.uniform(0.5, 1.5) * np.pi])
        power = rng.uniform(*self._turntable.light)
        first, second = ((power * red, power * green, power * blue) for red, green, blue in usual.powers)
        centres = tuple((r * np.cos(a), r * np.sin(a), h) for r, a, h in zip(reach, angle, height, strict=True))
        return Renderer(self._surfaces(k), Lights(centres=centres, powers=(first, second)))

"""The scene of a configuration: which things stand where, and its surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..errors import UserError
from ..truth import NO_OBJECT, TrueObject
from .config import DEFAULT_FRAMES, ClutterLevel, Preset, SyntheticConfig
from .mesh import rotation_z
from .motion.camera_paths import camera_path
from .placement import Placement, clutter_count, place
from .rendering.render import Lights
from .rendering.surfaces import Surfaces, assemble
from .rooms.layouts import build_layout
from .things.models import CLASSES, build_clutter, build_model
from .things.objects import Model, Part
from .things.scans import load_scans

LAYOUT, LABELS, OBJECTS, CLUTTER, PLACES = range(10, 15)  # streams of chance: one does not disturb another
VIEW_STEP = 10  # frames between the viewpoints that clutter is placed for


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The scene in world coordinates: metres, z up, floor at z = 0.

    Attributes:
        objects: things of `classes`, numbered from 0; `surfaces.owner` is their `id`.
        clutter: things of no class, numbered on from the objects.
        classes: the procedural classes, then those of imported scans that are none of them.
        surfaces: everything as triangles; the owner of the room is `NO_OBJECT`.
        lights: what it is lit by.
    """

    objects: tuple[TrueObject, ...]
    clutter: tuple[TrueObject, ...]
    classes: tuple[str, ...]
    surfaces: Surfaces
    lights: Lights


def build_scene(config: SyntheticConfig) -> Scene:
    """The scene; nothing but preset, object count, clutter, seed and meshes of the configuration matters.

    The clutter level changes places and clutter, never which objects there are.

    Raises:
        UserError: no room for so many things, or meshes that cannot be used (see `load_scans`).
    """
    meshes = None if config.meshes is None else config.meshes.resolve()  # the same path elsewhere is another folder
    return _build(config.preset, config.object_count, config.clutter, config.seed, meshes)


@lru_cache(maxsize=2)  # it takes seconds, and a sequence is often opened again
def _build(preset: Preset, count: int, level: ClutterLevel, seed: int, meshes: Path | None) -> Scene:
    layout = build_layout(preset, np.random.default_rng([seed, LAYOUT]))
    scans = () if meshes is None else load_scans(meshes)
    if len(scans) > count:
        raise UserError(
            f"{meshes}: expected no more scans than objects, found {len(scans)} scans for {count} objects; "
            "ask for more objects"
        )
    models = [*scans, *_models(seed, count - len(scans))]
    classes = tuple(dict.fromkeys((*CLASSES, *(scan.label for scan in scans))))
    chances = (np.random.default_rng([seed, CLUTTER, k]) for k in range(clutter_count(count, level)))
    models += [build_clutter(rng, classes) for rng in chances]
    sizes = np.array([model.size for model in models])
    chance = np.random.default_rng([seed, PLACES])
    places = place(sizes[:count], sizes[count:], layout.supports, level, chance, _viewpoints(preset, seed))
    things = tuple(_thing(k, model, spot) for k, (model, spot) in enumerate(zip(models, places, strict=True)))
    parts = [(part, NO_OBJECT) for part in layout.parts]
    for thing, model, spot in zip(things, models, places, strict=True):
        parts += [(_placed(part, spot), thing.id) for part in model.parts]
    return Scene(things[:count], things[count:], classes, assemble(parts), layout.lights)


def _viewpoints(preset: Preset, seed: int) -> np.ndarray:
    """(V, 2) metres: where the camera passes on the preset's own path, however many frames are asked for."""
    _, poses = camera_path(preset, DEFAULT_FRAMES[preset], seed)
    return poses[::VIEW_STEP, :2, 3]


def _models(seed: int, count: int) -> list[Model]:
    """All classes before any class comes again, in an order that changes from round to round."""
    rng = np.random.default_rng([seed, LABELS])
    rounds = -(-count // len(CLASSES))
    labels = [CLASSES[k] for _ in range(rounds) for k in rng.permutation(len(CLASSES))]
    return [build_model(label, np.random.default_rng([seed, OBJECTS, k])) for k, label in enumerate(labels[:count])]


def _thing(number: int, model: Model, spot: Placement) -> TrueObject:
    centre = np.array([spot.x, spot.y, spot.z + model.size[2] / 2.0])
    return TrueObject(number, model.label, centre, model.size, spot.yaw)


def _placed(part: Part, spot: Placement) -> Part:
    mesh = part.mesh.turned(rotation_z(spot.yaw)).moved((spot.x, spot.y, spot.z))
    return Part(mesh, part.texture, part.gloss, part.sharpness)

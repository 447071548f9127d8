"""The embedded sample: a rendered table-top sequence that needs no download."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from urllib.parse import parse_qsl

import numpy as np

from ..errors import UserError
from .motion.orbit import OrbitConfig, hand_held
from .rendering.camera import ColorCamera
from .rendering.render import Lights
from .rendering.sensor import DepthSensor
from .scene import Scene
from .sequence import RenderedSequence
from .world import CLASSES, MAX_OBJECTS, build_world

RATE = 30.0  # Hz
STEADY_WHITE = ColorCamera(white_drift=0.0)
LIMITS = {"seed": (0, 2**31 - 1), "objects": (1, MAX_OBJECTS), "frames": (1, 3000), "width": (64, 1280)}


@dataclass(frozen=True, slots=True)
class TabletopConfig:
    """What to render.

    Attributes:
        seed: of the scene, the path and the noise.
        objects: number of things of the sample's classes on the table; clutter comes on top.
        frames: length of the sequence; a longer one begins with the same frames.
        width: pixels, divisible by 4; images are 4:3 with the field of view of f = 525 at 640 x 480.
        orbit: how the camera moves.
        sensor: the depth sensor.
        camera: the colour camera; its white balance holds still.

    Raises:
        UserError: a number outside its limits.
    """

    seed: int = 0
    objects: int = 12
    frames: int = 150
    width: int = 640
    orbit: OrbitConfig = field(default_factory=OrbitConfig)
    sensor: DepthSensor = field(default_factory=DepthSensor)
    camera: ColorCamera = STEADY_WHITE

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UserError(f"sample:tabletop: expected {name} from {low} to {high}, found {value}; change it")
        if self.width % 4:
            raise UserError(f"sample:tabletop: expected a width divisible by 4, found {self.width}; change it")


class TabletopSequence(RenderedSequence):
    """Mugs, bowls, cans and more on a table, seen by a hand-held depth camera."""

    def __init__(self, config: TabletopConfig = TabletopConfig()) -> None:
        self.config = config
        world = build_world(config.seed, config.objects)
        stamps = np.arange(config.frames) / RATE
        super().__init__(
            name="sample:tabletop" + _changed(config),
            scene=Scene(world.objects, world.clutter, CLASSES, world.surfaces, Lights()),
            width=config.width,
            stamps=stamps,
            poses=hand_held(stamps, config.seed, config.orbit),
            frames=config.frames,
            seed=config.seed,
            sensor=config.sensor,
            camera=config.camera,
        )

    def __reduce__(self):
        """Pickle the recipe."""
        return TabletopSequence, (self.config,)


def _changed(config: TabletopConfig) -> str:
    """The parameters that differ from the defaults, as `open_sample` reads them."""
    default = TabletopConfig()
    changed = [f"{key}={getattr(config, key)}" for key in LIMITS if getattr(config, key) != getattr(default, key)]
    return "?" + "&".join(changed) if changed else ""


SAMPLES = ("tabletop",)


def open_sample(name: str) -> TabletopSequence:
    """The embedded sequence called `name`.

    Args:
        name: `tabletop`, or with parameters as `tabletop?seed=3&objects=12&frames=150`; the parameters are those of
            `TabletopConfig` that are whole numbers. A leading `sample:` is allowed.

    Raises:
        UserError: no such sample or parameter, or a value that is not a whole number within its limits.
    """
    base, _, query = name.removeprefix("sample:").partition("?")
    if base not in SAMPLES:
        raise UserError(f"sample:{base}: expected one of {', '.join(SAMPLES)}, found {base!r}; name one of them")
    values: dict[str, int] = {}
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key not in LIMITS:
            raise UserError(f"sample:{base}: expected parameters {', '.join(LIMITS)}, found {key!r}; leave it out")
        try:
            values[key] = int(text)
        except ValueError:
            raise UserError(f"sample:{base}: expected a whole number for {key}, found {text!r}; change it") from None
    return TabletopSequence(replace(TabletopConfig(), **values))

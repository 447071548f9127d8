"""The embedded sample: a rendered table-top sequence that needs no download."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from urllib.parse import parse_qsl

import numpy as np

from ..errors import UserError
from ..frame import Frame, Intrinsics
from ..truth import FrameTruth, TrueObject
from .camera import ColorCamera, develop
from .paths import OrbitConfig, Sway, hand_held
from .render import Cast, Renderer
from .sensor import DepthSensor, measure
from .silhouettes import Silhouettes
from .world import CLASSES, MAX_OBJECTS, build_world

RATE = 30.0  # Hz
KEPT_CASTS = 4  # of about 5 MB; the truth of a frame then costs no second cast
LIMITS = {"seed": (0, 2**31 - 1), "objects": (1, MAX_OBJECTS), "frames": (1, 3000), "width": (64, 1280)}


@dataclass(frozen=True, slots=True)
class TabletopConfig:
    """What to render.

    Attributes:
        seed: of the scene, the path and the noise.
        objects: number of things of the sample's classes on the table; clutter comes on top.
        frames: length of the sequence; a longer one begins with the same frames.
        width: pixels, even; images are 4:3 with the field of view of f = 525 at 640 x 480.
        orbit: how the camera moves.
        sensor: the depth sensor.
        camera: the colour camera.

    Raises:
        UserError: a number outside its limits.
    """

    seed: int = 0
    objects: int = 12
    frames: int = 150
    width: int = 640
    orbit: OrbitConfig = field(default_factory=OrbitConfig)
    sensor: DepthSensor = field(default_factory=DepthSensor)
    camera: ColorCamera = field(default_factory=ColorCamera)

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UserError(f"sample:tabletop: expected {name} from {low} to {high}, found {value}; change it")
        if self.width % 4:
            raise UserError(f"sample:tabletop: expected a width divisible by 4, found {self.width}; change it")


class TabletopSequence:
    """Mugs, bowls, cans and more on a table, seen by a hand-held depth camera. See `Sequence` and `HasTruth`.

    A frame is rendered when it is asked for and depends on the configuration and its index only. World axes: z up,
    floor at z = 0. `poses` are ground truth; `gravity` is None, so that up has to be estimated.

    Attributes:
        clutter: things on the table that belong to none of `classes`; they are not in `objects`.
    """

    def __init__(self, config: TabletopConfig = TabletopConfig()) -> None:
        self.config = config
        self.name = "sample:tabletop" + _changed(config)
        scale = config.width / 640.0
        self.intrinsics = Intrinsics(
            config.width, config.width * 3 // 4, 525.0 * scale, 525.0 * scale, 320.0 * scale - 0.5, 240.0 * scale - 0.5
        )
        self.stamps = np.arange(config.frames) / RATE
        self.names = tuple(f"frame-{index:06d}" for index in range(config.frames))
        self.poses = hand_held(self.stamps, config.seed, config.orbit)
        self.gravity = None
        world = build_world(config.seed, config.objects)
        self.objects: tuple[TrueObject, ...] = world.objects
        self.clutter: tuple[TrueObject, ...] = world.clutter
        self.classes: tuple[str, ...] = CLASSES
        self._renderer = Renderer(world.surfaces)
        self._silhouettes = Silhouettes(world.objects, world.surfaces)
        exposure = Sway(np.random.default_rng([config.seed, 2]), 1, config.camera.drift_band)(self.stamps)[0]
        self._exposure = np.exp(config.camera.drift * exposure)
        self._casts: dict[int, Cast] = {}

    def __len__(self) -> int:
        return len(self.stamps)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        index = self._checked(index)
        rendering = self._renderer.render(self.intrinsics, self.poses[index], self._cast(index))
        sensor, camera, seed = self.config.sensor, self.config.camera, self.config.seed
        return Frame(
            index=index,
            name=self.names[index],
            stamp=float(self.stamps[index]),
            color=develop(
                rendering.radiance, float(self._exposure[index]), camera, np.random.default_rng([seed, 3, index])
            ),
            depth=measure(
                rendering.depth, rendering.incidence, self.intrinsics, sensor, np.random.default_rng([seed, 4, index])
            ),
            intrinsics=self.intrinsics,
            T_world_camera=self.poses[index].copy(),
        )

    def __reduce__(self):
        """Pickle the recipe: ray casters cannot be sent to another process."""
        return TabletopSequence, (self.config,)

    def truth(self, index: int) -> FrameTruth:
        """What can be seen of every object; exact for the rendered geometry."""
        index = self._checked(index)
        return self._silhouettes.measure(self.intrinsics, self.poses[index], self._cast(index))

    def instances(self, index: int) -> np.ndarray:
        """(H, W) int32: `id` of the object or clutter that every pixel shows, -1 for the room."""
        seen = self._silhouettes.instances(self._cast(self._checked(index)))
        return seen.reshape(self.intrinsics.height, self.intrinsics.width)

    def true_depth(self, index: int) -> np.ndarray:
        """(H, W) float32 metres along z without the sensor's effects."""
        index = self._checked(index)
        return self._renderer.render(self.intrinsics, self.poses[index], self._cast(index)).depth

    def _checked(self, index: int) -> int:
        if not -len(self) <= index < len(self):
            raise IndexError(f"{self.name} has {len(self)} frames, asked for {index}")
        return index % len(self)

    def _cast(self, index: int) -> Cast:
        cast = self._casts.get(index)
        if cast is None:
            cast = self._casts[index] = self._renderer.cast(self.intrinsics, self.poses[index])
            for old in list(self._casts)[:-KEPT_CASTS]:
                self._casts.pop(old, None)
        return cast


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

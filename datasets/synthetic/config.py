"""What to render: a preset and everything that can be changed about it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from ..errors import UserError
from .rendering.camera import ColorCamera
from .rendering.sensor import DepthSensor


class Preset(StrEnum):
    """Scenes with their camera paths."""

    TABLETOP = "tabletop"  # hand-held orbit about a table, as in RGB-D Scenes v2
    SURVEY = "survey"  # way points on an arc, one every 5 degrees, as in the UBC Visual Robot Survey
    KITCHEN = "kitchen"  # a walk through two rooms
    LAPS = "laps"  # the same rooms again and again, for loop closure and long-run growth
    WALL = "wall"  # along a wall with prints and nothing else, whose depth does not tell how the camera moves along it


class ClutterLevel(StrEnum):
    """How much stands around and before the objects."""

    LOW = "low"
    MEDIUM = "medium"
    HIGH = "high"


DEFAULT_OBJECTS = {Preset.TABLETOP: 12, Preset.SURVEY: 12, Preset.KITCHEN: 24, Preset.LAPS: 24, Preset.WALL: 0}
DEFAULT_FRAMES = {Preset.TABLETOP: 300, Preset.SURVEY: 37, Preset.KITCHEN: 900, Preset.LAPS: 3600, Preset.WALL: 200}
LIMITS = {"seed": (0, 2**31 - 1), "objects": (1, 100), "frames": (1, 20000), "width": (64, 1280), "blur": (0, 16)}
FASTEST = 8.0  # times the usual pace: the hand, up to 1.6 Hz, then shakes with less than half the frame rate


@dataclass(frozen=True, slots=True)
class SyntheticConfig:
    """What to render.

    Attributes:
        preset: scene and path.
        objects: number of things of the synthetic classes (imported meshes among them); None for the preset's.
            Before the wall stands nothing, clutter neither.
        clutter: how much else stands there, and how closely.
        seed: of the scene, the path and the noise.
        frames: length of the sequence; None for the preset's. A longer one begins with the same frames.
        width: pixels, divisible by 4; images are 4:3 with the field of view of f = 525 at 640 x 480.
        meshes: folder of textured OBJ or GLB scans that take part as objects, or None.
        blur: renderings averaged over the exposure for motion blur; 0 or 1 for none. The survey's camera stands still.
        pace: how many times as fast as usual the camera goes along its path, the hand's shake with it; stamps stay as
            they are. The survey's camera stands still.
        sensor: the depth sensor.
        camera: the colour camera.

    Raises:
        UserError: a number outside its limits, or something that the preset cannot have.
    """

    preset: Preset = Preset.TABLETOP
    objects: int | None = None
    clutter: ClutterLevel = ClutterLevel.MEDIUM
    seed: int = 0
    frames: int | None = None
    width: int = 640
    meshes: Path | None = None
    blur: int = 0
    pace: float = 1.0
    sensor: DepthSensor = field(default_factory=DepthSensor)
    camera: ColorCamera = field(default_factory=ColorCamera)

    def __post_init__(self) -> None:
        self._refuse_what_the_preset_has_not()
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if value is None or (name == "objects" and value == DEFAULT_OBJECTS[self.preset]):
                continue
            if not low <= value <= high:
                raise UserError(f"synth:{self.preset}: expected {name} from {low} to {high}, found {value}; change it")
        if not 0.0 < self.pace <= FASTEST:
            expected = f"pace above 0 and up to {FASTEST:g}"
            raise UserError(f"synth:{self.preset}: expected {expected}, found {self.pace}; change it")
        if self.width % 4:
            raise UserError(f"synth:{self.preset}: expected a width divisible by 4, found {self.width}; change it")

    def _refuse_what_the_preset_has_not(self) -> None:
        still, bare = self.preset is Preset.SURVEY, self.preset is Preset.WALL
        for why, name, is_refused in (
            ("its camera stands still", "blur", still and self.blur > 1),
            ("its camera stands still", "pace", still and self.pace != 1.0),
            ("nothing stands before its wall", "objects", bare and bool(self.objects)),
            ("nothing stands before its wall", "meshes", bare and self.meshes is not None),
        ):
            if is_refused:
                raise UserError(f"synth:{self.preset}: {why}, found {name} {getattr(self, name)}; leave it out")

    @property
    def object_count(self) -> int:
        """Objects to place."""
        return DEFAULT_OBJECTS[self.preset] if self.objects is None else self.objects

    @property
    def frame_count(self) -> int:
        """Frames to render."""
        return DEFAULT_FRAMES[self.preset] if self.frames is None else self.frames

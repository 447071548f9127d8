"""The frozen suite: which scenes are mapped, and by which mappers; it changes only with the evaluator's `VERSION`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.mapper.config import MapperConfig, OdometrySource

PRESETS = (Preset.TABLETOP, Preset.SURVEY, Preset.KITCHEN, Preset.LAPS)
FIRST_SEED = 1000  # far from the seeds that anything was tried or tuned on
SEEDS = {Preset.TABLETOP: 2, Preset.SURVEY: 5, Preset.KITCHEN: 1, Preset.LAPS: 1}  # scenes of each clutter level
FRAMES = {Preset.TABLETOP: 300, Preset.SURVEY: 37, Preset.KITCHEN: 900, Preset.LAPS: 1800}
SNAPSHOTS = {Preset.SURVEY: (2, 3, 4, 5, 6, 7, 10, 12)}  # maps on the way, for the protocols of Meger et al.


@dataclass(frozen=True, slots=True)
class Scene:
    """One rendered sequence of the suite."""

    preset: Preset
    clutter: ClutterLevel
    seed: int
    frames: int

    @property
    def name(self) -> str:
        """Such as "tabletop-high-1002"; also its folder's name, so it says whatever the rendering depends on."""
        return f"{self.preset}-{self.clutter}-{self.seed}-{self.frames}"

    @property
    def config(self) -> SyntheticConfig:
        """What to render."""
        return SyntheticConfig(preset=self.preset, clutter=self.clutter, seed=self.seed, frames=self.frames)


@dataclass(frozen=True, slots=True)
class Variant:
    """A mapper of the suite.

    Attributes:
        name: short, stable.
        title: for people.
        section, key, value: of the configuration, what differs from the default; the section is empty for nothing.
        presets: where it is measured.
    """

    name: str
    title: str
    section: str = ""
    key: str = ""
    value: Any = None
    presets: tuple[Preset, ...] = (Preset.TABLETOP, Preset.SURVEY, Preset.KITCHEN)

    @property
    def config(self) -> MapperConfig:
        """Of the mapper."""
        whole = MapperConfig()
        if not self.section:
            return whole
        return replace(whole, **{self.section: replace(getattr(whole, self.section), **{self.key: self.value})})


WHOLE = Variant("full", "whole", presets=PRESETS)
VARIANTS = (
    WHOLE,
    Variant("poses", "whole, poses given", "odometry", "source", OdometrySource.POSES, PRESETS),
    Variant("no-occlusion", "without occlusion weighting", "evidence", "occlusion", False),
    Variant("no-misses", "without missed-detection evidence", "evidence", "misses", False),
    Variant("no-coupling", "without class-size coupling", "beliefs", "size_coupling", False),
    Variant("independent", "without the joint graph: each object by itself", "smoother", "joint", False),
)


def scenes(presets: tuple[Preset, ...], seeds: int | None = None, frames: int | None = None) -> list[Scene]:
    """The scenes of these presets.

    Args:
        presets: which.
        seeds: at most so many scenes of each preset and clutter level; None for the suite's own number.
        frames: at most so many frames each; None for the suite's own.
    """
    return [
        Scene(preset, clutter, FIRST_SEED + k, min(FRAMES[preset], frames or FRAMES[preset]))
        for preset in presets
        for clutter in ClutterLevel
        for k in range(min(SEEDS[preset], seeds or SEEDS[preset]))
    ]

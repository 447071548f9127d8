"""One tiny scene for the HOG benchmarks, and how tests read their tables."""

from __future__ import annotations

from suite import Scene

from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig

FRAMES, SEED = 6, 5
SCENE = Scene(Preset.TABLETOP, ClutterLevel.LOW, SEED, FRAMES)
CONFIG = SyntheticConfig(Preset.TABLETOP, objects=10, clutter=ClutterLevel.LOW, seed=SEED, frames=FRAMES, width=320)


def cells(table: str) -> list[list[str]]:
    """Of every line of a Markdown table; the first and the last are empty."""
    return [[cell.strip() for cell in line.split("|")] for line in table.split("\n")]

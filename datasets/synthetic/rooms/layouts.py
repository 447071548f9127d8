"""The scenes of the presets, without the things that stand in them."""

from __future__ import annotations

import numpy as np

from ..config import Preset
from ..materials import textures
from ..materials.finishes import BIRCH
from ..rendering.render import Lights
from .furniture import Piece, top_of
from .layout import Layout, SupportKind
from .room import CABINET, CABINET_AT, ROOM, TABLE_HEIGHT, TABLE_TOP, room
from .storage import open_shelf
from .survey_room import survey_room
from .two_rooms import two_rooms
from .wall_room import wall_room


def build_layout(preset: Preset, rng: np.random.Generator) -> Layout:
    """Rooms, furniture, supports and lights; what differs between seeds is drawn from `rng`."""
    match preset:
        case Preset.TABLETOP:
            return tabletop(rng)
        case Preset.SURVEY:
            return survey_room(rng)
        case Preset.KITCHEN | Preset.LAPS:
            return two_rooms(rng)
        case Preset.WALL:
            return wall_room(rng)


def tabletop(rng: np.random.Generator) -> Layout:
    """The room of the sample, with a low shelf more; things stand on the table first."""
    parts = room(rng)
    wide, deep, high = CABINET
    table = Piece((), (top_of(SupportKind.TABLE, TABLE_TOP[:2], TABLE_HEIGHT),))
    cabinet = Piece((), (top_of(SupportKind.COUNTER, (wide, deep), high, edge=0.04),)).placed(*CABINET_AT, np.pi / 2)
    shelf = open_shelf(textures.wood(rng, *BIRCH), (1.2, 0.36), (0.08, 0.44, 0.80))
    seen = Piece(shelf.parts, tuple(s for s in shelf.supports if s.height > 0.3))  # the table hides what is lower
    pieces = [table, seen.placed(-0.15, ROOM[1] / 2 - 0.20), cabinet]
    parts += [part for piece in pieces for part in piece.parts]
    return Layout(tuple(parts), tuple(support for piece in pieces for support in piece.supports), Lights())

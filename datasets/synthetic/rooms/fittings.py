"""What is built into a kitchen: a counter with sink and hob, cupboards, a refrigerator. Pieces as in `furniture.py`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..materials import prints
from ..mesh import Mesh, box, face, lathe, merged, rotation_z, tube
from ..things.objects import Part, arc
from .furniture import Piece
from .layout import Support, SupportKind

HEIGHT = 0.90  # metres, of the worktop
DEPTH = 0.60  # metres
SLAB = 0.04  # metres, thickness of the worktop
SINK = (0.50, 0.38, 0.16)  # metres, width, depth and depth of the basin
HOB = (0.58, 0.50)  # metres


@dataclass(frozen=True, slots=True, eq=False)
class KitchenFinish:
    """Textures of everything built in."""

    fronts: np.ndarray
    worktop: np.ndarray
    steel: np.ndarray
    handles: np.ndarray
    hob: np.ndarray
    dark: np.ndarray


def counter(finish: KitchenFinish, width: float, sink_x: float, hob_x: float, headroom: float) -> Piece:
    """Cabinets below a worktop with a sink and, right of it, a hob over an oven; supports are the free parts of it."""
    front = -DEPTH / 2
    body = box((width, DEPTH - 0.02, HEIGHT - SLAB - 0.1), tile=1.0, faces="+x-x+y-y").moved((0.0, 0.01, 0.1))
    plinth = box((width, DEPTH - 0.08, 0.1)).moved((0.0, 0.04, 0.0))
    panels, handles = _doors(width, hob_x)
    oven = box((0.57, 0.02, 0.58)).moved((hob_x, front, 0.13))
    bar = box((0.44, 0.03, 0.018)).moved((hob_x, front - 0.03, 0.64))
    knobs = [_knob().moved((hob_x + 0.09 * k, front - 0.012, 0.78)) for k in (-2, -1, 0, 1, 2)]
    plate = box((*HOB, 0.006)).moved((hob_x, 0.0, HEIGHT))
    return Piece(
        (
            Part(merged([body, plinth]), finish.fronts, 0.05),
            Part(merged(panels), finish.fronts, 0.12, 20.0),
            Part(merged([*handles, bar, *knobs]), finish.handles, 0.4),
            Part(merged(_worktop(width, sink_x)), finish.worktop, 0.2, 30.0),
            Part(merged(_sink(sink_x)), finish.steel, 0.35, 20.0),
            Part(oven, finish.dark, 0.4, 40.0),
            Part(plate, finish.hob, 0.4, 40.0),
        ),
        _free_parts(width, sink_x, hob_x, headroom),
    )


def _doors(width: float, hob_x: float) -> tuple[list[Mesh], list[Mesh]]:
    """Fronts and handles of the cabinets: a drawer over a door, but not where the oven is."""
    count = round(width / 0.5)
    pitch = width / count
    front = -DEPTH / 2 - 0.002
    panels, handles = [], []
    high = HEIGHT - SLAB - 0.01
    for k in range(count):
        x = (k + 0.5) * pitch - width / 2
        if abs(x - hob_x) < (0.57 + pitch) / 2:
            panels.append(box((pitch - 0.008, 0.02, high - 0.72), tile=0.9).moved((x, front, 0.72)))
            continue
        for low, top in ((0.12, 0.69), (0.70, high)):
            panels.append(box((pitch - 0.008, 0.02, top - low), tile=0.9).moved((x, front, low)))
            handles.append(box((0.14, 0.022, 0.012)).moved((x, front - 0.025, top - 0.05)))
    return panels, handles


def _knob() -> Mesh:
    """A round knob that looks towards -y."""
    return lathe([(0.018, 0.0), (0.016, 0.022), (0.0, 0.022)], 20).turned(
        np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    )


def _worktop(width: float, sink_x: float) -> list[Mesh]:
    """A slab with a hole for the sink; it juts out a little."""
    depth, low, high = DEPTH + 0.02, sink_x - SINK[0] / 2, sink_x + SINK[0] / 2
    strip = (depth - SINK[1]) / 2
    spans = ((-width / 2, low, 0.0, depth), (high, width / 2, 0.0, depth))
    strips = ((low, high, (SINK[1] + strip) / 2, strip), (low, high, -(SINK[1] + strip) / 2, strip))
    return [
        box((end - start, deep, SLAB), tile=0.8).moved(((start + end) / 2, y - 0.01, HEIGHT - SLAB))
        for start, end, y, deep in (*spans, *strips)
    ]


def _sink(x: float) -> list[Mesh]:
    """Basin, its rim, and a tap behind it."""
    basin = box(SINK, faces="+x-x+y-y-z").moved((x, -0.01, HEIGHT - SINK[2]))
    rims = [box((SINK[0] + 0.03, 0.02, 0.004)).moved((x, -0.01 + s * SINK[1] / 2, HEIGHT)) for s in (-1, 1)]
    rims += [box((0.02, SINK[1], 0.004)).moved((x + s * SINK[0] / 2, -0.01, HEIGHT)) for s in (-1, 1)]
    bend = arc((0.09, 0.22), (0.09, 0.07), 180, 15, 14)
    neck = tube(np.vstack([[(0.0, 0.0), (0.0, 0.12)], bend]), 0.012).turned(rotation_z(-np.pi / 2))
    foot = lathe([(0.026, 0.0), (0.024, 0.03), (0.0, 0.03)], 24)
    return [basin, *rims, *(part.moved((x, DEPTH / 2 - 0.07, HEIGHT)) for part in (neck, foot))]


def _free_parts(width: float, sink_x: float, hob_x: float, headroom: float) -> tuple[Support, ...]:
    """Stretches of the worktop beside sink and hob, the largest first."""
    cuts = [-width / 2 + 0.03, sink_x - SINK[0] / 2 - 0.04, sink_x + SINK[0] / 2 + 0.04]
    cuts += [hob_x - HOB[0] / 2 - 0.03, hob_x + HOB[0] / 2 + 0.03, width / 2 - 0.03]
    spans = [(low, high) for low, high in zip(cuts[::2], cuts[1::2], strict=True) if high - low > 0.25]
    spans.sort(key=lambda span: span[0] - span[1])
    depth = DEPTH - 0.05
    return tuple(
        Support(SupportKind.COUNTER, ((low + high) / 2, 0.0), (high - low, depth), 0.0, HEIGHT, headroom)
        for low, high in spans
    )


def cupboards(finish: KitchenFinish, width: float, bottom: float, height: float) -> Piece:
    """Closed cupboards on the wall, 0.33 m deep; their back is at y = 0."""
    depth = 0.33
    body = box((width, depth - 0.02, height), tile=1.0).moved((0.0, -depth / 2 + 0.01, bottom))
    count = round(width / 0.45)
    pitch = width / count
    doors, handles = [], []
    for k in range(count):
        x = (k + 0.5) * pitch - width / 2
        doors.append(box((pitch - 0.008, 0.02, height - 0.01), tile=0.9).moved((x, -depth + 0.01, bottom + 0.005)))
        hand = 1 if k % 2 else -1
        handles.append(box((0.012, 0.022, 0.14)).moved((x - hand * (pitch / 2 - 0.05), -depth - 0.01, bottom + 0.05)))
    return Piece(
        (
            Part(body, finish.fronts, 0.05),
            Part(merged(doors), finish.fronts, 0.12, 20.0),
            Part(merged(handles), finish.handles, 0.4),
        )
    )


def refrigerator(rng: np.random.Generator, enamel: np.ndarray, finish: KitchenFinish) -> Piece:
    """0.6 m wide, 1.75 m high, with notes stuck to its doors."""
    width, depth, height = 0.60, 0.60, 1.75
    body = box((width, depth, height)).moved((0.0, 0.03, 0.0))
    doors = [
        box((width - 0.004, 0.05, top - low)).moved((0.0, -depth / 2, low)) for low, top in ((0.05, 1.13), (1.14, 1.74))
    ]
    handles = [box((0.02, 0.035, 0.30)).moved((-width / 2 + 0.06, -depth / 2 - 0.042, z)) for z in (0.78, 1.20)]
    parts = [Part(merged([body, *doors]), enamel, 0.3, 30.0), Part(merged(handles), finish.handles, 0.4)]
    for x, z in ((0.02, 1.42), (0.17, 1.30), (-0.05, 0.80), (0.14, 0.70)):
        note = face((rng.uniform(0.09, 0.14), 0.0, rng.uniform(0.10, 0.17)), "-y")
        parts.append(Part(note.moved((x, -depth / 2 - 0.0265, z)), prints.poster(rng), 0.05))
    return Piece(tuple(parts))

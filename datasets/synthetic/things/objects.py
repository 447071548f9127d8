"""The table-top things: one builder a class, sizes as household things have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..materials import prints, textures
from ..mesh import Mesh, box, lathe, merged, rotation_z, sheet, tube


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A mesh of one material.

    Attributes:
        mesh: the surface.
        texture: (H, W, 3) uint8, see `textures`.
        gloss: strength of the highlight, 0 (matt) to about 0.6 (glazed).
        sharpness: Blinn-Phong exponent of the highlight.
    """

    mesh: Mesh
    texture: np.ndarray
    gloss: float = 0.0
    sharpness: float = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A thing standing on z = 0 with its bounding box centred on the z axis.

    Attributes:
        label: class name.
        parts: its surfaces.
        size: (3,) full extents along its own axes, metres.
    """

    label: str
    parts: tuple[Part, ...]
    size: np.ndarray


def standing(label: str, parts: list[Part]) -> Model:
    """Centre the parts on the z axis and put them on z = 0."""
    points = np.concatenate([part.mesh.vertices for part in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    shift = -np.array([(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2]])
    moved = tuple(Part(p.mesh.moved(shift), p.texture, p.gloss, p.sharpness) for p in parts)
    return Model(label, moved, high - low)


def arc(centre: tuple[float, float], radii: tuple[float, float], start: float, end: float, steps: int) -> np.ndarray:
    """(steps, 2) points of an ellipse's arc; angles in degrees."""
    angle = np.radians(np.linspace(start, end, steps))
    return np.stack([centre[0] + radii[0] * np.cos(angle), centre[1] + radii[1] * np.sin(angle)], axis=1)


def cup(rng: np.random.Generator) -> Model:
    """A mug with a handle towards +x."""
    r, h, wall = rng.uniform(0.037, 0.045), rng.uniform(0.085, 0.105), 0.004
    glaze = prints.mug_glaze(rng)
    inside = textures.plain(rng, prints.WHITE, 0.02)
    outer = np.vstack([arc((r - 0.008, 0.008), (0.008, 0.008), -80, 0, 5), [(r, 0.5 * h), (r, h - 0.002)]])
    rim = arc((r - wall / 2, h - 0.002), (wall / 2, 0.002), 0, 180, 6)
    inner = np.vstack([rim[-1], arc((r - wall - 0.012, 0.018), (0.012, 0.012), 0, -90, 6), (0.0, 0.006)])
    handle = tube(arc((r - wall / 2, 0.52 * h), (0.031, 0.33 * h), -90, 90, 18), rng.uniform(0.0045, 0.006))
    tint = glaze[10:74, 10:74]
    return standing(
        "cup",
        [
            Part(lathe(outer), glaze, 0.45, 60.0),
            Part(lathe(np.vstack([(0.0, 0.0), outer[0]])), inside),
            Part(merged([lathe(rim), lathe(inner)]), inside, 0.45, 60.0),
            Part(handle, tint, 0.45, 60.0),
        ],
    )


def bowl(rng: np.random.Generator) -> Model:
    """A round bowl on a foot."""
    r, h, wall = rng.uniform(0.062, 0.085), rng.uniform(0.05, 0.068), 0.005
    hue = prints.colour(rng, rng.uniform(0.1, 0.6), rng.uniform(0.7, 0.9))
    foot = [(0.0, 0.002), (0.38 * r, 0.002), (0.40 * r, 0.0), (0.45 * r, 0.0), (0.46 * r, 0.008)]
    outer = np.vstack([foot[-1], arc((0.40 * r, h), (0.6 * r, h - 0.008), -78, 0, 12)])
    rim = arc((r - wall / 2, h), (wall / 2, 0.002), 0, 180, 6)
    inner = np.vstack([arc((0.30 * r, h), (0.7 * r - wall, h - 0.013), 0, -90, 14), (0.0, 0.013)])
    outside = textures.plain(rng, hue, 0.04, 128)
    outside[24:40] = outside[48:54] = prints.colour(rng, 0.6, 0.45)
    lining = textures.plain(rng, prints.WHITE if rng.random() < 0.5 else hue, 0.03)
    return standing(
        "bowl",
        [
            Part(merged([lathe(foot), lathe(rim)]), lining, 0.4, 50.0),
            Part(lathe(outer, 64), outside, 0.4, 50.0),
            Part(lathe(inner, 64), lining, 0.4, 50.0),
        ],
    )


def soda_can(rng: np.random.Generator) -> Model:
    """The 330 ml can."""
    h = rng.uniform(0.115, 0.123)
    metal = textures.plain(rng, (186, 188, 192), 0.03)
    return standing("soda can", can(0.033, h, prints.can_label(rng), metal))


def can(r: float, h: float, wrap: np.ndarray, metal: np.ndarray) -> list[Part]:
    """A beverage can of radius `r` and height `h`, metres."""
    s = r / 0.033
    bottom = [(0.0, 0.006), (0.022 * s, 0.001), (0.025 * s, 0.0), (0.028 * s, 0.002), (r, 0.011)]
    shoulder = [(r, h - 0.016), (0.031 * s, h - 0.010), (0.027 * s, h - 0.003)]
    lid = [(0.027 * s, h - 0.003), (0.0275 * s, h), (0.026 * s, h), (0.0255 * s, h - 0.004), (0.0, h - 0.004)]
    tab = box((0.022, 0.012, 0.002)).moved((0.006, 0.0, h - 0.004))
    return [
        Part(lathe([bottom[-1], shoulder[0]]), wrap, 0.35, 35.0),
        Part(merged([lathe(bottom), lathe(shoulder), lathe(lid), tab]), metal, 0.5, 35.0),
    ]


def bottle(rng: np.random.Generator) -> Model:
    """A coloured bottle with a paper label and a screw cap."""
    r, h = rng.uniform(0.032, 0.038), rng.uniform(0.22, 0.26)
    glass = textures.plain(rng, ((38, 84, 48), (92, 52, 24), (60, 104, 140))[int(rng.integers(3))], 0.03)
    low, high, neck = 0.22 * h, 0.52 * h, 0.012
    base = [(0.0, 0.003), (0.8 * r, 0.0), (0.95 * r, 0.003), (r, 0.012), (r, low)]
    t = np.linspace(0.0, 1.0, 12)
    ease = t * t * (3.0 - 2.0 * t)
    shoulder = np.stack([r + (neck - r) * ease, 0.60 * h + 0.22 * h * t], axis=1)
    top = np.vstack([(r, high), shoulder, (neck, h - 0.018)])
    lid = [(neck, h - 0.018), (0.0145, h - 0.017), (0.0145, h - 0.002), (0.013, h), (0.0, h)]
    return standing(
        "bottle",
        [
            Part(merged([lathe(base), lathe(top)]), glass, 0.6, 90.0),
            Part(lathe([(r, low), (r, high)]), prints.bottle_label(rng), 0.05),
            Part(lathe(lid), textures.plain(rng, prints.colour(rng, 0.7, 0.7)), 0.2),
        ],
    )


def cereal_box(rng: np.random.Generator) -> Model:
    """A carton; the front looks along x."""
    size = rng.uniform((0.05, 0.16, 0.23), (0.07, 0.195, 0.30))
    base, brand, name = prints.colour(rng, 0.8, 0.65), prints.pick(rng, prints.BRANDS), prints.pick(rng, prints.CEREALS)
    front = prints.cereal_front(rng, base, brand, name)
    return standing(
        "cereal box",
        [
            Part(box(size, faces="+x-x"), front, 0.1, 25.0),
            Part(box(size, faces="+y-y"), prints.cereal_side(rng, base, name), 0.1, 25.0),
            Part(box(size, faces="+z-z"), textures.plain(rng, base), 0.1, 25.0),
        ],
    )


def cap(rng: np.random.Generator) -> Model:
    """A baseball cap with its visor towards +x."""
    r, h = rng.uniform(0.082, 0.092), rng.uniform(0.10, 0.12)
    hue = prints.colour(rng, 0.7, rng.uniform(0.35, 0.7))
    cloth = textures.woven(rng, [hue])
    panels = np.concatenate([cloth, cloth], axis=1)
    for seam in range(6):
        middle = int((seam + 0.5) / 6 * 512)
        panels[:, middle - 2 : middle + 2] //= 2
    prints.write(panels, prints.pick(rng, prints.BRANDS), (0.5, 0.62), 0.16, prints.WHITE, prints.FONTS[1])
    crown = np.vstack([(r, 0.0), (r, 0.02), arc((0.0, 0.035), (r, h - 0.037), 0, 90, 14)[1:]])
    button = arc((0.0, h - 0.004), (0.008, 0.005), 0, 90, 5)
    return standing(
        "cap",
        [
            Part(lathe(crown, 60).turned(rotation_z(np.pi)), panels),
            Part(lathe(button, 16), cloth),
            Part(visor(r), textures.plain(rng, hue, 0.05)),
        ],
    )


def visor(r: float) -> Mesh:
    """The peak: widest in front, bent down at the sides, 3 mm thick."""
    angle = np.radians(np.linspace(-68.0, 68.0, 25))
    reach = 0.068 * np.cos(angle * 90.0 / 70.0) ** 0.7
    out = np.linspace(-0.004, 1.0, 8)[:, None] * reach
    x, y = (r - 0.003 + out) * np.cos(angle), (r - 0.003 + out) * np.sin(angle)
    upper = np.stack([x, y, 0.005 + 0.020 * (1.0 - (y / r) ** 2) - 0.10 * out], axis=-1)
    lower = upper - np.array([0.0, 0.0, 0.003])
    edge = np.stack([lower[-1], upper[-1]])
    return merged([sheet(upper), sheet(lower.transpose(1, 0, 2)), sheet(edge.transpose(1, 0, 2))])


BUILDERS: dict[str, Callable[[np.random.Generator], Model]] = {
    "cup": cup,
    "bowl": bowl,
    "bottle": bottle,
    "soda can": soda_can,
    "cereal box": cereal_box,
    "cap": cap,
}

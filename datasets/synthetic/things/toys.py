"""Toys, of no class: blocks, balls, cars, ducks, rings on a peg."""

from __future__ import annotations

import numpy as np

from ..materials import prints, textures
from ..mesh import Mesh, box, lathe, merged, rotation_z, sheet
from .objects import Model, Part, arc, standing

PLASTIC = (0.35, 45.0)  # gloss and sharpness
Z_TO_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
# Outlines of a car's body, side windows and what stands out of the body as screens; x and z as shares of its length
SALOON = (
    np.array([(0.02, 0.07), (0.98, 0.07), (0.97, 0.22), (0.70, 0.24), (0.58, 0.36), (0.26, 0.36), (0.02, 0.24)]),
    np.array([(0.64, 0.25), (0.57, 0.335), (0.29, 0.335), (0.18, 0.25)]),
    np.array([(0.698, 0.25), (0.603, 0.345), (0.218, 0.345), (0.038, 0.255)]),
)
VAN = (
    np.array([(0.02, 0.07), (0.98, 0.07), (0.97, 0.30), (0.82, 0.42), (0.10, 0.42), (0.02, 0.24)]),
    np.array([(0.80, 0.27), (0.74, 0.385), (0.14, 0.385), (0.14, 0.27)]),
    np.array([(0.96, 0.315), (0.848, 0.405), (0.083, 0.40), (0.038, 0.30)]),
)


def toy(rng: np.random.Generator) -> Model:
    """One of the toys."""
    return (_blocks, _ball, _car, _duck, _rings)[int(rng.integers(5))](rng)


def _blocks(rng: np.random.Generator) -> Model:
    """Lettered cubes: a tower, or some side by side with one on top."""
    side = rng.uniform(0.034, 0.048)
    cube = box((side, side, side))
    if rng.random() < 0.4:
        places = [(0.0, 0.0, k * side) for k in range(int(rng.integers(3, 5)))]
    else:
        row = int(rng.integers(2, 4))
        places = [((k - (row - 1) / 2) * 1.25 * side, 0.0, 0.0) for k in range(row)]
        places.append(((0.5 - row % 2 / 2) * 0.3 * side, 0.0, side))
    parts = []
    for x, y, z in places:
        mesh = cube.turned(rotation_z(rng.uniform(-0.11, 0.11))).moved((x, y + rng.normal(0.0, 0.002), z))
        parts.append(Part(mesh, prints.letter(rng, prints.pick(rng, tuple("ABCDEFGHKMRST")))))
    return standing("toy", parts)


def _ball(rng: np.random.Generator) -> Model:
    """A ball with coloured sectors or a band."""
    r = rng.uniform(0.032, 0.06)
    image = textures.plain(rng, prints.colour(rng, 0.8, 0.85), 0.02, 128).repeat(2, axis=1)
    second = prints.WHITE if rng.random() < 0.5 else prints.colour(rng, 0.8, 0.8)
    if rng.random() < 0.6:
        image[:, np.arange(256) * 6 // 256 % 2 == 0] = second
    else:
        image[48:80] = second
    tilt = rng.uniform(0.3, 1.2)
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return standing("toy", [Part(ellipsoid((r, r, r)).turned(turn), image, *PLASTIC)])


def _car(rng: np.random.Generator) -> Model:
    """A car or van that drives along x."""
    length = rng.uniform(0.10, 0.16)
    width, wheel = 0.44 * length, 0.095 * length
    outline, sides, screens = VAN if rng.random() < 0.4 else SALOON
    paint = textures.plain(rng, prints.colour(rng, 0.85, rng.uniform(0.5, 0.9)), 0.02)
    tyre = lathe([(0.0, 0.0), (wheel, 0.0), (wheel, 0.1 * length), (0.0, 0.1 * length)], 24).turned(Z_TO_Y)
    hub = lathe([(0.0, 0.0), (0.55 * wheel, 0.0), (0.55 * wheel, 0.106 * length), (0.0, 0.106 * length)], 16)
    spots = [
        (x * length, s * (width / 2 - 0.04 * length) - 0.05 * length, wheel) for x in (0.21, 0.79) for s in (-1, 1)
    ]
    hubs = [hub.turned(Z_TO_Y).moved((x, y - 0.003 * length, z)) for x, y, z in spots]
    glass = [prism(sides * length, width + 0.002), prism(screens * length, 0.82 * width)]
    return standing(
        "toy",
        [
            Part(prism(outline * length, width), paint, *PLASTIC),
            Part(merged(glass), textures.plain(rng, (46, 56, 66), 0.03), 0.5, 60.0),
            Part(merged([tyre.moved(spot) for spot in spots]), textures.plain(rng, (32, 32, 34), 0.05)),
            Part(merged(hubs), textures.plain(rng, (188, 190, 194), 0.03), 0.3),
        ],
    )


def _duck(rng: np.random.Generator) -> Model:
    """A bath duck that looks along x."""
    s = rng.uniform(0.8, 1.25)
    hue = (238, 196, 40) if rng.random() < 0.6 else prints.colour(rng, 0.7, 0.9)
    body = ellipsoid((0.045 * s, 0.034 * s, 0.030 * s)).moved((0.0, 0.0, 0.028 * s))
    head = ellipsoid((0.024 * s, 0.022 * s, 0.022 * s)).moved((0.022 * s, 0.0, 0.068 * s))
    tail = ellipsoid((0.022 * s, 0.012 * s, 0.009 * s)).turned(_pitched(0.6)).moved((-0.043 * s, 0.0, 0.042 * s))
    wings = [
        ellipsoid((0.026 * s, 0.007 * s, 0.015 * s)).moved((-0.008 * s, k * 0.031 * s, 0.034 * s)) for k in (-1, 1)
    ]
    beak = ellipsoid((0.014 * s, 0.012 * s, 0.0045 * s)).moved((0.047 * s, 0.0, 0.064 * s))
    eye = ellipsoid((0.0034 * s, 0.0034 * s, 0.0038 * s))
    eyes = [eye.moved((0.038 * s, k * 0.0125 * s, 0.075 * s)) for k in (-1, 1)]
    return standing(
        "toy",
        [
            Part(merged([body, head, tail, *wings]), textures.plain(rng, hue, 0.02), *PLASTIC),
            Part(beak, textures.plain(rng, (226, 96, 30), 0.02), *PLASTIC),
            Part(merged(eyes), textures.plain(rng, (25, 24, 24), 0.02), *PLASTIC),
        ],
    )


def _rings(rng: np.random.Generator) -> Model:
    """Rings of falling size on a peg."""
    count, thick = int(rng.integers(4, 6)), 0.020
    parts = []
    for k in range(count):
        reach = 0.050 - 0.007 * k
        bulge = arc((reach - thick / 2, thick / 2), (thick / 2, thick / 2), -90, 90, 9)
        ring = lathe(np.vstack([(0.0, 0.0), bulge, (0.0, thick)])).moved((0.0, 0.0, k * thick))
        parts.append(Part(ring, textures.plain(rng, prints.colour(rng, 0.8, 0.85), 0.02), *PLASTIC))
    knob = ellipsoid((0.013, 0.013, 0.013)).moved((0.0, 0.0, count * thick + 0.008))
    return standing("toy", [*parts, Part(knob, textures.plain(rng, prints.colour(rng, 0.8, 0.8), 0.02), *PLASTIC)])


def ellipsoid(radii: tuple[float, float, float]) -> Mesh:
    """An ellipsoid about the origin; half axes in metres."""
    ball = lathe(arc((0.0, 0.0), (1.0, 1.0), -90, 90, 17), 32)
    scale = np.array(radii)
    normals = ball.vertices / scale
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(ball.vertices * scale, normals, ball.uv, ball.triangles)


def prism(outline: np.ndarray, width: float) -> Mesh:
    """A counter-clockwise (M, 2) outline in x and z, convex but for slight bends, `width` metres thick along y."""
    closed = np.vstack([outline, outline[:1]])
    near, far = (np.insert(closed, 1, side * width / 2, axis=1) for side in (-1, 1))
    walls = [sheet(np.array([[far[k], near[k]], [far[k + 1], near[k + 1]]])) for k in range(len(outline))]
    return merged([*walls, _lid(near, -1.0), _lid(far[::-1], 1.0)])


def _lid(ring: np.ndarray, side: float) -> Mesh:
    """A fan about the centre of a closed (M + 1, 3) ring, looking along `side` times y."""
    points = np.vstack([ring, ring[:-1].mean(axis=0)])
    k = np.arange(len(ring) - 1)
    fan = np.stack([np.full(len(k), len(ring)), k, k + 1], axis=1)
    uv = (points[:, [0, 2]] - points[:, [0, 2]].min(axis=0)) / np.ptp(points[:, 0])
    return Mesh(points, np.tile((0.0, side, 0.0), (len(points), 1)), uv, fan)


def _pitched(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

"""Flashlights, lying on their side or standing on the lens."""

from __future__ import annotations

import numpy as np

from ..materials import prints, textures
from ..mesh import Mesh, box, lathe, merged, rotation_z
from .objects import Model, Part, standing

# Radius of the body, radius of the head, length (metres), share of the length that is head
KINDS = (
    (0.0135, 0.0165, 0.15, 0.2),
    (0.0165, 0.027, 0.2, 0.24),
    (0.0195, 0.03, 0.165, 0.34),
    (0.022, 0.026, 0.125, 0.4),
)
UPRIGHT = 0.3  # share that stands on the lens
SHELLS = ((34, 34, 38), (60, 62, 68), (150, 152, 158), (206, 168, 30), (176, 40, 36), (36, 70, 140), (70, 96, 50))
METAL = (0.3, 40.0)  # gloss and sharpness


def flashlight(rng: np.random.Generator) -> Model:
    """A flashlight with its lens towards +x, or downwards when it stands."""
    kind = KINDS[int(rng.integers(len(KINDS)))]
    r, head, length = np.array(kind[:3]) * rng.uniform(0.93, 1.07, 3)
    shell = SHELLS[int(rng.integers(len(SHELLS)))]
    upright = _parts(rng, float(r), float(head), float(length), kind[3], shell)
    if rng.random() < UPRIGHT:
        turn = np.diag([1.0, -1.0, -1.0])
    else:  # laid along x so that both the tail and the ring about the lens touch the ground, the button above
        slope = np.arctan((1.05 * head - r) / (length - 0.014))
        turn = _rotation_y(np.pi / 2.0 - slope) @ rotation_z(np.pi + rng.uniform(-0.6, 0.6))
    return standing("flashlight", [Part(p.mesh.turned(turn), p.texture, p.gloss, p.sharpness) for p in upright])


def _parts(
    rng: np.random.Generator, r: float, head: float, length: float, share: float, shell: textures.Colour
) -> list[Part]:
    """Upright, the lens above."""
    neck, flare, glass = length * (1.0 - share), length * (1.0 - 0.45 * share), 0.9 * head
    tail = lathe([(0.0, 0.0), (0.85 * r, 0.0), (r, 0.003), (r, 0.022)])
    front = lathe([(r, neck), (1.06 * r, neck + 0.002), (head, flare), (head, length - 0.012)])
    ring = lathe([(head, length - 0.012), (1.05 * head, length - 0.011), (1.05 * head, length), (glass, length)])
    mirror = lathe([(glass, length), (0.25 * head, length - 0.6 * head), (0.0, length - 0.6 * head)])
    button = box((0.008, 0.012, 0.022)).moved((r, 0.0, neck - 0.030))
    dark_trim = sum(shell) > 250 or rng.random() < 0.5
    trim = textures.plain(rng, prints.INK if dark_trim else (172, 174, 178), 0.03)
    return [
        Part(_sideways(lathe([(r, 0.022), (r, neck)])), _grip(rng, shell), *METAL),
        Part(front, textures.plain(rng, shell, 0.03), *METAL),
        Part(merged([tail, ring]), trim, *METAL),
        Part(mirror, textures.plain(rng, (226, 228, 220), 0.02), 0.6, 50.0),
        Part(button, textures.plain(rng, prints.colour(rng, 0.8, 0.7)), 0.1),
    ]


def _grip(rng: np.random.Generator, shell: textures.Colour) -> np.ndarray:
    """The barrel, tail on the left: knurled, ribbed or smooth, and a brand."""
    image = textures.plain(rng, shell, 0.03, 256)
    y, x = np.mgrid[:256, :256]
    groove = (((x + y) % 8 < 3) | ((x - y) % 8 < 3), x % 16 < 6, np.zeros_like(x, bool))[int(rng.integers(3))]
    groove &= (x > 40) & (x < 140)
    image[groove] = image[groove] // 5 * 3
    ink = prints.WHITE if sum(shell) < 400 else prints.INK
    prints.write(image, prints.pick(rng, prints.BRANDS), (0.75, 0.5), 0.25, ink)
    return image


def _sideways(mesh: Mesh) -> Mesh:
    """The texture turned by a quarter, so that words run along the barrel."""
    return Mesh(mesh.vertices, mesh.normals, np.stack([mesh.uv[:, 1], 1.0 - mesh.uv[:, 0]], axis=1), mesh.triangles)


def _rotation_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

"""Bottles of several outlines."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..materials import prints, textures, wraps
from ..mesh import Mesh, lathe, merged
from .objects import Model, Part, standing

# Outline: height and radius as shares of the whole, and where the label begins and ends.
OUTLINES = {
    "shoulders": (((0.0, 0.92), (0.02, 1.0), (0.60, 1.0), (0.66, 0.97), (0.82, 0.40), (0.93, 0.36)), (0.18, 0.52)),
    "waisted": (((0.0, 0.9), (0.04, 1.0), (0.22, 1.0), (0.4, 0.8), (0.58, 1), (0.66, 0.98), (0.9, 0.36)), (0.5, 0.66)),
    "long neck": (((0.0, 0.94), (0.02, 1.0), (0.52, 1.0), (0.62, 0.85), (0.74, 0.40), (0.96, 0.34)), (0.12, 0.44)),
    "sloping": (((0.0, 0.95), (0.03, 1.0), (0.40, 1.0), (0.62, 0.74), (0.80, 0.44), (0.93, 0.40)), (0.10, 0.36)),
    "wide": (((0.0, 0.93), (0.03, 1.0), (0.68, 1.0), (0.76, 0.90), (0.84, 0.62), (0.90, 0.60)), (0.16, 0.60)),
}  # fmt: skip
SIZES = {  # metres: radius, height
    "shoulders": (0.035, 0.24), "waisted": (0.035, 0.235), "long neck": (0.032, 0.235),
    "sloping": (0.036, 0.285), "wide": (0.038, 0.20),
}  # fmt: skip
GLASS = ((38, 84, 48), (92, 52, 24), (60, 104, 140), (150, 170, 165), (170, 60, 50), (225, 222, 214))


def bottle(rng: np.random.Generator) -> Model:
    """A bottle of glass or plastic with a label and a cap; plastic ones may be flattened."""
    kind = tuple(OUTLINES)[int(rng.integers(len(OUTLINES)))]
    points, label = OUTLINES[kind]
    r, h = np.array(SIZES[kind]) * rng.uniform(0.93, 1.07, 2)
    share, width = np.array(points).T
    curve = PchipInterpolator(share * h, width * r)
    low, high, top = label[0] * h, label[1] * h, float(share[-1]) * h
    base = [(0.0, 0.003), (0.8 * r * width[0], 0.0), (r * width[0], 0.0)]
    below, between, above = (_along(curve, a, b) for a, b in ((0.001, low), (low, high), (high, top)))
    neck = float(curve(top))
    lid = [(neck, top), (neck + 0.002, top), (neck + 0.002, h - 0.002), (neck, h), (0.0, h)]
    flatten = rng.uniform(0.62, 0.8) if kind == "wide" and rng.random() < 0.6 else 1.0
    glass = textures.plain(rng, GLASS[int(rng.integers(len(GLASS)))], 0.03)
    body = merged([lathe(np.vstack([base, below])), lathe(above)])
    stopper = textures.plain(rng, prints.colour(rng, rng.uniform(0.0, 0.9), rng.uniform(0.2, 0.9)))
    return standing(
        "bottle",
        [
            Part(_flattened(body, flatten), glass, 0.6, 90.0),
            Part(_flattened(lathe(between), flatten), wraps.paper_label(rng), 0.08),
            Part(_flattened(lathe(lid), flatten), stopper, 0.2),
        ],
    )


def _along(curve: PchipInterpolator, start: float, end: float) -> np.ndarray:
    """(16, 2) radius and height of the outline between two heights."""
    z = np.linspace(start, end, 16)
    return np.stack([curve(z), z], axis=1)


def _flattened(mesh: Mesh, factor: float) -> Mesh:
    """Pressed together along x."""
    squeeze = np.array([factor, 1.0, 1.0])
    normals = mesh.normals / squeeze
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(mesh.vertices * squeeze, normals, mesh.uv, mesh.triangles)

"""Boxes of no class: parcels, small cartons, tissue boxes."""

from __future__ import annotations

import cv2
import numpy as np

from ..materials import prints, textures, wraps
from ..mesh import Mesh, box, sheet
from .groceries import printed_box
from .objects import Model, Part, standing


def parcel(rng: np.random.Generator) -> Model:
    """A cardboard box closed with tape."""
    size = rng.uniform((0.12, 0.15, 0.07), (0.19, 0.24, 0.18))
    shade = rng.uniform(0.8, 1.1)
    brown = textures.plain(rng, (int(176 * shade), int(136 * shade), int(92 * shade)), 0.05, 256)
    lid = brown.copy()
    lid[112:144] = (206, 184, 140)
    side = brown.copy()
    side[:44, 112:144] = (206, 184, 140)
    label = (int(rng.integers(20, 60)), int(rng.integers(90, 120)))
    cv2.rectangle(side, label, (label[0] + 120, label[1] + 80), prints.WHITE, -1)
    area = (label[0] / 256 + 0.03, label[1] / 256 + 0.04, label[0] / 256 + 0.44, label[1] / 256 + 0.2)
    prints.small_print(rng, side, area, prints.INK)
    for k in range(18):
        bar = label[0] + 8 + 6 * k
        cv2.rectangle(side, (bar, label[1] + 54), (bar + int(rng.integers(1, 5)), label[1] + 74), prints.INK, -1)
    faces = ((side, "+x-x"), (brown, "+y-y"), (lid, "+z-z"))
    return standing("box", [Part(box(size, faces=names), picture) for picture, names in faces])


def carton(rng: np.random.Generator) -> Model:
    """Tea, rice or pasta: a small printed box, upright or lying on its back."""
    size = rng.uniform((0.04, 0.08, 0.11), (0.07, 0.13, 0.2))
    base = prints.colour(rng, rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.9))
    front = wraps.paper_label(rng)[:, :256]
    front[-70:] = base
    front[:24] = base
    parts = printed_box(size, front, textures.plain(rng, base), textures.plain(rng, base))
    if rng.random() < 0.35:
        turn = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
        parts = [Part(p.mesh.turned(turn), p.texture, p.gloss, p.sharpness) for p in parts]
    return standing("box", parts)


def tissue_box(rng: np.random.Generator) -> Model:
    """A flat box or a cube with a tissue that stands out of its slot."""
    flat = rng.random() < 0.6
    size = np.array((0.12, 0.23, 0.075) if flat else (0.115, 0.115, 0.125)) * rng.uniform(0.94, 1.06, 3)
    base = prints.colour(rng, rng.uniform(0.2, 0.6), rng.uniform(0.6, 0.95))
    pattern = textures.plain(rng, base, 0.03, 256)
    for column, row in rng.integers(0, 256, (26, 2)):
        petal = prints.colour(rng, 0.5, 0.9)
        for angle in range(0, 360, 72):
            cv2.ellipse(pattern, (int(column), int(row)), (18, 7), angle, 0, 360, petal, -1, cv2.LINE_AA)
        cv2.circle(pattern, (int(column), int(row)), 5, (240, 200, 70), -1, cv2.LINE_AA)
    lid = pattern.copy()
    cv2.ellipse(lid, (128, 128), (46, 74) if flat else (60, 60), 0, 0, 360, (52, 50, 50), -1, cv2.LINE_AA)
    tissue = Part(_tissue(rng).moved((0.0, 0.0, size[2] - 0.002)), textures.plain(rng, (248, 248, 248), 0.02))
    return standing(
        "tissue box", [Part(box(size, faces="+x-x+y-y"), pattern), Part(box(size, faces="+z-z"), lid), tissue]
    )


def _tissue(rng: np.random.Generator) -> Mesh:
    """A crumpled sheet, wide above."""
    rise, across = np.linspace(0.0, 1.0, 12)[:, None], np.linspace(-1.0, 1.0, 25)[None, :]
    phase = rng.uniform(0.0, 6.0, 2)
    y = (0.030 + 0.022 * rise) * across
    x = 0.016 * rise * np.sin(5.0 * across + phase[0]) + 0.010 * rise * across
    z = rise * (0.055 + 0.012 * np.sin(4.0 * across + phase[1]))
    return sheet(np.stack([x, y, z], axis=-1))

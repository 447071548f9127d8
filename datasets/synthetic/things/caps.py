"""Baseball caps."""

from __future__ import annotations

import cv2
import numpy as np

from ..materials import prints, textures
from ..mesh import lathe, rotation_z
from .objects import Model, Part, arc, standing, visor

HEIGHT, WIDTH = 256, 512  # texels of the crown; its front is in the middle


def cap(rng: np.random.Generator) -> Model:
    """A cap with its visor towards +x: flat or high crown, one colour, panels or a contrasting visor."""
    r, h = rng.uniform(0.080, 0.093), rng.uniform(0.092, 0.135)
    main = prints.colour(rng, rng.uniform(0.1, 0.8), rng.uniform(0.2, 0.85))
    second = prints.colour(rng, rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.9))
    peak = main if rng.random() < 0.5 else second
    wall = rng.uniform(0.2, 0.45) * h  # the part of the crown that stands up
    crown = np.vstack([(r, 0.0), arc((0.0, wall), (r, h - 0.003 - wall), 0, 90, 16)])
    button = arc((0.0, h - 0.005), (0.008, 0.005), 0, 90, 5)
    cloth = _crown(rng, main, second)
    return standing(
        "cap",
        [
            Part(lathe(crown, 60).turned(rotation_z(np.pi)), cloth),
            Part(lathe(button, 16), textures.plain(rng, peak, 0.05)),
            Part(visor(r), textures.plain(rng, peak, 0.06)),
        ],
    )


def _crown(rng: np.random.Generator, main: textures.Colour, second: textures.Colour) -> np.ndarray:
    """Six seamed panels with a badge or a word in front."""
    cloth = textures.woven(rng, [main])
    image = np.concatenate([cloth, cloth], axis=1)
    style = int(rng.integers(4))
    x = np.arange(WIDTH)
    if style == 0:  # coloured back
        image[:, np.abs(x - WIDTH // 2) > WIDTH // 6] = second
    elif style == 1:  # panels by turns
        image[:, ((x + WIDTH // 12) * 6 // WIDTH) % 2 == 0] = second
    elif style == 2:  # a band around
        image[188:214] = second
    for seam in range(6):
        middle = int((seam + 0.5) / 6 * WIDTH)
        image[:, middle - 2 : middle + 2] //= 2
    ink = prints.WHITE if sum(main) < 380 else prints.INK
    if rng.random() < 0.5:
        cv2.ellipse(image, (WIDTH // 2, 166), (46, 42), 0, 0, 360, second, -1, cv2.LINE_AA)
        cv2.ellipse(image, (WIDTH // 2, 166), (46, 42), 0, 0, 360, ink, 3, cv2.LINE_AA)
        prints.write(image, prints.pick(rng, prints.BRANDS)[0], (0.5, 0.65), 0.08, ink, prints.FONTS[1])
    else:
        prints.write(image, prints.pick(rng, prints.BRANDS), (0.5, 0.65), 0.22, ink, prints.FONTS[1])
    return image

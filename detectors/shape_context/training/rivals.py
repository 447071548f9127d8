"""Descriptors of things that are none of the classes, from proposals of background frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..codebook import Codebook
from ..config import LENGTH
from ..scoring import Rivals
from .config import TrainConfig
from .scenes import Scene


def learn_rivals(scenes: Sequence[Scene], classes: int, codebooks: Sequence[Codebook], config: TrainConfig) -> Rivals:
    """For every radius of the codebooks at most `config.rivals` descriptors, spread evenly over the scenes' proposals.

    Args:
        scenes: with what is none of the classes.
        classes: number of them.
        codebooks: of the classes.
        config: the numbers.

    Returns:
        None at all where the scenes show nothing else.
    """
    scale_of = {book.radius: book.depth for book in codebooks}
    found = {radius: _contexts(scenes, classes, radius, scale) for radius, scale in scale_of.items()}
    if not all(map(len, found.values())):
        return {}
    return {radius: _spread(array, config.rivals) for radius, array in found.items()}


def _contexts(scenes: Sequence[Scene], background: int, radius: float, scale: float) -> np.ndarray:
    """(n, LENGTH) shape contexts of a radius, of the proposals that show none of the classes."""
    parts = []
    for scene in scenes:
        contexts = scene.described.contexts(radius, scale)
        of_none = scene.shows[scene.described.samples.owner] == background
        parts.append(contexts[of_none & contexts.any(axis=1)])
    return np.concatenate([np.zeros((0, LENGTH), np.float32), *parts])


def _spread(array: np.ndarray, most: int) -> np.ndarray:
    """At most so many rows, evenly."""
    return array[np.linspace(0, len(array) - 1, min(most, len(array))).round().astype(int)]

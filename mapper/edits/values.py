"""What people give with an edit, checked; each function raises `UserError` where it is no such value."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...datasets.errors import UserError


def text_of(name: str, value: str) -> str:
    """A text that is not empty, its words one blank apart."""
    text = " ".join(value.split())
    if not text:
        raise UserError(f"{name} is empty; give one")
    return text


def vector_of(name: str, value: Iterable[float]) -> np.ndarray:
    """(3,) finite, metres."""
    try:
        vector = np.array([float(x) for x in value])
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise UserError(f"{name}: expected three finite numbers, metres, found {value!r}")
    return vector


def stds_of(value: float | Iterable[float]) -> np.ndarray:
    """(3,) metres above 0, from three or from one that stands for all."""
    stds = vector_of("std", [value] * 3 if isinstance(value, int | float) else value)
    if not np.all(stds > 0.0):
        raise UserError(f"std {stds.tolist()}: give metres above 0; nothing is known exactly")
    return stds

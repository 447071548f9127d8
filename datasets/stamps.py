"""Pairing of measurements by their stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .errors import InputError
from .tables import read_table

# A Kinect's accelerometer reports at 500 Hz and more; a reading 0.05 s away is of another moment of a hand's motion.
MAX_FORCE_DIFFERENCE = 0.05  # s
# float64 resolves 2e-7 s near 1e9 s: a difference that is written as exactly the bound must count.
_ROUNDING = 1e-6  # s


def associate(a: np.ndarray, b: np.ndarray, max_difference: float) -> np.ndarray:
    """Pairs of stamps, one to one: the closest pair first, then the closest of what is left, and so on.

    Args:
        a: (N,) seconds, in any order.
        b: (M,) seconds, in any order.
        max_difference: seconds; pairs further apart are not made.

    Returns:
        (P, 2) indices into `a` and `b`, sorted by the stamp in `a`.
    """
    order = np.argsort(b, kind="stable")
    sorted_b = b[order]
    first = np.searchsorted(sorted_b, a - max_difference - _ROUNDING)
    count = np.searchsorted(sorted_b, a + max_difference + _ROUNDING, side="right") - first
    left = np.repeat(np.arange(len(a)), count)
    right = order[np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)]
    taken_a, taken_b = np.zeros(len(a), dtype=bool), np.zeros(len(b), dtype=bool)
    pairs = []
    for k in np.argsort(np.abs(a[left] - b[right]), kind="stable"):
        i, j = left[k], right[k]
        if not taken_a[i] and not taken_b[j]:
            taken_a[i] = taken_b[j] = True
            pairs.append((i, j))
    pairs.sort(key=lambda pair: a[pair[0]])
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def nearest(stamps: np.ndarray, of: np.ndarray, max_difference: float) -> np.ndarray:
    """(M,) index of the stamp in sorted `of` nearest to each of `stamps`, -1 where none is within `max_difference`."""
    if len(of) == 0:
        return np.full(len(stamps), -1, dtype=np.intp)
    high = np.clip(np.searchsorted(of, stamps), 0, len(of) - 1)
    low = np.clip(high - 1, 0, None)
    index = np.where(np.abs(of[low] - stamps) <= np.abs(of[high] - stamps), low, high)
    return np.where(np.abs(of[index] - stamps) <= max_difference + _ROUNDING, index, -1)


def read_specific_force(path: Path, stamps: np.ndarray) -> np.ndarray | None:
    """(N, 3) accelerometer reading nearest to each stamp, in the file's axes, m/s^2; NaN where none is near.

    Args:
        path: file with rows `stamp ax ay az`; rows of NaN or zeros are no readings.
        stamps: (N,) seconds.

    Returns:
        None where there is no such file or it holds no reading.

    Raises:
        InputError: the file cannot be read as such rows, or its readings are nowhere near 9.81 m/s^2.
    """
    if not path.is_file():
        return None
    table = read_table(path, "stamp ax ay az")
    table = table[np.isfinite(table).all(axis=1) & table[:, 1:].any(axis=1)]
    table = table[np.argsort(table[:, 0], kind="stable")]
    if len(table) == 0:
        return None
    length = float(np.median(np.linalg.norm(table[:, 1:], axis=1)))
    if not 5.0 < length < 15.0:
        remedy = "convert to m/s^2, gravity included (1 g is 9.81 m/s^2)"
        raise InputError(path, "readings in m/s^2, of length 9.81 at rest", f"a median length of {length:.3g}", remedy)
    index = nearest(stamps, table[:, 0], MAX_FORCE_DIFFERENCE)
    return np.where((index >= 0)[:, None], table[index, 1:], np.nan)

"""The uncertainty of pairs of boxes as one fixed, even lattice of draws: the same question has the same answer."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from .relation_boxes import Pairs

DRAWS = 1024  # shares of them are within 0.01 of the integral (root mean square), 0.03 at worst, in 9 dimensions
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23)


class Drawn(NamedTuple):
    """P pairs of boxes as compiled code takes them; it makes DRAWS of each out of the same normal draws.

    Attributes:
        normal: (DRAWS, 9) standard normal: for the offset (x, y, height), the first's size, the second's.
        mean: (P, 3) centre of the first in the axes of the second, metres.
        root: (P, 3, 3) lower triangular, root root' its covariance. The height comes last: given the draws of x and y
            its mean is moved by root[2, 0] n0 + root[2, 1] n1, its standard deviation is root[2, 2].
        turn: (P, 2) cosine and sine of the yaw of the first there.
        first, second: (P, 3) sizes, metres.
        first_std, second_std: (P, 3) their standard deviations.
    """

    normal: np.ndarray
    mean: np.ndarray
    root: np.ndarray
    turn: np.ndarray
    first: np.ndarray
    second: np.ndarray
    first_std: np.ndarray
    second_std: np.ndarray


def draw(pairs: Pairs) -> Drawn:
    """What compiled code needs of `pairs`."""
    root = np.linalg.cholesky(pairs.covariance)
    return Drawn(normal_draws(), pairs.mean, root, pairs.turn, *pairs.sizes, *pairs.size_stds)


@cache
def normal_draws() -> np.ndarray:
    """(DRAWS, 9) standard normal draws.

    Multiples of the roots of primes modulo 1 fill the unit cube evenly (Richtmyer 1951); the inverse of the normal
    distribution function takes them to where the probability is.
    """
    from scipy.special import ndtri

    number = np.arange(DRAWS)[:, None]
    return ndtri((number * np.sqrt(PRIMES) + 0.5) % 1.0)

"""Rooms, stages and the same graphs solved by other means, for all tests of estimation.

`rooms`, `stages`, `whole_graph` and `lives` are beside this file; tests may import them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rooms import EXACT, KINECT, Room, look_at
from stages import PATIENT, Stage, Thing
from whole_graph import estimate, ledger_factors, optimise, solve_batch

from thingmap.factors.size_prior import ClassSizePriors


def make_priors(means: np.ndarray, sigmas: np.ndarray | Sequence[float]) -> ClassSizePriors:
    """`means` (K + 1, 3), first "not an object"; `sigmas` (K + 1,) or (K + 1, 3) log units.

    Anything is like no object.
    """
    means, sigmas = np.asarray(means, dtype=float), np.asarray(sigmas, dtype=float)
    spread = np.broadcast_to(sigmas.reshape(len(means), -1), means.shape)
    names, covariances = tuple("abcdefgh"[: len(means) - 1]), np.array([np.diag(row**2) for row in spread])
    rows = [*range(len(means)), 0]
    return ClassSizePriors(names, means[rows], covariances[rows], np.ones(len(names), bool))


class Tools:
    """What most tests share; a class, so that it needs no import."""

    kinect = KINECT
    patient = PATIENT
    exact = EXACT
    Room = Room
    Stage = Stage
    Thing = Thing
    look_at = staticmethod(look_at)
    ledger_factors = staticmethod(ledger_factors)
    estimate = staticmethod(estimate)
    optimise = staticmethod(optimise)
    solve_batch = staticmethod(solve_batch)
    make_priors = staticmethod(make_priors)


@pytest.fixture(scope="session")
def tools() -> type[Tools]:
    """`Room`, `look_at`, `solve_batch` and the like."""
    return Tools


@pytest.fixture
def two_views() -> Callable[..., Room]:
    """`two_views(*objects, **kwargs)`: two cameras at 2 m, 40 degrees apart, looking at the origin."""

    def make(*objects: Sequence[float], **kwargs) -> Room:
        return Room.seen_from([(2.0, 0.0, 0.3), (1.5, 1.3, 0.3)], *(objects or [(0.0, 0.0, 0.0)]), **kwargs)

    return make

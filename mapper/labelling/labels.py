"""What minimising an energy found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Labelling:
    """A label for each node.

    Attributes:
        labels: (N,) int32 in [0, L).
        energy: E of them, nats.
        sweeps: over all labels (alpha-expansion) or all nodes (mean field).
        settled: whether it ended by itself, not by its limit of sweeps.
    """

    labels: np.ndarray
    energy: float
    sweeps: int
    settled: bool

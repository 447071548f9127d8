"""Evidence from seeing through a volume (Meger et al., Clutter, section III-C).

The free ratio of a view is the share of the volume's unoccluded pixels whose depth lies behind it. For an object it is
near zero up to sensor error and the volume's misfit (half-normal, as in the paper); where there is none, the box may
still lie on some surface, so its density is a mixture of the object's and a uniform one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """Densities of the free ratio.

    Attributes:
        sigma: half-normal scale for objects; 0.3 because an ellipsoid is not the object: handles, slats and corners.
        uniform: share of the uniform part where there is no object.
        max_ratio: bound on one view's evidence, nats.
    """

    sigma: float = 0.3
    uniform: float = 0.5
    max_ratio: float = 3.0

    def log_ratio(self, free: np.ndarray) -> np.ndarray:
        """(N,) free ratios in [0, 1] to (N,) nats for being an object."""
        there = np.exp(-0.5 * (free / self.sigma) ** 2) * np.sqrt(2.0 / np.pi) / self.sigma
        none = self.uniform + (1.0 - self.uniform) * there
        return np.clip(np.log(there + 1e-9) - np.log(none), -self.max_ratio, self.max_ratio)

"""Evidence from seeing through a volume (Meger et al., Clutter, section III-C).

The free ratio of a view is the share of the volume's pixels whose depth lies behind it, among those that are not
occluded (Explicit Occlusion, section 2.2: what is occluded says nothing). For an object it is
near zero up to sensor error and the volume's misfit (half-normal, as in the paper). Where there is no object, the
volume is either as empty as chance has it (uniform) or, from every side alike, filled by some surface that looks like
an object to the depth camera. Which of the two is one fact about the place and not one a view, so a surface speaks for
an object only once:

    S = Σ_t w_t log N+(free_t; 0, σ),   evidence = S - log(u + (1 - u) e^S)  <=  -log(1 - u)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """Densities of the free ratio.

    Attributes:
        sigma: half-normal scale for objects; 0.3 because an ellipsoid is not the object: handles, slats and corners.
        uniform: u, share of places without an object that are empty.
        bound: one view says at most this, nats.
    """

    sigma: float = 0.3
    uniform: float = 0.5
    bound: float = 3.0

    def log_likelihood(self, free: np.ndarray) -> np.ndarray:
        """(N,) free ratios in [0, 1] of one view to (N,) log densities if there is an object, nats."""
        density = np.log(np.sqrt(2.0 / np.pi) / self.sigma) - 0.5 * (free / self.sigma) ** 2
        return np.maximum(density, -self.bound)

    def evidence(self, total: float) -> float:
        """Nats for being an object, from the weighted sum of its views' log likelihoods."""
        return float(total - np.logaddexp(np.log(self.uniform), np.log1p(-self.uniform) + total))

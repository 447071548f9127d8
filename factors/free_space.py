"""Evidence from seeing through a volume (Meger et al., Clutter, section III-C).

The free ratio of a view is the share of the volume's pixels whose depth lies behind it, among those that are not
occluded (Explicit Occlusion, section 2.2: what is occluded says nothing). For an object it is near zero up to sensor
error and the volume's misfit (half-normal, as in the paper). Where there is no object, the volume is either as empty as
chance has it (uniform) or, from every side alike, filled by some surface that looks like an object to the depth camera.
Which of the two is one fact about the place and not one a view, so a surface speaks for an object only once
(`existence.py`).

That something which was there *has been taken away* is another question. A chair has gaps, and a volume that is too
large shows free pixels for ever: what an object's views usually have is no sign of its absence, only what exceeds it
is. Where it was, one now sees what stood behind it, some of which still lies within the volume's far side:

    log p(free | removed) / p(free | there) = log Beta(free; a, 1) - log N+(max(free - usual, 0); 0, σ_excess)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_TINY = 1e-12  # a free ratio of zero, whose logarithm stays finite


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """Densities of the free ratio.

    Fitted to scenes of `synth:survey` (three levels of clutter, 27 in all), on objects at their true place and off it
    as a map is (10 mm on each axis, 9 % of each size), and on volumes on the empty table.

    Attributes:
        sigma: half-normal scale for objects, an ellipsoid being none of them: 0.14 at their true place, 0.18 to 0.19
            as a map has them.
        bound: one view says at most this, nats.
        excess_sigma: half-normal scale of what exceeds the usual. The root mean square is 0.08, but the tail is heavy:
            this is the scale of the 99th percentile, 0.33, since nothing that is there may be taken for gone.
        removed_shape: a of the density a free^(a - 1) once the object is gone. Maximum likelihood gives 3.6 and, on the
            second half of the scenes, 7.9; 3 leaves room for what may stand behind elsewhere.
    """

    sigma: float = 0.19
    bound: float = 3.0
    excess_sigma: float = 0.13
    removed_shape: float = 3.0

    def log_likelihood(self, free: np.ndarray) -> np.ndarray:
        """(N,) free ratios in [0, 1] of one view to (N,) log densities if there is an object, nats."""
        return np.maximum(_log_half_normal(free, self.sigma), -self.bound)

    def removed(self, free: np.ndarray, usual: np.ndarray | float) -> np.ndarray:
        """(N,) nats that one view says for "it has been taken away" against "it is still there", within +-`bound`.

        Args:
            free: (N,) free ratios in [0, 1] of the view, among what is not occluded.
            usual: (N,) or one for all; the object's free ratio in the views in which it was detected. A ratio below it
                counts as usual.
        """
        free = np.asarray(free, dtype=float)
        gone = np.log(self.removed_shape) + (self.removed_shape - 1.0) * np.log(np.maximum(free, _TINY))
        there = _log_half_normal(np.maximum(free - usual, 0.0), self.excess_sigma)
        return np.clip(gone - there, -self.bound, self.bound)


def _log_half_normal(x: np.ndarray, sigma: float) -> np.ndarray:
    return np.log(np.sqrt(2.0 / np.pi) / sigma) - 0.5 * (x / sigma) ** 2

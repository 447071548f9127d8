"""How far links between frames that were taken far apart can be trusted.

Before a plain cabinet, with frames 0.7 s and 0.2 m apart, features, depth and whole images all claimed millimetres, and
all were off by 14 to 20 mrad and 16 to 27 mm: a Kinect's distortions and a shutter that rolls do not show in residuals,
and from so few frames they do not average out. Measurements of one motion that are made independently tell: what they
disagree by beyond what they claim is the noise that neither knows of.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from ..config import LoopConfig, SparseConfig
from .rigid import pose_covariance, tangent

TAIL = (0.9, 1.645)  # share of absolute values, and how many deviations of a Gaussian they lie within


class SparseFrames:
    """Tells whether frames are far apart, and what covariance their links lack.

    Args:
        config: from when frames are far apart, and what is assumed before anything is compared.
    """

    def __init__(self, config: SparseConfig) -> None:
        self._config = config
        self._intervals: deque[float] = deque(maxlen=config.intervals)
        self._stamp: float | None = None
        # of rotations and translations: (deviation squared, variance claimed) along one direction each
        self._compared: tuple[deque[tuple[float, float]], ...] = (
            deque(maxlen=config.memory),
            deque(maxlen=config.memory),
        )

    def see(self, stamp: float) -> None:
        """The next frame's stamp, seconds."""
        if self._stamp is not None:
            self._intervals.append(stamp - self._stamp)
        self._stamp = stamp

    @property
    def far_apart(self) -> bool:
        """Whether the last frames were, in the median."""
        return bool(self._intervals) and float(np.median(self._intervals)) > self._config.interval

    def compare(self, T: np.ndarray, covariance: np.ndarray, T_other: np.ndarray, covariance_other: np.ndarray) -> None:
        """Two independent measurements of one motion: (4, 4), and (6, 6) in their right tangents.

        Directions that either leaves open tell nothing and are left out.
        """
        off, claimed = tangent(T, T_other), covariance + covariance_other
        for compared, block, limit in zip(self._compared, (slice(0, 3), slice(3, 6)), self._config.limit, strict=True):
            variances, directions = np.linalg.eigh(claimed[block, block])
            along = off[block] @ directions
            compared.extend((a * a, v) for a, v in zip(along, variances, strict=True) if v < limit**2)

    @property
    def doubtful(self) -> bool:
        """Whether links between the last frames lack noticeably much: then more of them are wanted."""
        return self._turn() > self._config.doubtful

    def reaching(self, loops: LoopConfig) -> LoopConfig:
        """With which keyframes one is matched by depth: with more of them, and farther ones, where links lack much."""
        if not self.doubtful:
            return loops
        c = self._config
        return replace(loops, ages=c.link_ages, skip=c.link_skip, reach=c.link_reach, known=c.link_known)

    def missing(self) -> np.ndarray:
        """(6, 6) to be added to the covariance of every link; zero where that is not `doubtful`."""
        if not self.doubtful:
            return np.zeros((6, 6))
        return pose_covariance((self._turn(), self._sigma(self._compared[1], self._config.prior[1])))

    def missing_of_step(self) -> np.ndarray:
        """(6, 6) to be added to a step of odometry, whose local model is of the same few frames."""
        return self._config.step_factor**2 * self.missing()

    def _turn(self) -> float:
        """Of rotations, rad: the better witness, since planes that leave a way open still hold those."""
        return self._sigma(self._compared[0], self._config.prior[0]) if self.far_apart else 0.0

    def _sigma(self, compared: deque[tuple[float, float]], prior: float) -> float:
        """Deviation that each of the two lacks, along one direction."""
        if not compared:
            return prior
        squared, claimed = np.array(compared).T
        # not from the median: what a few motions lack, which no residual shows, any other may lack too
        lacking = max(float(np.quantile(squared, TAIL[0])) / TAIL[1] ** 2 - float(np.median(claimed)), 0.0) / 2.0
        return float(np.sqrt(lacking))

"""What a landmark is and whether it is: class, existence, and whether it is still there.

Class 0 is "not an object"; existence is (1 - q_0) P(still there). How the kinds of evidence add up is in
`factors/existence.py`, how looks from one place are averaged in `view_cells.py`, how class and size agree in
`size_site.py`.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...factors.evidence_model import EvidenceModel
from ...factors.existence import Evidence
from ...factors.free_space import FreeSpace
from ...factors.score_model import ScoreEvidence
from ..config import BeliefConfig, PresenceConfig
from .presence import Presence
from .view_cells import UNKNOWN, ViewCells

_HITS, _MISSES, _FREE, _DEPTH, _FIRST = range(5)  # columns of the cells; then (K,) own and (K,) excess
_LOOKED_FOR, _SEEN, _SCORED = range(3)  # groups of columns: hits and misses, geometry, scores


class Belief:
    """Everything but geometry that is known about one landmark.

    Args:
        classes: K.
        model: how the kinds of evidence add up.
        config: which views are independent.
        presence: when a thing counts as taken away.
        free_space: what is seen through.
    """

    def __init__(
        self,
        classes: int,
        model: EvidenceModel,
        config: BeliefConfig = BeliefConfig(),  # noqa: B008
        presence: PresenceConfig = PresenceConfig(),  # noqa: B008
        free_space: FreeSpace = FreeSpace(),  # noqa: B008
    ) -> None:
        self._model, self._classes = model.existence, classes
        self._cells = ViewCells((2, 2, 2 * classes), config)
        self._presence = Presence(presence, free_space)
        self.log_z = np.zeros(classes + 1)
        self.update()

    def weight(self, object_to_camera: np.ndarray) -> float:
        """How much a look from (3,) metres off the object would add to the number of independent views, in [0, 1]."""
        return self._cells.find(object_to_camera)[1]

    def look(
        self,
        object_to_camera: np.ndarray,
        hits: float = 0.0,
        misses: float = 0.0,
        free: float = 0.0,
        depth: float = 0.0,
        seen: float = 0.0,
        scores: ScoreEvidence | None = None,
        keyframe: int = UNKNOWN,
    ) -> None:
        """What one look from (3,) metres off the object said.

        Args:
            hits: share of the templates that fired, of those that should have.
            misses: the rest, times how surely it should have been detected.
            free: log likelihood of the free ratio, and
            depth: log ratio of the depths, both times
            seen: the share of the volume that depth tells of.
            scores: of the detection; None without one, or where the object was too hidden to be recognised.
            keyframe: its number, by which the look is placed anew when poses are corrected.
        """
        K = self._classes
        said = np.zeros(_FIRST + 2 * K)
        said[:_FIRST] = hits, misses, free, depth
        scored = scores is not None and bool(scores.own.any() or scores.background.any())
        if scores is not None and scored:
            said[_FIRST : _FIRST + K], said[_FIRST + K :] = scores.own, scores.background - scores.own
        self._cells.add(object_to_camera, np.array([hits + misses, seen, float(scored)]), said, keyframe)

    def look_for(self, object_to_camera: np.ndarray, free: float, seen: float, detected: bool) -> None:
        """Whether it is still there; before `look` is told of the same view. See `Presence.look`."""
        cell, weight = self._cells.find(object_to_camera)
        self._presence.look(cell, weight, free, seen, detected)

    def place_anew(self, cameras: np.ndarray, position: np.ndarray) -> None:
        """Poses were corrected: (M, 3) centres of all keyframes and (3,) position of the object, world, metres.

        What was said from somewhere stays said from there, "still there" too: cells keep their numbers.
        """
        self._cells.place_anew(cameras, position)

    def forget(self, keyframes: Iterable[int]) -> None:
        """Takes back what these keyframes said by looking from somewhere new: they looked at the wrong place."""
        before = len(self._cells)
        self._cells.forget(keyframes)
        if len(self._cells) != before:
            self._presence.forget_places()

    def absorb(self, other: Belief) -> None:
        """Takes over the evidence of a landmark merged into this one."""
        self._cells.absorb(other._cells)
        self._presence.absorb(other._presence)

    @property
    def evidence(self) -> Evidence:
        """All that the looks said, as one row."""
        total, K = self._cells.totals()[None], self._classes
        return Evidence(
            own=total[:, _FIRST : _FIRST + K],
            excess=total[:, _FIRST + K :],
            score_views=self._cells.views()[None, _SCORED],
            hits=total[:, _HITS],
            misses=total[:, _MISSES],
            free=total[:, _FREE],
            depth=total[:, _DEPTH],
            log_size=self.log_z[None],
        )

    def log_belief(self) -> np.ndarray:
        """(K+1,) log prior and evidence without size, "not an object" first."""
        return self._model.log_belief(self.evidence)[0] - self._model.weight_size * self.log_z

    def log_ratio(self) -> np.ndarray:
        """(K,) log p(evidence without size | of class k) - log p(the same | no object), nats."""
        likelihood = self.log_belief() - self._model.log_prior(self._classes)
        return likelihood[1:] - likelihood[0]

    def update(self, log_z: np.ndarray | None = None) -> None:
        """Posterior from the evidence and the (given or last known) size evidence."""
        if log_z is not None:
            self.log_z = log_z
        x = self._model.log_belief(self.evidence)[0]
        e = np.exp(x - x.max())
        self.posterior = e / e.sum()

    @property
    def is_object(self) -> float:
        """P(it is an object, or was one before it was taken away)."""
        return float(1.0 - self.posterior[0])

    @property
    def existence(self) -> float:
        """P(it is an object and still there)."""
        return self.is_object * self._presence.probability

    @property
    def hits(self) -> float:
        """Independent views in which it was detected."""
        return float(self._cells.totals()[_HITS])

    @property
    def misses(self) -> float:
        """Independent views in which it should have been detected and was not."""
        return float(self._cells.totals()[_MISSES])

    @property
    def free(self) -> float:
        """Log likelihood of the free ratios, nats."""
        return float(self._cells.totals()[_FREE])

    @property
    def effective_views(self) -> float:
        """Independent views in which it was detected or should have been."""
        total = self._cells.totals()
        return float(total[_HITS] + total[_MISSES])

    def class_posterior(self) -> np.ndarray:
        """(K,) class probabilities given that it is an object."""
        conditional = self.posterior[1:]
        total = conditional.sum()
        return conditional / total if total > 0 else np.full(len(conditional), 1.0 / len(conditional))

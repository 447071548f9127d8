"""ISAM2, with factors that know whom they belong to, so that they can leave again."""

from __future__ import annotations

import gtsam
import numpy as np

from ..config import SmootherConfig

Owner = tuple[str, int]  # ("record", ledger number), ("site", landmark) or ("frozen", keyframe): whose factors
# changes of a step that are not passed on to the variables around; gtsam's 1e-3 stops corrections a millimetre early
WILDFIRE = 1e-5
SIZE_SHARE = 20.0  # log units a metre; sizes that hardly anything was measured of creep for many steps


class IncrementalGraph:
    """Factors and new variables queue up until `solve`.

    Attributes:
        isam: the solver, for reading.
        values: new variables that it does not know yet.
    """

    def __init__(self, config: SmootherConfig) -> None:
        self._thresholds = _thresholds(config)
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(self._thresholds)
        parameters.relinearizeSkip = config.relinearize_skip
        self.isam = gtsam.ISAM2(parameters)
        # holding this reference stops every custom factor call from copying all values (884 -> 15 us at 5000 variables)
        self.linearization_point = self.isam.getLinearizationPoint()
        self.values = gtsam.Values()
        self._queue: dict[Owner, list[gtsam.NonlinearFactor]] = {}
        self._index: dict[Owner, list[int]] = {}
        self._remove: list[int] = []

    @property
    def is_pending(self) -> bool:
        """Whether factors wait to enter or leave."""
        return bool(self._queue or self._remove)

    def queue(self, owner: Owner, factors: list[gtsam.NonlinearFactor]) -> None:
        """Factors that are to enter."""
        if factors:
            self._queue[owner] = factors

    def drop(self, owner: Owner) -> None:
        """Factors that are to leave, whether they have been solved or not."""
        self._queue.pop(owner, None)
        self._remove += self._index.pop(owner, [])

    def solve(self, values: gtsam.Values | None = None) -> None:
        """One step with all that is queued; `values` start the new variables (default: `self.values`).

        Raises:
            RuntimeError: the system is indeterminate. It destroys the solver; the queue stays as it was.
        """
        graph, owners = gtsam.NonlinearFactorGraph(), []
        for owner, factors in self._queue.items():
            for factor in factors:
                graph.add(factor)
                owners.append(owner)
        result = self.isam.update(graph, self.values if values is None else values, self._remove)
        for owner, index in zip(owners, result.getNewFactorsIndices(), strict=True):
            self._index.setdefault(owner, []).append(index)
        self._queue, self._remove, self.values = {}, [], gtsam.Values()

    def converge(self, steps: int, tolerance: float | None = None) -> bool:
        """Gauss-Newton steps until none moves anything by more than a tolerance.

        Args:
            steps: at most.
            tolerance: rad, m; `SIZE_SHARE` times as many log units; None for the configured thresholds.

        Returns:
            Whether that was reached.

        Raises:
            RuntimeError: as `solve`.
        """
        own = self.isam.params()  # the solver's own, not a copy
        if tolerance is not None:
            own.setRelinearizeThreshold(_uniform(tolerance))
            own.setOptimizationParams(_gauss_newton(WILDFIRE))
        try:
            return any(self._relinearize() == 0 for _ in range(steps))
        finally:
            own.setRelinearizeThreshold(self._thresholds)
            own.setOptimizationParams(gtsam.ISAM2GaussNewtonParams())

    def _relinearize(self) -> int:
        return self.isam.update(force_relinearize=True).getVariablesRelinearized()


def _thresholds(c: SmootherConfig) -> gtsam.ISAM2ThresholdMap:
    thresholds = gtsam.ISAM2ThresholdMap()
    for pose in "xf":
        thresholds.insert((pose, np.repeat([c.threshold_rotation, c.threshold_translation], 3)))
    thresholds.insert(("l", np.full(3, c.threshold_position)))
    thresholds.insert(("s", np.full(3, c.threshold_size)))
    thresholds.insert(("u", np.full(2, c.threshold_up)))
    return thresholds


def _uniform(tolerance: float) -> gtsam.ISAM2ThresholdMap:
    thresholds = gtsam.ISAM2ThresholdMap()
    for kind, dimension in zip("xflsu", (6, 6, 3, 3, 2), strict=True):
        thresholds.insert((kind, np.full(dimension, SIZE_SHARE * tolerance if kind == "s" else tolerance)))
    return thresholds


def _gauss_newton(wildfire: float) -> gtsam.ISAM2GaussNewtonParams:
    parameters = gtsam.ISAM2GaussNewtonParams()
    parameters.setWildfireThreshold(wildfire)
    return parameters

"""Where a graph that is made anew starts: at the last good value of every variable."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gtsam
import numpy as np
from gtsam.symbol_shorthand import F, L, S, X

from ...factors.odometry import pose3
from .incremental import IncrementalGraph
from .ledger import Ledger
from .live_records import LiveRecords
from .record_factors import UP
from .records import Motion, NewLandmark


def current_values(graph: IncrementalGraph) -> gtsam.Values:
    """The estimate of a graph; nothing where its solver is destroyed."""
    try:
        return graph.isam.calculateEstimate()
    except RuntimeError:
        return gtsam.Values()


def start_values(
    sources: Sequence[gtsam.Values], ledger: Ledger, live: LiveRecords, frozen: Mapping[int, gtsam.Pose3]
) -> gtsam.Values:
    """A finite value for every variable of the graph: from the first source that has one, else where it began."""
    start, motions = gtsam.Values(), {record.b: record for record in ledger if isinstance(record, Motion)}
    start.insert(UP, _finite(sources, UP, "atUnit3", gtsam.Unit3.point3))
    start.insert(X(0), _finite(sources, X(0), "atPose3", gtsam.Pose3.matrix))
    for motion in motions.values():
        pose = _finite(sources, X(motion.b), "atPose3", gtsam.Pose3.matrix)
        start.insert(X(motion.b), pose or start.atPose3(X(motion.a)).compose(pose3(motion.T_a_b)))
    for t, pose in frozen.items():
        start.insert(F(t), pose)
    for landmark, numbers in live.landmarks().items():
        first = ledger[numbers[0]]
        assert isinstance(first, NewLandmark)
        position = _finite(sources, L(landmark), "atPoint3", np.asarray)
        log_size = _finite(sources, S(landmark), "atVector", np.asarray)
        start.insertPoint3(L(landmark), first.position if position is None else position)
        start.insert(S(landmark), first.log_size if log_size is None else log_size)
    return start


def _finite(sources: Sequence[gtsam.Values], key: int, getter: str, numbers: Callable[[Any], np.ndarray]) -> Any:
    for values in sources:
        if values.exists(key):
            value = getattr(values, getter)(key)
            if np.all(np.isfinite(numbers(value))):
                return value
    return None

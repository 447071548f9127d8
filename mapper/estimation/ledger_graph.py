"""The graph of a ledger, kept solved: step by step, to convergence where loops close, anew where the solver breaks."""

from __future__ import annotations

import gtsam
import numpy as np
from gtsam.symbol_shorthand import F, X

from ...datasets.frame import Intrinsics
from ...factors.odometry import gauge_prior
from ..config import SmootherConfig
from ..map.upright import upright_rotation
from .estimates import Estimates
from .incremental import IncrementalGraph
from .ledger import Ledger
from .live_records import LiveRecords
from .rebuild import current_values, start_values
from .record_factors import UP, FactorContext, record_factors, site_factor
from .records import Record
from .size_site import SizeSite

REBUILD_STEPS = 10  # at most, Gauss-Newton steps after a rebuild, until nothing moves by more than the thresholds
CLOSING_STEPS = 10  # at most, when loops have changed; 30 cm and 10 degrees take about 6
CLOSED = 2e-3  # rad, m: what no step moves anything by once a loop is closed
SNAPSHOT_EVERY = 20  # updates between copies of the estimate from which a rebuild starts
FROZEN_SIGMAS = np.full(6, 1e-5)  # rad, m: of poses that objects are seen from but do not move


class LedgerGraph(Estimates):
    """Estimates from a ledger; what is put into it queues up until `update`."""

    def __init__(self, config: SmootherConfig, intrinsics: Intrinsics, upright_tolerance: float = 0.026) -> None:
        self._config, self.intrinsics, self._tolerance = config, intrinsics, upright_tolerance
        self.ledger = Ledger()
        self.sites: dict[int, SizeSite] = {}
        self.keyframes = 0
        self.rebuilds = 0
        self.R_world_upright = np.eye(3)
        self._updates = 0
        self._live = LiveRecords()
        self._frozen: dict[int, gtsam.Pose3] = {}
        self._snapshot = gtsam.Values()
        self._graph = IncrementalGraph(config)
        self._loops_changed = False  # since the last update

    def owner(self, landmark: int) -> int:
        """The landmark that this one has been merged into, itself if none."""
        return self._live.owner(landmark)

    @property
    def is_pending(self) -> bool:
        """Whether something waits to be solved."""
        return self._graph.is_pending

    def settle(self) -> None:
        """Solves what is still queued, if anything."""
        if self.is_pending:
            self.update()

    def update(self) -> None:
        """Solves incrementally, and to convergence where loop closures came or went.

        An indeterminate system destroys ISAM2: then it is rebuilt from the ledger.
        """
        self._forget()
        try:
            self._graph.solve()
            if self._loops_changed:
                self._close()
        except RuntimeError:
            self._rebuild()
        else:
            self._updates += 1
            if self._updates % SNAPSHOT_EVERY == 0 or self._loops_changed:
                self._snapshot = self._graph.isam.calculateEstimate()
            self._stand_upright()
        self._loops_changed = False

    def _close(self) -> None:
        """The graph is bent by a loop closure: it is converged, and fixed copies of poses follow it."""
        self._graph.converge(CLOSING_STEPS, CLOSED)
        if self._frozen:
            for t in self._frozen:
                self._frozen[t] = self._graph.isam.calculateEstimatePose3(X(t))
                self._graph.drop(("frozen", t))
                self._queue_frozen(t)
            self._graph.solve()
            self._graph.converge(CLOSING_STEPS, CLOSED)

    def _stand_upright(self) -> None:
        """Volumes are upright: where up has moved, their factors are made anew, which may move it again a little."""
        for _ in range(3):
            up = self._up_direction()
            if np.arccos(np.clip(up @ self.R_world_upright[:, 2], -1.0, 1.0)) < self._tolerance:
                return
            if not self._live.landmarks():
                self.R_world_upright = upright_rotation(up)
                return
            self._rebuild()

    def _rebuild(self, start: gtsam.Values | None = None) -> None:
        """A fresh ISAM2 from the ledger, from the values in `start` and else from the last good estimate."""
        self.rebuilds += 1
        self._forget()
        sources = start or gtsam.Values(), current_values(self._graph), self._snapshot, self._graph.values
        start = start_values(sources, self.ledger, self._live, self._frozen)
        self.R_world_upright = upright_rotation(start.atUnit3(UP).point3())
        self._graph = IncrementalGraph(self._config)
        for number in self._live.counting(self.ledger):
            self._queue_record(number)
        for landmark in self._live.landmarks():
            self._graph.queue(("site", landmark), [site_factor(landmark, self.sites[landmark])])
        for t in self._frozen:
            self._queue_frozen(t)
        self._graph.solve(start)
        if self._loops_changed:
            self._close()
        else:
            self._graph.converge(REBUILD_STEPS)
        self._snapshot = self._graph.isam.calculateEstimate()

    def _freeze(self, keyframe: int) -> None:
        """Makes the fixed copy of a pose, as the camera's own measurements have it now."""
        if keyframe in self._frozen:
            return
        if self._graph.values.exists(X(keyframe)):
            self.update()
        pose = self._frozen[keyframe] = self._graph.isam.calculateEstimatePose3(X(keyframe))
        self._graph.values.insert(F(keyframe), pose)
        self._queue_frozen(keyframe)

    def _queue_frozen(self, keyframe: int) -> None:
        pose = self._frozen[keyframe].matrix()
        self._graph.queue(("frozen", keyframe), [gauge_prior(F(keyframe), pose, FROZEN_SIGMAS)])

    def _queue_record(self, number: int) -> None:
        self._graph.queue(("record", number), self._factors(self.ledger[number]))

    def _factors(self, record: Record) -> list[gtsam.NonlinearFactor]:
        context = FactorContext(self._config, self.intrinsics, self.R_world_upright, self.owner)
        return record_factors(record, context)

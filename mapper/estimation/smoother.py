"""The joint estimate of keyframe poses, object volumes and the up direction: what is measured comes in here."""

from __future__ import annotations

from collections.abc import Iterable

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, S, X

from ...datasets.frame import Intrinsics
from ...factors.odometry import pose3
from ..config import SmootherConfig
from ..map.upright import upright_rotation
from .ledger import Ledger
from .ledger_graph import LedgerGraph
from .path_covariance import path_covariances
from .rebuild import current_values
from .record_factors import UP, site_factor
from .records import (
    Box,
    DepthCentre,
    DropLoop,
    DropMeasurement,
    Gauge,
    Look,
    Loop,
    Merge,
    Motion,
    NewLandmark,
    Record,
    Retire,
    Revive,
    ScanMatch,
    Scores,
    Site,
    UpPrior,
    Visual,
)
from .replay import close_start, replay, start_from
from .size_site import SizeSite


class Smoother(LedgerGraph):
    """Keeps the graph of a ledger solved. Measurements queue up until `update`."""

    @classmethod
    def from_ledger(
        cls, ledger: Ledger, config: SmootherConfig, intrinsics: Intrinsics, upright_tolerance: float = 0.026
    ) -> Smoother:
        """The graph of a saved ledger, solved; its own ledger holds the same records."""
        smoother = cls(config, intrinsics, upright_tolerance)
        replay(ledger, smoother)
        if smoother.loops() and config.joint:  # otherwise it has been solved on the way
            close_start(smoother._graph.values, smoother.ledger, smoother._live)
        if smoother.keyframes:
            smoother._rebuild()
            smoother._stand_upright()
            smoother._loops_changed = False
        return smoother

    def add_first(self, T_world_camera: np.ndarray, sigmas: np.ndarray, up: np.ndarray, up_sigma: float) -> None:
        """First keyframe: (4, 4) pose with (6,) sigmas [rad, m], and what is known of up ((3,) unit, world; rad)."""
        self.R_world_upright = upright_rotation(up)
        self.add(Gauge(T_world_camera, sigmas))
        self.add(UpPrior(up, up_sigma))

    def add_keyframe(self, T_a_b: np.ndarray, covariance: np.ndarray, T_world_camera: np.ndarray | None = None) -> int:
        """Next keyframe by odometry from the last one, (4, 4) and (6, 6); returns its number.

        `T_world_camera` (4, 4) is where it is best started, where more than odometry is known.
        """
        t = self.keyframes
        self.add(Motion(t - 1, t, T_a_b, covariance))
        if T_world_camera is not None:
            self._graph.values.update(X(t), pose3(T_world_camera))
        return t

    def add_landmark(self, landmark: int, position: np.ndarray, log_size: np.ndarray, site: SizeSite) -> None:
        """A new object: (3,) position, world; (3,) log half-axes; the site of its class prior."""
        self.add(NewLandmark(landmark, position, log_size))
        self.set_site(landmark, site)

    def add(self, record: Record) -> int:
        """Appends a measurement to the ledger, and its factors, if it has any, to the graph; returns its number.

        Raises:
            ValueError: an impossible measurement; nothing is added.
        """
        factors = self._factors(record)  # before the ledger has it: an impossible measurement raises here
        self._start_variables(record)
        number = self.ledger.append(record)
        if isinstance(record, DepthCentre | Box) and not self._config.joint:
            self._freeze(record.keyframe)
        self._live.add(number, record)
        self._graph.queue(("record", number), factors)
        if isinstance(record, Revive):
            for measurement in self._live.landmarks()[record.landmark]:
                self._queue_record(measurement)
        self._loops_changed |= isinstance(record, Loop)
        return number

    def set_site(self, landmark: int, site: SizeSite) -> None:
        """Replaces the Gaussian stand-in for the class mixture on a landmark's size."""
        self.sites[landmark] = site
        self.ledger.append(Site(landmark, site.mean, site.information))
        self._graph.drop(("site", landmark))
        self._graph.queue(("site", landmark), [site_factor(landmark, site)])

    def merge(self, kept: int, absorbed: int) -> None:
        """Re-keys every measurement of `absorbed` to `kept`; `absorbed` leaves the graph."""
        numbers = self._detach(absorbed)
        measurements = [number for number in numbers if not isinstance(self.ledger[number], NewLandmark)]
        self._live.merge(kept, absorbed, measurements)
        self.ledger.append(Merge(kept, absorbed))
        for number in measurements:
            self._queue_record(number)

    def retire(self, landmark: int) -> None:
        """Takes a landmark and its measurements out of the graph."""
        self._live.retire(landmark, self._detach(landmark))
        self.ledger.append(Retire(landmark))

    def revive(self, landmark: int, position: np.ndarray, log_size: np.ndarray, site: SizeSite) -> None:
        """Takes a retired landmark back, with its measurements: (3,) world; (3,) log half-axes; site of its class."""
        self.add(Revive(landmark, position, log_size))
        self.set_site(landmark, site)

    def drop_loops(self, numbers: Iterable[int]) -> None:
        """Takes loop closures (or other motions beside odometry) that were found wrong out of the graph.

        Args:
            numbers: as `add` returned them; what has been dropped already is left at that.

        Raises:
            ValueError: a record of another kind; nothing is dropped.
        """
        numbers = sorted(set(numbers))
        for number in numbers:
            if not isinstance(self.ledger[number], Loop | ScanMatch | Visual):
                raise ValueError(f"record {number} is a {type(self.ledger[number]).__name__}, which cannot be dropped")
        for number in numbers:
            if not self._live.is_dropped(number):
                self._graph.drop(("record", number))
                self.add(DropLoop(number))
                self._loops_changed = True

    def drop_measurements(self, numbers: Iterable[int]) -> None:
        """Takes what was measured of something else than its landmark out of the graph; what is out already stays so.

        Raises:
            ValueError: a record of another kind; nothing is dropped.
        """
        numbers = sorted(set(numbers))
        for number in numbers:
            if not isinstance(self.ledger[number], DepthCentre | Box | Look | Scores):
                raise ValueError(f"record {number} is a {type(self.ledger[number]).__name__}, not a measurement")
        for number in numbers:
            if not self._live.is_dropped(number):
                self._graph.drop(("record", number))
                self.add(DropMeasurement(number))

    def solve_from(self, T_world_camera: np.ndarray) -> None:
        """Solves anew with the keyframes at (M, 4, 4) and every landmark where these poses saw it.

        For when the graph has to leave an optimum that wrong measurements made.
        """
        start = current_values(self._graph)
        start_from(T_world_camera, start, self.ledger, self._live)
        self._loops_changed = True  # solved to convergence, as when a loop closes
        self._rebuild(start)
        self._stand_upright()
        self._loops_changed = False

    def measurements(self, landmark: int) -> list[int]:
        """Numbers of the depth centres and boxes of a landmark in the graph."""
        numbers = self._live.landmarks()[landmark]
        return [number for number in numbers if not isinstance(self.ledger[number], NewLandmark)]

    def is_dropped(self, number: int) -> bool:
        """Whether the record of this number in the ledger was found wrong."""
        return self._live.is_dropped(number)

    def loops(self) -> dict[int, Loop]:
        """The loop closures in the graph by their numbers in the ledger."""
        return self._live.loops()

    def path_covariances(self, b: int) -> np.ndarray:
        """(M, 6, 6) bounds on the covariance of `T_t_b` for every keyframe t: see `path_covariance`."""
        return path_covariances(self.poses(), self._live.links(), b)

    def _start_variables(self, record: Record) -> None:
        """Where the variables that come with a record start."""
        if isinstance(record, Revive) and self._graph.isam.valueExists(L(record.landmark)):
            self.update()  # its variables leave before they come again
        values = self._graph.values
        match record:
            case Gauge():
                values.insert(X(0), pose3(record.T_world_camera))
                self.keyframes = 1
            case UpPrior():
                values.insert(UP, gtsam.Unit3(record.direction))
            case Motion():
                known, isam = values.exists(X(record.a)), self._graph.isam
                before = values.atPose3(X(record.a)) if known else isam.calculateEstimatePose3(X(record.a))
                values.insert(X(record.b), before.compose(pose3(record.T_a_b)))
                self.keyframes = record.b + 1
            case NewLandmark() | Revive():
                for key in (L(record.landmark), S(record.landmark)):
                    if values.exists(key):  # of a saved ledger's landmark, retired since
                        values.erase(key)
                values.insertPoint3(L(record.landmark), record.position)
                values.insert(S(record.landmark), record.log_size)

    def _detach(self, landmark: int) -> list[int]:
        """Takes a landmark's factors out; returns the numbers of its records."""
        numbers = self._live.take_out(landmark)
        for owner in [("site", landmark), *(("record", number) for number in numbers)]:
            self._graph.drop(owner)
        del self.sites[landmark]
        return numbers

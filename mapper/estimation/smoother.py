"""The joint estimate of keyframe poses, object volumes and the up direction: all that talks to ISAM2."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gtsam
import numpy as np
from gtsam.symbol_shorthand import F, L, S, X

from ...datasets.frame import Intrinsics
from ...factors.odometry import gauge_prior, pose3
from ..config import SmootherConfig
from ..map.upright import upright_rotation
from .ledger import Box, DepthCentre, Gauge, Ledger, Merge, Motion, NewLandmark, Record, Retire, Site, UpPrior
from .record_factors import UP, FactorContext, record_factors, site_factor
from .size_site import SizeSite

REBUILD_STEPS = 10  # at most, Gauss-Newton steps after a rebuild, until nothing moves by more than the thresholds
SNAPSHOT_EVERY = 20  # updates between copies of the estimate from which a rebuild starts
FROZEN_SIGMAS = np.full(6, 1e-5)  # rad, m: of poses that objects are seen from but do not move
Owner = tuple[str, int]  # ("record", ledger number), ("site", landmark) or ("frozen", keyframe): whose factors


class Smoother:
    """Keeps the graph of a ledger solved. Measurements queue up until `update`."""

    def __init__(self, config: SmootherConfig, intrinsics: Intrinsics, upright_tolerance: float = 0.026) -> None:
        self._config, self.intrinsics, self._tolerance = config, intrinsics, upright_tolerance
        self.ledger = Ledger()
        self.sites: dict[int, SizeSite] = {}
        self.keyframes = 0
        self.rebuilds = 0
        self.R_world_upright = np.eye(3)
        self._updates = 0
        self._merged_into: dict[int, int] = {}
        self._measurements: dict[int, list[int]] = {}  # live landmark -> numbers of its records
        self._frozen: dict[int, gtsam.Pose3] = {}
        self._snapshot = gtsam.Values()
        self._reset()

    @classmethod
    def from_ledger(
        cls, ledger: Ledger, config: SmootherConfig, intrinsics: Intrinsics, upright_tolerance: float = 0.026
    ) -> Smoother:
        """The graph of a saved ledger, solved; its own ledger holds the same records."""
        smoother = cls(config, intrinsics, upright_tolerance)
        for record in ledger:
            smoother._replay(record)
        if smoother.keyframes:
            smoother._rebuild()
            smoother._stand_upright()
        return smoother

    # -- measurements

    def add_first(self, T_world_camera: np.ndarray, sigmas: np.ndarray, up: np.ndarray, up_sigma: float) -> None:
        """First keyframe: (4, 4) pose with (6,) sigmas [rad, m], and what is known of up ((3,) unit, world; rad)."""
        self.R_world_upright = upright_rotation(up)
        self._values.insert(X(0), pose3(T_world_camera))
        self._values.insert(UP, gtsam.Unit3(up))
        self.keyframes = 1
        self.add(Gauge(T_world_camera, sigmas))
        self.add(UpPrior(up, up_sigma))

    def add_keyframe(self, T_a_b: np.ndarray, covariance: np.ndarray) -> int:
        """Next keyframe by odometry from the last one, (4, 4) and (6, 6); returns its number."""
        t = self.keyframes
        self._values.insert(X(t), self._isam.calculateEstimatePose3(X(t - 1)).compose(pose3(T_a_b)))
        self.keyframes += 1
        self.add(Motion(t - 1, t, T_a_b, covariance))
        return t

    def add_landmark(self, landmark: int, position: np.ndarray, log_size: np.ndarray, site: SizeSite) -> None:
        """A new object: (3,) position, world; (3,) log half-axes; the site of its class prior."""
        self._values.insertPoint3(L(landmark), position)
        self._values.insert(S(landmark), log_size)
        self._measurements[landmark] = []
        self.add(NewLandmark(landmark, position, log_size))
        self.set_site(landmark, site)

    def add(self, record: Record) -> None:
        """Appends a measurement to the ledger, and its factors, if it has any, to the graph."""
        factors = self._factors(record)  # before the ledger has it: an impossible measurement raises here
        number = self.ledger.append(record)
        if isinstance(record, DepthCentre | Box) and not self._config.joint:
            self._freeze(record.keyframe)
        if isinstance(record, NewLandmark | DepthCentre | Box):
            self._measurements[self.owner(record.landmark)].append(number)
        if factors:
            self._queue[("record", number)] = factors

    def set_site(self, landmark: int, site: SizeSite) -> None:
        """Replaces the Gaussian stand-in for the class mixture on a landmark's size."""
        self.sites[landmark] = site
        self.ledger.append(Site(landmark, site.mean, site.information))
        self._drop(("site", landmark))
        self._queue[("site", landmark)] = [site_factor(landmark, site)]

    def merge(self, kept: int, absorbed: int) -> None:
        """Re-keys every measurement of `absorbed` to `kept`; `absorbed` leaves the graph."""
        numbers = self._detach(absorbed)
        self._merged_into[absorbed] = kept
        self.ledger.append(Merge(kept, absorbed))
        for number in numbers:
            if not isinstance(self.ledger[number], NewLandmark):
                self._measurements[kept].append(number)
                self._queue_record(number)

    def retire(self, landmark: int) -> None:
        """Takes a landmark and its measurements out of the graph."""
        self._detach(landmark)
        self.ledger.append(Retire(landmark))

    def owner(self, landmark: int) -> int:
        """The landmark that this one has been merged into, itself if none."""
        while landmark in self._merged_into:
            landmark = self._merged_into[landmark]
        return landmark

    # -- estimates

    def pose(self, keyframe: int) -> np.ndarray:
        """(4, 4) `T_world_camera` of a keyframe."""
        return self._isam.calculateEstimatePose3(X(keyframe)).matrix()

    def poses(self) -> np.ndarray:
        """(M, 4, 4) `T_world_camera` of all keyframes."""
        estimate = self._isam.calculateEstimate()
        return np.array([estimate.atPose3(X(t)).matrix() for t in range(self.keyframes)])

    def pose_covariances(self) -> np.ndarray:
        """(M, 6, 6) covariances of all keyframe poses, each in its pose's right tangent [rad, m]."""
        if not self.keyframes:
            return np.empty((0, 6, 6))
        return np.array([self.pose_covariance(t) for t in range(self.keyframes)])

    def pose_covariance(self, keyframe: int) -> np.ndarray:
        """(6, 6) in the pose's right tangent [rad, m]."""
        return self._isam.marginalCovariance(X(keyframe))

    def position(self, landmark: int) -> np.ndarray:
        """(3,) world, metres."""
        return self._isam.calculateEstimatePoint3(L(landmark))

    def position_covariance(self, landmark: int) -> np.ndarray:
        """(3, 3) square metres."""
        return self._isam.marginalCovariance(L(landmark))

    def log_size(self, landmark: int) -> np.ndarray:
        """(3,) log half-axes in the upright frame."""
        return self._isam.calculateEstimateVector(S(landmark))

    def log_size_covariance(self, landmark: int) -> np.ndarray:
        """(3, 3) square log units, the site included."""
        return self._isam.marginalCovariance(S(landmark))

    def difference_covariance(self, a: int, b: int) -> np.ndarray:
        """(3, 3) covariance of position a - position b; the cross term makes the test of a merge."""
        joint = self._isam.jointMarginalCovariance([L(a), L(b)])
        cross = joint.at(L(a), L(b))
        return joint.at(L(a), L(a)) + joint.at(L(b), L(b)) - cross - cross.T

    def up(self) -> tuple[np.ndarray, float]:
        """(3,) unit vector in world axes, and the standard deviation of its direction, rad."""
        return self._up(), float(np.sqrt(np.trace(self._isam.marginalCovariance(UP)) / 2.0))

    # -- solving

    def settle(self) -> None:
        """Solves what is still queued, if anything."""
        if self._queue or self._remove:
            self.update()

    def update(self) -> None:
        """Solves incrementally. An indeterminate system destroys ISAM2: then it is rebuilt from the ledger."""
        try:
            self._solve(self._values)
        except RuntimeError:
            self._rebuild()
            return
        self._updates += 1
        if self._updates % SNAPSHOT_EVERY == 0:
            self._snapshot = self._isam.calculateEstimate()
        self._stand_upright()

    def _stand_upright(self) -> None:
        """Volumes are upright: where up has moved, their factors are made anew, which may move it again a little."""
        for _ in range(3):
            if np.arccos(np.clip(self._up() @ self.R_world_upright[:, 2], -1.0, 1.0)) < self._tolerance:
                return
            if not self._measurements:
                self.R_world_upright = upright_rotation(self._up())
                return
            self._rebuild()

    def _solve(self, values: gtsam.Values) -> None:
        graph = gtsam.NonlinearFactorGraph()
        owners = []
        for owner, factors in self._queue.items():
            for factor in factors:
                graph.add(factor)
                owners.append(owner)
        result = self._isam.update(graph, values, self._remove)
        for owner, index in zip(owners, result.getNewFactorsIndices(), strict=True):
            self._index.setdefault(owner, []).append(index)
        self._queue, self._remove, self._values = {}, [], gtsam.Values()

    def _rebuild(self) -> None:
        """A fresh ISAM2 from the ledger, started from the last good estimate."""
        self.rebuilds += 1
        start = self._last_good()
        self.R_world_upright = upright_rotation(start.atUnit3(UP).point3())
        self._reset()
        live = {number for numbers in self._measurements.values() for number in numbers}
        for number, record in enumerate(self.ledger):
            if number in live or not isinstance(record, NewLandmark | DepthCentre | Box):
                self._queue_record(number)
        for landmark in self._measurements:
            self._queue[("site", landmark)] = [site_factor(landmark, self.sites[landmark])]
        for t, pose in self._frozen.items():
            self._queue[("frozen", t)] = [gauge_prior(F(t), pose.matrix(), FROZEN_SIGMAS)]
        self._solve(start)
        for _ in range(REBUILD_STEPS):
            if self._isam.update(force_relinearize=True).getVariablesRelinearized() == 0:
                break
        self._snapshot = self._isam.calculateEstimate()

    def _last_good(self) -> gtsam.Values:
        """A finite value for every variable: the current estimate, else the snapshot, else where it started."""
        try:
            current = self._isam.calculateEstimate()
        except RuntimeError:
            current = gtsam.Values()
        sources, start = (current, self._snapshot, self._values), gtsam.Values()
        motions = {r.b: r for r in self.ledger if isinstance(r, Motion)}
        for t in range(self.keyframes):
            pose = _finite(sources, X(t), "atPose3", gtsam.Pose3.matrix)
            start.insert(X(t), pose or start.atPose3(X(t - 1)).compose(pose3(motions[t].T_a_b)))
        for t, pose in self._frozen.items():
            start.insert(F(t), pose)
        start.insert(UP, _finite(sources, UP, "atUnit3", gtsam.Unit3.point3))
        for landmark, numbers in self._measurements.items():
            first = self.ledger[numbers[0]]
            assert isinstance(first, NewLandmark)
            position = _finite(sources, L(landmark), "atPoint3", np.asarray)
            log_size = _finite(sources, S(landmark), "atVector", np.asarray)
            start.insertPoint3(L(landmark), first.position if position is None else position)
            start.insert(S(landmark), first.log_size if log_size is None else log_size)
        return start

    # -- bookkeeping

    def _freeze(self, keyframe: int) -> None:
        """Makes the fixed copy of a pose, as the camera's own measurements have it now."""
        if keyframe in self._frozen:
            return
        if self._values.exists(X(keyframe)):
            self.update()
        pose = self._frozen[keyframe] = self._isam.calculateEstimatePose3(X(keyframe))
        self._values.insert(F(keyframe), pose)
        self._queue[("frozen", keyframe)] = [gauge_prior(F(keyframe), pose.matrix(), FROZEN_SIGMAS)]

    def _replay(self, record: Record) -> None:
        """Takes over one record of a saved ledger."""
        match record:
            case Merge():
                return self.merge(record.kept, record.absorbed)
            case Retire():
                return self.retire(record.landmark)
            case Site():
                return self.set_site(record.landmark, SizeSite(record.mean, record.information))
            case Gauge():
                self._values.insert(X(0), pose3(record.T_world_camera))
                self.keyframes = 1
            case UpPrior():
                self._values.insert(UP, gtsam.Unit3(record.direction))
            case Motion():
                known = self._values.exists(X(record.a))
                before = self._values.atPose3(X(record.a)) if known else self._isam.calculateEstimatePose3(X(record.a))
                self._values.insert(X(record.b), before.compose(pose3(record.T_a_b)))
                self.keyframes = record.b + 1
            case NewLandmark():
                self._values.insertPoint3(L(record.landmark), record.position)
                self._values.insert(S(record.landmark), record.log_size)
                self._measurements[record.landmark] = []
        self.add(record)

    def _up(self) -> np.ndarray:
        # the wrapper offers no calculateEstimate for one Unit3, and copying all values costs 2 ms at 1000 keyframes
        return self._linearization_point.atUnit3(UP).retract(self._isam.getDelta().at(UP)).point3()

    def _reset(self) -> None:
        c, params, thresholds = self._config, gtsam.ISAM2Params(), gtsam.ISAM2ThresholdMap()
        for pose in "xf":
            thresholds.insert((pose, np.repeat([c.threshold_rotation, c.threshold_translation], 3)))
        thresholds.insert(("l", np.full(3, c.threshold_position)))
        thresholds.insert(("s", np.full(3, c.threshold_size)))
        thresholds.insert(("u", np.full(2, c.threshold_up)))
        params.setRelinearizeThreshold(thresholds)
        params.relinearizeSkip = c.relinearize_skip
        self._isam = gtsam.ISAM2(params)
        # holding this reference stops every custom factor call from copying all values (884 -> 15 us at 5000 variables)
        self._linearization_point = self._isam.getLinearizationPoint()
        self._values = gtsam.Values()
        self._queue: dict[Owner, list[gtsam.NonlinearFactor]] = {}
        self._index: dict[Owner, list[int]] = {}
        self._remove: list[int] = []

    def _queue_record(self, number: int) -> None:
        factors = self._factors(self.ledger[number])
        if factors:
            self._queue[("record", number)] = factors

    def _factors(self, record: Record) -> list[gtsam.NonlinearFactor]:
        context = FactorContext(self._config, self.intrinsics, self.R_world_upright, self.owner)
        return record_factors(record, context)

    def _drop(self, owner: Owner) -> None:
        self._queue.pop(owner, None)
        self._remove += self._index.pop(owner, [])

    def _detach(self, landmark: int) -> list[int]:
        """Takes a landmark's factors out; returns the numbers of its records."""
        numbers = self._measurements.pop(landmark)
        for owner in [("site", landmark), *(("record", number) for number in numbers)]:
            self._drop(owner)
        del self.sites[landmark]
        return numbers


def _finite(sources: tuple[gtsam.Values, ...], key: int, getter: str, numbers: Callable[[Any], np.ndarray]) -> Any:
    for values in sources:
        if values.exists(key):
            value = getattr(values, getter)(key)
            if np.all(np.isfinite(numbers(value))):
                return value
    return None

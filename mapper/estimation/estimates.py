"""What a solved graph says: poses, landmarks, the up direction, and how sure each is."""

from __future__ import annotations

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, S, X

from .incremental import IncrementalGraph
from .joint_marginals import JointMarginals
from .record_factors import UP


class Estimates:
    """Reads a graph as it was last solved.

    Attributes:
        keyframes: how many poses there are.
    """

    _graph: IncrementalGraph
    keyframes: int
    # of the graph as it is; whoever changes the graph forgets them
    _joint: JointMarginals | None = None
    _poses: np.ndarray | None = None

    def pose(self, keyframe: int) -> np.ndarray:
        """(4, 4) `T_world_camera` of a keyframe."""
        return self._graph.isam.calculateEstimatePose3(X(keyframe)).matrix()

    def poses(self) -> np.ndarray:
        """(M, 4, 4) `T_world_camera` of all keyframes, read-only: they are read from the graph once an update."""
        if self._poses is None or len(self._poses) != self.keyframes:
            self._poses = _keyframe_poses(self._graph.isam.calculateEstimate(), self.keyframes)
            self._poses.flags.writeable = False
        return self._poses

    def _forget(self) -> None:
        """To be called when the graph has changed."""
        self._joint = self._poses = None

    def pose_covariances(self) -> np.ndarray:
        """(M, 6, 6) covariances of all keyframe poses, each in its pose's right tangent [rad, m]."""
        if not self.keyframes:
            return np.empty((0, 6, 6))
        return np.array([self.pose_covariance(t) for t in range(self.keyframes)])

    def pose_covariance(self, keyframe: int) -> np.ndarray:
        """(6, 6) in the pose's right tangent [rad, m]."""
        return self._graph.isam.marginalCovariance(X(keyframe))

    def pose_difference_covariance(self, a: int, b: int) -> np.ndarray:
        """(6, 6) covariance of `T_a_b = X_a^-1 X_b` in its right tangent [rad, m], from the joint marginal.

        With right tangents x_a, x_b of the poses, the tangent of T_a_b is x_b - Ad(T_a_b^-1) x_a.

        The first call after an update factorises the graph (0.3 s at 1000 keyframes), others take 10 ms;
        `Smoother.path_covariances` bounds all of them at once in less.
        """
        pose_a, pose_b = (self._graph.isam.calculateEstimatePose3(X(t)) for t in (a, b))
        backwards = pose_b.between(pose_a).AdjointMap()
        joint = self._joint_marginals().covariance([X(a), X(b)])
        J = np.hstack([-backwards, np.eye(6)])
        return J @ joint @ J.T

    def position(self, landmark: int) -> np.ndarray:
        """(3,) world, metres."""
        return self._graph.isam.calculateEstimatePoint3(L(landmark))

    def position_covariance(self, landmark: int) -> np.ndarray:
        """(3, 3) square metres."""
        return self._graph.isam.marginalCovariance(L(landmark))

    def log_size(self, landmark: int) -> np.ndarray:
        """(3,) log half-axes in the upright frame."""
        return self._graph.isam.calculateEstimateVector(S(landmark))

    def log_size_covariance(self, landmark: int) -> np.ndarray:
        """(3, 3) square log units, the site included."""
        return self._graph.isam.marginalCovariance(S(landmark))

    def difference_covariance(self, a: int, b: int) -> np.ndarray:
        """(3, 3) covariance of position a - position b; the cross term makes the test of a merge."""
        joint = self._graph.isam.jointMarginalCovariance([L(a), L(b)])
        cross = joint.at(L(a), L(b))
        return joint.at(L(a), L(a)) + joint.at(L(b), L(b)) - cross - cross.T

    def up(self) -> tuple[np.ndarray, float]:
        """(3,) unit vector in world axes, and the standard deviation of its direction, rad."""
        sigma = float(np.sqrt(np.trace(self._graph.isam.marginalCovariance(UP)) / 2.0))
        return self._up_direction(), sigma

    def _up_direction(self) -> np.ndarray:
        # the wrapper offers no calculateEstimate for one Unit3, and copying all values costs 2 ms at 1000 keyframes
        linearised_at = self._graph.linearization_point.atUnit3(UP)
        return linearised_at.retract(self._graph.isam.getDelta().at(UP)).point3()

    def _joint_marginals(self) -> JointMarginals:
        if self._joint is None:
            estimate: gtsam.Values = self._graph.isam.calculateEstimate()
            self._joint = JointMarginals(self._graph.isam.getFactorsUnsafe(), estimate)
        return self._joint


def _keyframe_poses(values: gtsam.Values, count: int) -> np.ndarray:
    """(M, 4, 4) of so many keyframes, read at once: one after the other, 2000 keyframes take 3 ms instead of 0.3."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    # rows are nine numbers of the rotation and three of the place, by key, and x comes after all other letters
    rows = gtsam.utilities.extractPose3(values).reshape(-1, 12)
    last = rows[len(rows) - count :]
    poses[:, :3, :3], poses[:, :3, 3] = last[:, :9].reshape(-1, 3, 3), last[:, 9:]
    return poses

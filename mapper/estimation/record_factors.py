"""From ledger records to factors of the graph.

X(t) keyframe pose     Pose3   T_world_camera; F(t) is its fixed copy, in use only where objects do not move cameras
L(j) object position   Point3  world, metres
S(j) log half-axes     Vector3 in the upright frame
U(0) up direction      Unit3   world axes

X0 --odometry-- X1 --odometry-- X2        gauge on X0, guards (weak, never removed) on L and S,
  \\            / |  \\                      class/size site on S; loop closures as odometry, but robust
   U(0)--up---   |   box(X, L, S)
                 L1 -- S1
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import F, L, S, U, X

from ...datasets.frame import Intrinsics
from ...factors.attitude import attitude_factor, up_prior
from ...factors.box_alignment import box_alignment_factor
from ...factors.depth_centre import depth_centre_factor
from ...factors.guard import position_guard, size_guard
from ...factors.odometry import between_factor, gauge_prior
from ..config import SmootherConfig
from .records import Box, DepthCentre, Gauge, Loop, Motion, NewLandmark, Record, ScanMatch, Up, UpPrior, Visual
from .size_site import SizeSite

UP = U(0)


@dataclass(frozen=True, slots=True, eq=False)
class FactorContext:
    """What turns a measurement into a factor besides the measurement itself.

    Attributes:
        config: noise of the guards, robustness.
        intrinsics: of the camera.
        R_world_upright: (3, 3) frame of the object volumes.
        owner: landmark number to the landmark it was merged into.
    """

    config: SmootherConfig
    intrinsics: Intrinsics
    R_world_upright: np.ndarray
    owner: Callable[[int], int]

    def seen_from(self, record: DepthCentre | Box) -> int:
        """Key of the pose an object was seen from: the camera's own, or a fixed copy of it."""
        return X(record.keyframe) if self.config.joint else F(record.keyframe)


def record_factors(record: Record, context: FactorContext) -> list[gtsam.NonlinearFactor]:
    """The factors of one ledger record; none for evidence that lives outside the graph."""
    c = context.config
    match record:
        case Gauge():
            return [gauge_prior(X(0), record.T_world_camera, record.sigmas)]
        case Motion():
            keys = X(record.a), X(record.b)
            return [between_factor(*keys, record.T_a_b, record.covariance, robust=c.robust_odometry)]
        case Visual() | ScanMatch() | Loop():
            keys = X(record.a), X(record.b)
            return [between_factor(*keys, record.T_a_b, record.covariance, robust=True)]
        case UpPrior():
            return [up_prior(UP, record.direction, record.sigma)]
        case Up():
            return [attitude_factor(X(record.keyframe), UP, record.direction, record.sigma)]
        case NewLandmark():
            j = record.landmark
            return [
                position_guard(L(j), record.position, c.guard_position),
                size_guard(S(j), record.log_size, c.guard_size),
            ]
        case DepthCentre():
            sigmas = record.sigma_tangential, record.sigma_range
            j = context.owner(record.landmark)
            return [depth_centre_factor(context.seen_from(record), L(j), record.centre, *sigmas, record.visibility)]
        case Box():
            j = context.owner(record.landmark)
            keys = context.seen_from(record), L(j), S(j)
            box = record.xyxy, record.sides_seen, context.intrinsics, context.R_world_upright, record.sigma_px
            return [box_alignment_factor(*keys, *box, record.part)]
        case _:
            return []


def site_factor(landmark: int, site: SizeSite) -> gtsam.NonlinearFactor:
    """The class mixture's Gaussian stand-in on S(j)."""
    return gtsam.PriorFactorVector(S(landmark), site.mean, gtsam.noiseModel.Gaussian.Information(site.information))

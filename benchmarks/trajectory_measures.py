"""What a trajectory is worth: errors against true poses, honesty of its measurements, thickness of the fused cloud."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import gtsam
import numpy as np
from surface_thickness import FusedSurfaces, Thickness, ThicknessConfig, poses_at

from thingmap.datasets.errors import UserError
from thingmap.datasets.sequence import Sequence
from thingmap.factors.odometry import pose3
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.records import DropLoop, Loop, Motion, ScanMatch, Visual
from thingmap.mapper.evaluation.inputs.alignment import align_poses, align_positions
from thingmap.mapper.evaluation.protocols.trajectory_errors import (
    ErrorSummary,
    absolute_errors,
    pairs_apart,
    relative_errors,
)
from thingmap.mapper.evaluation.uncertainty.consistency import Consistency, measure_consistency

STEPS = (Motion, Visual, ScanMatch, Loop)  # records that measure the motion between two keyframes
IMAGES = 60  # at least, of a short sequence, that its cloud is fused from


class HasPoses(Protocol):
    """What a trajectory is compared with; every sequence is one. See `Sequence`."""

    @property
    def name(self) -> str: ...
    @property
    def stamps(self) -> np.ndarray: ...
    @property
    def poses(self) -> np.ndarray | None: ...


@dataclass(frozen=True, slots=True, eq=False)
class Mapped:
    """What a mapper made of a sequence.

    Attributes:
        stamps, poses: (N,) seconds and (N, 4, 4) `T_world_camera` of every frame that has a pose.
        keyframe_stamps: (M,) seconds; none of an odometry alone.
        ledger: its measurements; none of an odometry alone.
        outcomes: frames by how well they were tracked ("good", "degenerate", "lost"), as far as the mapper tells.
        estimated: (a, b, T_a_b, covariance) of pairs of keyframes as the graph has them, by how many are between.
    """

    stamps: np.ndarray
    poses: np.ndarray
    keyframe_stamps: np.ndarray
    ledger: Ledger
    outcomes: Mapping[str, int]
    estimated: Mapping[int, list[tuple[int, int, np.ndarray, np.ndarray]]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What a trajectory is worth.

    Attributes:
        frames: of the sequence that have a true pose; `posed` of them were given one.
        ate: m, root mean square over those, aligned by positions (by poses where positions are on a line).
        rpe: (m, rad) root mean square of pairs one second apart; None without any.
        outcomes: as `Mapped`.
        loops: closures in the graph at the end; None of an odometry alone.
        dropped: measurements that were taken out again.
        steps: by kind of record, whether the covariances of those left mean what they say.
        thickness: of the fused cloud; None where it was not asked for.
    """

    frames: int
    posed: int
    ate: float
    rpe: tuple[float, float] | None
    outcomes: Mapping[str, int]
    loops: int | None
    dropped: int
    steps: Mapping[str, Consistency]
    thickness: Thickness | None


def measure(mapped: Mapped, sequence: HasPoses, surfaces: FusedSurfaces | None = None) -> Measured:
    """What was mapped, beside the sequence's own poses.

    Raises:
        UserError: the sequence has no poses, or fewer than two of those frames were mapped.
    """
    if sequence.poses is None:
        raise UserError(f"{sequence.name}: the sequence has no poses to compare with")
    truth = poses_at(mapped.stamps, sequence.stamps, sequence.poses)
    known = np.isfinite(truth).all(axis=(1, 2))
    if known.sum() < 2:
        raise UserError(f"{sequence.name}: {known.sum()} of its frames have both a true and an estimated pose")
    estimate, true = mapped.poses[known], truth[known]
    try:
        alignment = align_positions(estimate, true)
    except UserError:
        alignment = align_poses(estimate, true)
    ate = ErrorSummary.of(absolute_errors(estimate, true, alignment)).rmse
    metres, radians = map(ErrorSummary.of, relative_errors(estimate, true, pairs_apart(mapped.stamps[known])))
    gone = {record.record for record in mapped.ledger if isinstance(record, DropLoop)}
    loops = sum(isinstance(record, Loop) and number not in gone for number, record in enumerate(mapped.ledger))
    assert ate is not None
    return Measured(
        frames=int(np.isfinite(sequence.poses).all(axis=(1, 2)).sum()),
        posed=int(known.sum()),
        ate=ate,
        rpe=None if metres.rmse is None or radians.rmse is None else (metres.rmse, radians.rmse),
        outcomes=dict(mapped.outcomes),
        loops=loops if len(mapped.ledger) else None,
        dropped=len(gone),
        steps=step_consistency(mapped, sequence, gone),
        thickness=surfaces and surfaces.thickness(poses_at(surfaces.stamps, mapped.stamps, mapped.poses)),
    )


def step_consistency(mapped: Mapped, sequence: HasPoses, gone: set[int]) -> dict[str, Consistency]:
    """NEES of the motions between keyframes, by kind of record (of those taken out again, `gone`, none) and estimated.

    e = Log(T_a_b^-1 X_a^-1 X_b) with the true X, in the tangent that the records' covariances are of.
    """
    assert sequence.poses is not None
    truth = poses_at(mapped.keyframe_stamps, sequence.stamps, sequence.poses)
    result = {}
    for kind in STEPS:
        errors, covariances = [], []
        for number, record in enumerate(mapped.ledger):
            if type(record) is kind and number not in gone and np.isfinite(truth[[record.a, record.b]]).all():
                errors.append(_error(record.T_a_b, truth[record.a], truth[record.b]))
                covariances.append(record.covariance)
        if errors:
            result[kind.__name__] = measure_consistency(np.array(errors), np.array(covariances))
    for apart, pairs in mapped.estimated.items():
        known = [pair for pair in pairs if np.isfinite(truth[list(pair[:2])]).all()]
        if known:
            errors = [_error(T_a_b, truth[a], truth[b]) for a, b, T_a_b, _ in known]
            result[f"graph, {apart} apart"] = measure_consistency(np.array(errors), np.array([c for *_, c in known]))
    return result


def _error(T_a_b: np.ndarray, T_world_a: np.ndarray, T_world_b: np.ndarray) -> np.ndarray:
    """(6,) from a measured motion to the true one, in its right tangent [rad, m]."""
    return gtsam.Pose3.Logmap(pose3(T_a_b).between(pose3(T_world_a).between(pose3(T_world_b))))


def open_surfaces(sequence: Sequence) -> FusedSurfaces | None:
    """Of a sequence's depth images; of a sparse one all of them. None where nothing in it is flat."""
    every = min(ThicknessConfig().every, max(1, len(sequence) // IMAGES))
    try:
        return FusedSurfaces(sequence, ThicknessConfig(every=every))
    except UserError:
        return None

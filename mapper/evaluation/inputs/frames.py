"""Which frames the run and the truth have in common, and how their axes lie to each other."""

from __future__ import annotations

import numpy as np

from ....datasets.errors import UserError
from ....datasets.folder_truth import FolderWithTruth
from ....datasets.ground_truth import GroundTruth
from ....datasets.stamps import associate
from ...map.object_map import MapFrame
from ..config import EvaluationConfig
from .alignment import align_poses, anchor
from .case import Alignment, MappedRun

MAX_DISTANCE = 0.5  # m, and
MAX_ANGLE = 20.0  # degrees: the typical camera of a map is nearer to its true pose in the same world


def common_frames(run: MappedRun, truth: GroundTruth, config: EvaluationConfig) -> tuple[np.ndarray, np.ndarray]:
    """Frames that both have, by their stamps: one to one, the nearest first.

    Returns:
        (M,) indices of the truth's frames and (M,) rows of the run's trajectory, in the order of time. None for a truth
        without frames.

    Raises:
        UserError: the truth has frames, and the run none of them.
    """
    if len(truth.stamps) == 0:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    pairs = associate(run.stamps, truth.stamps, config.max_time_difference)
    if len(pairs) == 0:
        raise UserError(
            f"{run.folder} and {truth.name} have no common frame (stamps within {config.max_time_difference:g} s): the "
            f"map was made of {_range(run.stamps)}, the truth has {_range(truth.stamps)}; give the truth of the "
            "sequence that was mapped"
        )
    return pairs[:, 1], pairs[:, 0]


def align(
    run: MappedRun, truth: GroundTruth, truth_index: np.ndarray, run_index: np.ndarray
) -> tuple[Alignment, Alignment]:
    """How the map lies to the truth, and the same with the first common pose made equal.

    A map in the dataset's own axes is left where it is, but must be near; every other one is aligned by poses, and must
    be near then if it was made of a sequence of another name. (Under the same name it may have lost its way, which is
    to be measured.)

    Args:
        run, truth: what to align.
        truth_index: (M,) common frames in the truth, and
        run_index: (M,) in the run.

    Raises:
        UserError: the truth has no pose of a common frame and the map has axes of its own; or the map is in another
            world than the truth.
    """
    estimate, true = common_poses(run, truth, truth_index, run_index)
    if run.object_map.frame is MapFrame.DATASET:
        if len(true) and (miss := _miss(estimate, true)) is not None:
            raise UserError(
                f"{run.folder}: the map is in the dataset's axes, but {truth.name} is in another world: its cameras "
                f"are {miss}; give the truth of the poses that were mapped with"
            )
        same = Alignment(np.eye(3), np.zeros(3), "none: the map is in the dataset's axes")
        return same, same
    if len(true):
        alignment = align_poses(estimate, true)
        if other_source(run, truth) and (miss := _miss(alignment.pose(estimate), true)) is not None:
            raise UserError(
                f"{run.folder}: the map was made of {run.object_map.source}, not of {truth.name}, and after alignment "
                f"the true cameras are {miss}; give the truth of {run.object_map.source}"
            )
        return alignment, anchor(estimate, true)
    if not _has_places(truth):
        same = Alignment(np.eye(3), np.zeros(3), "none: the truth knows images only")
        return same, same
    raise UserError(
        f"{run.folder}: the map is in the axes of its own ({run.object_map.frame}) and {truth.name} has no pose of a "
        "frame that was mapped, so nothing tells where the map lies; give a truth with poses, or map with "
        "`--odometry poses`"
    )


def common_poses(
    run: MappedRun, truth: GroundTruth, truth_index: np.ndarray, run_index: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(K, 4, 4) estimated and true poses of the common frames that have a true one."""
    if truth.poses is None:
        return np.empty((0, 4, 4)), np.empty((0, 4, 4))
    true = truth.poses[truth_index]
    known = np.isfinite(true).all(axis=(1, 2))
    return run.poses[run_index][known], true[known]


def other_source(run: MappedRun, truth: GroundTruth) -> bool:
    """Whether the map was made of a sequence of another name; False where the truth is not one of a sequence.

    A rendered sequence has two names: that of its folder, and the line that it was rendered from.
    """
    names = {"", truth.name}
    if isinstance(truth.sequence, FolderWithTruth):
        names.add(truth.sequence.source)
    return truth.sequence is not None and run.object_map.source not in names


def _miss(estimate: np.ndarray, true: np.ndarray) -> str | None:
    """How far the typical camera is from its true pose, in words; None where it is near."""
    distance = float(np.median(np.linalg.norm(estimate[:, :3, 3] - true[:, :3, 3], axis=1)))
    cosine = (np.einsum("nij,nij->n", estimate[:, :3, :3], true[:, :3, :3]) - 1.0) / 2.0
    angle = float(np.degrees(np.median(np.arccos(np.clip(cosine, -1.0, 1.0)))))
    if distance <= MAX_DISTANCE and angle <= MAX_ANGLE:
        return None
    return (
        f"{distance:.2f} m and {angle:.0f} degrees from the mapped ones (medians over {len(true)} frames), expected at "
        f"most {MAX_DISTANCE:g} m and {MAX_ANGLE:g} degrees"
    )


def _has_places(truth: GroundTruth) -> bool:
    return bool(truth.located or truth.false_detections or truth.point_truth is not None)


def _range(stamps: np.ndarray) -> str:
    if len(stamps) == 0:
        return "no frame"
    return f"{len(stamps)} frames from {stamps.min():.3f} to {stamps.max():.3f} s"

"""The frames that a run has mapped, where it says their cameras were, and what they hang on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...datasets.errors import InputError, UserError
from ...datasets.sequence import Sequence
from ...datasets.stamps import nearest
from ..evaluation.inputs.case import MappedRun
from ..map.store import AGAIN, OutputFolder
from ..trajectory.rigid import inverse

ROUNDING = 1e-5  # s; files of trajectories hold microseconds


@dataclass(frozen=True, slots=True, eq=False)
class MappedFrames:
    """N frames in the order of time, and M keyframes.

    Attributes:
        position: (N,) index in the sequence.
        stamps: (N,) seconds.
        anchor: (N,) index of the keyframe that the frame moves with: the last one up to it, which is where the mapper
            went on from.
        T_keyframe_camera: (N, 4, 4) of a frame in its keyframe.
        keyframe_stamps: (M,) seconds.
        T_world_keyframe: (M, 4, 4), map frame.
    """

    position: np.ndarray
    stamps: np.ndarray
    anchor: np.ndarray
    T_keyframe_camera: np.ndarray
    keyframe_stamps: np.ndarray
    T_world_keyframe: np.ndarray


def mapped_frames(run: MappedRun, sequence: Sequence, stride: int) -> MappedFrames:
    """Every `stride`-th frame of those that a run has mapped, from the first.

    Raises:
        InputError: the run has no poses of keyframes.
        UserError: frames that were mapped are not in the sequence.
    """
    keyframes = run.keyframes
    if keyframes is None or len(keyframes.stamps) == 0:
        raise InputError(OutputFolder(run.folder).keyframes_file, "poses of keyframes", "none", AGAIN)
    order = np.argsort(sequence.stamps, kind="stable")
    found = nearest(run.stamps, np.asarray(sequence.stamps)[order], ROUNDING)
    if missing := int(np.sum(found < 0)):
        raise UserError(
            f"{run.folder}: {missing} of its {len(found)} mapped frames are not in {sequence.name}, by their stamps; "
            "give the sequence that was mapped with --sequence"
        )
    stamps, poses = run.stamps[::stride], run.poses[::stride]
    anchor = np.maximum(np.searchsorted(keyframes.stamps, stamps + ROUNDING, side="right") - 1, 0)
    relative = [inverse(keyframes.poses[a]) @ T for a, T in zip(anchor, poses, strict=True)]
    return MappedFrames(
        position=order[found[::stride]],
        stamps=stamps,
        anchor=anchor,
        T_keyframe_camera=np.array(relative).reshape(-1, 4, 4),
        keyframe_stamps=keyframes.stamps,
        T_world_keyframe=keyframes.poses,
    )

"""Which frames are lacking, and when what is held no longer fits."""

from __future__ import annotations

import numpy as np
import pytest
from label_runs import labelled
from voxel_frames import NAMES, random_frame

from thingmap.mapper.labelling.label_state import LabelState
from thingmap.mapper.labelling.mapped_frames import MappedFrames
from thingmap.mapper.labelling.voxel_config import VoxelConfig
from thingmap.mapper.labelling.voxels import VoxelEvidence

MOVED, TURNED = 0.003, 0.0015


def frames_of_two_keyframes() -> MappedFrames:
    """Four frames, two on each of two keyframes."""
    T_world_keyframe = np.tile(np.eye(4), (2, 1, 1))
    T_world_keyframe[1, 0, 3] = 0.1
    T_keyframe_camera = np.tile(np.eye(4), (4, 1, 1))
    T_keyframe_camera[1::2, 1, 3] = 0.02
    stamps = np.arange(4, dtype=np.float64)
    return MappedFrames(np.arange(4), stamps, np.array([0, 0, 1, 1]), T_keyframe_camera, stamps[::2], T_world_keyframe)


def state_of(frames: MappedFrames, rows: list[int], keyframes_known: bool = True) -> LabelState:
    state = LabelState("test", VoxelEvidence(NAMES[:2], VoxelConfig()))
    for row in rows:
        keyframe = int(frames.anchor[row])
        _, _, *arrays = random_frame(np.random.default_rng(row), 2, 10).arguments()
        T_world_keyframe = frames.T_world_keyframe if keyframes_known else None
        state.evidence.add(keyframe, frames.T_keyframe_camera[row], *arrays, T_world_keyframe)
        state.note(frames, row)
    return state


def test_what_has_not_been_added_is_lacking() -> None:
    frames = frames_of_two_keyframes()
    lacking = state_of(frames, [0, 2]).lacking(frames, MOVED, TURNED)
    assert lacking is not None and lacking.tolist() == [1, 3]


def test_all_may_move_together() -> None:
    frames = frames_of_two_keyframes()
    state = state_of(frames, [0, 1, 2])
    frames.T_world_keyframe[:, :3, 3] += [1.0, -2.0, 0.5]
    lacking = state.lacking(frames, MOVED, TURNED)
    assert lacking is not None and lacking.tolist() == [3]


def turn(angle: float) -> np.ndarray:
    R = np.eye(4)
    R[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return R


@pytest.mark.parametrize(
    ("metres", "radians", "fits"), [(0.002, 0.001, True), (0.004, 0.0, False), (0.0, 0.002, False)]
)
def test_keyframes_of_one_submap_that_part_no_longer_fit(metres: float, radians: float, fits: bool) -> None:
    """Frames stay where they are on their keyframes: only the voxels' store knows that it is bent."""
    frames = frames_of_two_keyframes()
    together, apart = state_of(frames, [0, 2]), state_of(frames, [0, 2], keyframes_known=False)
    assert together.evidence.submaps[0] == 1 and apart.evidence.submaps[0] == 2
    frames.T_world_keyframe[1] = frames.T_world_keyframe[1] @ turn(radians)
    frames.T_world_keyframe[1, 2, 3] += metres
    assert (together.lacking(frames, MOVED, TURNED) is not None) == fits
    assert apart.lacking(frames, MOVED, TURNED) is not None


def test_frames_of_several_keyframes_share_a_submap(tmp_path_factory) -> None:
    """In the whole job too: one for each keyframe would hold the same table as often as there are keyframes."""
    state = LabelState.load(labelled(tmp_path_factory.getbasetemp()).out / "voxels.npz")
    keyframes = {held.keyframe for held in state.frames.values()}
    assert state.evidence.submaps[0] < len(keyframes)

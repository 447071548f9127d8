"""What labelling has gathered so far: the voxels, the frames in them, and where those were when they were looked at."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...datasets.errors import InputError
from ..map.atomic import replacing
from ..trajectory.rigid import inverse, rotation_angle
from .mapped_frames import MappedFrames
from .voxels import VoxelEvidence

ARRAYS = ("frames_of", "frames_stamp", "frames_keyframe", "frames_keyframe_stamp", "frames_T_keyframe_camera")
REMEDY = "remove the file, or gather anew with `thingmap label OUT --again`"


class Held(NamedTuple):
    """Where a frame was when it was added: the keyframe by index and stamp, and (4, 4) T_keyframe_camera."""

    keyframe: int
    keyframe_stamp: float
    T_keyframe_camera: np.ndarray


@dataclass(slots=True)
class LabelState:
    """Evidence of some frames.

    Attributes:
        about: what it was made of: the sequence, the detector and every number that matters, as text.
        evidence: the voxels.
        frames: stamp of a frame -> where it was; in the order of adding.
    """

    about: str
    evidence: VoxelEvidence
    frames: dict[float, Held] = field(default_factory=dict)

    def lacking(self, frames: MappedFrames, moved: float, turned: float) -> np.ndarray | None:
        """Rows of `frames` that have not been added; None where something in here is not as it is there.

        That is: a frame that is not among them, is of another keyframe, or has moved against its keyframe by more than
        `moved` metres or `turned` radians, or a keyframe has against those whose voxels it shares. (Apart from that
        keyframes may move as they like: their voxels go with them.)
        """
        rows = {stamp: row for row, stamp in enumerate(frames.stamps.tolist())}
        for stamp, held in self.frames.items():
            row = rows.pop(stamp, None)
            if row is None or held.keyframe != frames.anchor[row]:
                return None
            if held.keyframe_stamp != frames.keyframe_stamps[held.keyframe]:
                return None
            change = inverse(held.T_keyframe_camera) @ frames.T_keyframe_camera[row]
            if np.linalg.norm(change[:3, 3]) > moved or rotation_angle(change[:3, :3]) > turned:
                return None
        warp = self.evidence.warp(frames.T_world_keyframe)
        return None if warp[0] > moved or warp[1] > turned else np.array(sorted(rows.values()), dtype=np.int64)

    def note(self, frames: MappedFrames, row: int) -> None:
        """That a frame has been looked at, whether or not there was anything to be used."""
        keyframe, T = int(frames.anchor[row]), frames.T_keyframe_camera[row].copy()
        self.frames[float(frames.stamps[row])] = Held(keyframe, float(frames.keyframe_stamps[keyframe]), T)

    def save(self, file: Path) -> None:
        """One .npz: the voxels' arrays, and those of the frames beside them."""
        held = list(self.frames.values())
        values = (
            np.array(self.about),
            np.array(list(self.frames), dtype=np.float64),
            np.array([one.keyframe for one in held], dtype=np.int64),
            np.array([one.keyframe_stamp for one in held], dtype=np.float64),
            np.array([one.T_keyframe_camera for one in held], dtype=np.float64).reshape(-1, 4, 4),
        )
        with replacing(file) as temporary:
            self.evidence.save(temporary)
            with zipfile.ZipFile(temporary, "a") as archive:
                for name, value in zip(ARRAYS, values, strict=True):
                    with archive.open(f"{name}.npy", "w") as member:
                        np.lib.format.write_array(member, value, allow_pickle=False)

    @classmethod
    def load(cls, file: Path) -> LabelState:
        """What `save` has written; raises `InputError` where the file is anything else."""
        try:
            with np.load(file, allow_pickle=False) as content:
                about, stamps, keyframes, keyframe_stamps, T = (content[name] for name in ARRAYS)
            shapes, count = (stamps.shape, keyframes.shape, keyframe_stamps.shape, T.shape), len(stamps)
            if shapes != ((count,), (count,), (count,), (count, 4, 4)) or about.dtype.kind != "U":
                raise ValueError(f"arrays of shapes {shapes}")
            held = map(Held, keyframes.tolist(), keyframe_stamps.tolist(), T)
            return cls(str(about), VoxelEvidence.load(file), dict(zip(stamps.tolist(), held, strict=True)))
        except KeyError as error:
            raise InputError(file, f"arrays {', '.join(ARRAYS)}", str(error), REMEDY) from None
        except (OSError, ValueError, TypeError, EOFError, AttributeError, zipfile.BadZipFile) as error:
            raise InputError(file, "voxels as an .npz archive", str(error), REMEDY) from None

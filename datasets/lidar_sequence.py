"""A recorded sequence of LiDAR sweeps, with or without a camera's images: what the LiDAR loaders return."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .errors import InputError
from .frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from .images import read_color
from .lidar import LidarScan, Splat, project_scan
from .sequence import Sequence
from .views import Subset

RawScan = tuple[np.ndarray, np.ndarray | None]  # (N, 3) metres, lidar axes, and (N,) seconds after the stamp


@dataclass(frozen=True, slots=True)
class ScanFiles:
    """The files of a frame; one that is not there makes the frame broken, not the sequence.

    Attributes:
        name: what the dataset calls the frame.
        scan: file of the sweep.
        image: 8-bit image, None where the sequence has no camera.
    """

    name: str
    scan: Path
    image: Path | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class LidarSequence:
    """Implements `datasets.sequence.Sequence` over files that are read only when a frame is asked for.

    Attributes:
        path: folder the sequence was opened from; named in errors.
        name: shown to people and written to `map.json`.
        files: N frames' files.
        read_scan: position and files of a frame to its points and their times; raises `BrokenFrame`. Points that are
            not finite or at the scanner itself are no returns, and left out here.
        intrinsics: of the images; `lidar.NO_CAMERA` where there is no camera.
        T_camera_lidar: (4, 4).
        stamps: (N,) seconds.
        poses: (N, 4, 4) `T_world_camera`, NaN where a frame has none; None without ground truth.
        gravity: (3,) unit vector down in the dataset's world axes, or None.
        splat: how points become depth images.

    Raises:
        InputError: there is no frame, or the first, the middle and the last are all unusable.
    """

    path: Path
    name: str
    files: tuple[ScanFiles, ...]
    read_scan: Callable[[int, ScanFiles], RawScan]
    intrinsics: Intrinsics
    T_camera_lidar: np.ndarray
    stamps: np.ndarray
    poses: np.ndarray | None = None
    gravity: np.ndarray | None = None
    splat: Splat = field(default_factory=Splat)

    def __post_init__(self) -> None:
        if not self.files:
            raise InputError(self.path, "scans", "none", "check that the folder is complete")
        broken: list[BrokenFrame] = []
        sample = sorted({0, len(self) // 2, len(self) - 1})
        for i in sample:
            try:
                self[i]
            except BrokenFrame as reason:
                broken.append(reason)
        if len(broken) == len(sample):
            remedy = "check that the files are complete and as the layout wants them"
            raise InputError(
                self.path, "frames that can be used", f"none of the {len(sample)} tried: {broken[0]}", remedy
            )

    def __len__(self) -> int:
        return len(self.files)

    @property
    def names(self) -> tuple[str, ...]:
        """What the dataset calls the frames, in order."""
        return tuple(f.name for f in self.files)

    def __getitem__(self, index: int) -> Frame:
        """The frame at `index` (negative counts from the end).

        Raises:
            BrokenFrame: the scan or the image cannot be used; it says which and why.
            IndexError: there is no such frame.
        """
        i = range(len(self.files))[index]
        files, k = self.files[i], self.intrinsics
        color = np.empty((0, 0, 3), dtype=np.uint8)
        if files.image is not None:
            color = read_color(files.name, files.image, k)
        scan = self._scan(i)
        pose = None if self.poses is None or np.isnan(self.poses[i]).any() else self.poses[i].copy()
        return Frame(
            index=i,
            name=files.name,
            stamp=float(self.stamps[i]),
            color=color,
            depth=project_scan(scan, k, self.splat),
            intrinsics=k,
            T_world_camera=pose,
            scan=scan,
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    def _scan(self, i: int) -> LidarScan:
        points, times = self.read_scan(i, self.files[i])
        returned = np.isfinite(points).all(axis=1) & points.any(axis=1)
        if not returned.any():
            found = f"none of the {len(points)} points of {self.files[i].scan.name} is a return"
            raise BrokenFrame(self.files[i].name, FrameProblem.NO_DEPTH, found)
        points = np.ascontiguousarray(points[returned], dtype=np.float32)
        return LidarScan(points, self.T_camera_lidar, None if times is None else times[returned].astype(np.float64))


def is_lidar(sequence: Sequence) -> bool:
    """Whether the sequence's frames are a LiDAR's sweeps, so that numbers for rooms do not fit it."""
    return isinstance(sequence, LidarSequence) or (isinstance(sequence, Subset) and is_lidar(sequence.sequence))

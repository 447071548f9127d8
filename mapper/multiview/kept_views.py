"""What is kept of a keyframe: enough to tell later what it could see, and which thing each of its pixels shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Frame, Intrinsics
from ...detectors.detections import Detections
from .kernels import MM_PER_M
from .observations import Observations

FARTHEST_MM = 65535  # of a depth kept in 16 bits
NOBODY = -1  # of a pixel in no mask, of a detection of no track


@dataclass(frozen=True, slots=True, eq=False)
class KeptView:
    """One keyframe, every few pixels of it.

    Attributes:
        keyframe: its number in the graph.
        stamp: seconds.
        name: of its frame.
        depth_mm: (h, w) uint16 millimetres, 0 = no reading.
        owner: (h, w) int16 row of the detection in whose mask a pixel is, `NOBODY` for none.
        has_masks: whether the detections say which pixels are theirs, or there are none.
        xyxy: (D, 4) pixels, boxes of all detections.
        track: (D,) number of the track that each became, `NOBODY` for those that could not be used.
        observations: those that could.
    """

    keyframe: int
    stamp: float
    name: str
    depth_mm: np.ndarray
    owner: np.ndarray
    has_masks: bool
    xyxy: np.ndarray
    track: np.ndarray
    observations: Observations

    @classmethod
    def of(
        cls,
        frame: Frame,
        keyframe: int,
        detections: Detections,
        observations: Observations,
        numbers: np.ndarray,
        step: int,
    ) -> KeptView:
        """Keeps a view whose N observations became the tracks (N,) `numbers`; every `step`-th row and column.

        Where masks overlap a pixel is that of the more confident detection.
        """
        pixels = np.s_[::step, ::step]  # as the cloud takes them: each of its points is a kept pixel of one view
        millimetres = np.nan_to_num(frame.depth[pixels] * MM_PER_M, nan=0.0, posinf=0.0)
        owner = np.full(millimetres.shape, NOBODY, dtype=np.int16)
        if detections.mask is not None:
            for row in observations.row[np.argsort(observations.confidence, kind="stable")]:
                owner[detections.mask[row][pixels]] = row
        track = np.full(len(detections), NOBODY, dtype=np.int64)
        track[observations.row] = numbers
        return cls(
            keyframe=keyframe,
            stamp=frame.stamp,
            name=frame.name,
            depth_mm=np.rint(np.where(millimetres <= FARTHEST_MM, millimetres, 0.0)).astype(np.uint16),
            owner=owner,
            has_masks=detections.mask is not None or len(detections) == 0,
            xyxy=detections.xyxy.copy(),
            track=track,
            observations=observations,
        )


@dataclass(frozen=True, slots=True, eq=False)
class ViewStack:
    """V kept views of one camera at their poses, as arrays for the compiled code.

    Attributes:
        T_camera_world: (V, 3, 4) world to camera.
        camera: (6,) fx, fy, cx, cy, width, height, full resolution.
        step: pixels between those that are kept; the first is kept.
        depth_mm: (V, h, w) uint16.
    """

    T_camera_world: np.ndarray
    camera: np.ndarray
    step: int
    depth_mm: np.ndarray

    @classmethod
    def of(
        cls, views: Sequence[KeptView], T_world_keyframe: np.ndarray, intrinsics: Intrinsics, step: int
    ) -> ViewStack:
        """Views under (M, 4, 4) keyframe poses; at least one."""
        T = T_world_keyframe[[view.keyframe for view in views]]
        R = T[:, :3, :3].transpose(0, 2, 1)
        k = intrinsics
        return cls(
            T_camera_world=np.ascontiguousarray(np.concatenate([R, -R @ T[:, :3, 3:]], axis=2)),
            camera=np.array([k.fx, k.fy, k.cx, k.cy, k.width, k.height], dtype=np.float64),
            step=step,
            depth_mm=np.stack([view.depth_mm for view in views]),
        )

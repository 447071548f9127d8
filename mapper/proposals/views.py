"""The views that batch inference looks at all together, and their detections as arrays for the compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...datasets.frame import Frame, Intrinsics
from ...factors.visibility import VolumePart
from ..config import AssociationConfig
from ..estimation.lifting import LiftedDetection
from ..estimation.view import View

MM_PER_M = 1000.0
FARTHEST_MM = 65535  # of a depth kept in 16 bits


@dataclass(frozen=True, slots=True, eq=False)
class StoredView:
    """A keyframe whose depth and detections are kept: 0.6 MB at 640 x 480.

    Attributes:
        frame: without its images.
        keyframe: its number in the graph.
        depth_mm: (H, W) uint16 millimetres, 0 = no reading.
        detections: lifted, of this view.
    """

    frame: Frame
    keyframe: int
    depth_mm: np.ndarray
    detections: tuple[LiftedDetection, ...]

    @classmethod
    def of(cls, frame: Frame, keyframe: int, detections: Sequence[LiftedDetection]) -> StoredView:
        """Keeps what inference needs of a frame."""
        millimetres = np.nan_to_num(frame.depth * MM_PER_M, nan=0.0, posinf=0.0)
        depth_mm = np.rint(np.where(millimetres <= FARTHEST_MM, millimetres, 0.0)).astype(np.uint16)
        bare = replace(frame, color=np.empty((0, 0, 3), np.uint8), depth=np.empty((0, 0), np.float32))
        return cls(bare, keyframe, depth_mm, tuple(detections))

    def at(self, T_world_camera: np.ndarray, R_world_upright: np.ndarray) -> View:
        """The view with its depth, at the pose (4, 4) as estimated now."""
        depth = self.depth_mm.astype(np.float32) / np.float32(MM_PER_M)
        return View(replace(self.frame, depth=depth), self.keyframe, T_world_camera, R_world_upright)


@dataclass(frozen=True, slots=True, eq=False)
class PackedViews:
    """V views of one camera and their D detections, ordered by view.

    Attributes:
        T_camera_rows: (V, 4, 4) transposes of `T_world_camera`: read back, they lie in the memory order for which the
            projection is compiled.
        R_world_upright: (3, 3) frame of the volumes.
        camera: (6,) fx, fy, cx, cy, width, height.
        first: (V + 1,) where each view's detections begin.
        view, part: (D,) number of the view, and `VolumePart`.
        xyxy, whole_xyxy: (D, 4) pixels: of the part (a side that is not seen is its laxest bound), and of the whole.
        sides_seen: (D, 4) bool.
        sigma_px: (D,) of a side.
        centre: (D, 3) world, metres; `information` (D, 3, 3) of it; `gate_information` the same with pose error.
        own: (D, K) log ratio of the scores for each class against a foreign one, nats.
    """

    T_camera_rows: np.ndarray
    R_world_upright: np.ndarray
    camera: np.ndarray
    first: np.ndarray
    view: np.ndarray
    part: np.ndarray
    xyxy: np.ndarray
    whole_xyxy: np.ndarray
    sides_seen: np.ndarray
    sigma_px: np.ndarray
    centre: np.ndarray
    information: np.ndarray
    gate_information: np.ndarray
    own: np.ndarray

    def __len__(self) -> int:
        return len(self.T_camera_rows)

    @property
    def templates(self) -> np.ndarray:
        """(5,) bool, templates that the detector has: a detector of whole objects is never expected to find halves."""
        used = np.bincount(self.part, minlength=len(VolumePart)) > 0
        used[VolumePart.WHOLE] = True
        return used


def spread_views(count: int, frames: int) -> frozenset[int]:
    """Numbers of `count` of the frames 0, 1, ..., the first and the last among them; of all if there are no more."""
    return frozenset(np.rint(np.linspace(0, frames - 1, min(count, frames))).astype(int).tolist())


def pack(
    cameras: Sequence[np.ndarray],
    detections: Sequence[Sequence[LiftedDetection]],
    own: Sequence[np.ndarray],
    R_world_upright: np.ndarray,
    intrinsics: Intrinsics,
    config: AssociationConfig,
) -> PackedViews:
    """Arrays of V views.

    Args:
        cameras: V poses, (4, 4) `T_world_camera`.
        detections: of each view.
        own: of each detection, in order: (K,) log ratio of its scores for each class against a foreign one, nats.
        R_world_upright: (3, 3).
        intrinsics: of all views.
        config: pose error between views.
    """
    found = [d for view in detections for d in view]
    counts = np.array([len(view) for view in detections], dtype=np.int64)
    view = np.repeat(np.arange(len(counts)), counts)
    poses = np.asarray(cameras, dtype=float).reshape(-1, 4, 4)
    R, t = poses[view, :3, :3], poses[view, :3, 3]
    covariance = R @ _rows([d.covariance() for d in found], 3, 3) @ R.transpose(0, 2, 1)
    seen = np.array([d.sides_seen for d in found], dtype=np.bool_).reshape(-1, 4)
    xyxy = _rows([d.xyxy for d in found], 4)
    k = intrinsics
    # a cut side may be drawn some pixels inside or outside the border; what is certain is the laxer bound
    low = np.maximum(xyxy, np.array([-0.5, -0.5, -np.inf, -np.inf]))
    lax = np.minimum(low, np.array([np.inf, np.inf, k.width - 0.5, k.height - 0.5]))
    return PackedViews(
        T_camera_rows=np.ascontiguousarray(poses.transpose(0, 2, 1)),
        R_world_upright=np.ascontiguousarray(R_world_upright, dtype=float),
        camera=np.array([k.fx, k.fy, k.cx, k.cy, k.width, k.height], dtype=float),
        first=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        view=view,
        part=np.array([d.part for d in found], dtype=np.int64),
        xyxy=np.where(seen, xyxy, lax),
        whole_xyxy=_rows([d.whole_xyxy for d in found], 4),
        sides_seen=seen,
        sigma_px=np.array([d.sigma_px for d in found], dtype=float),
        centre=np.einsum("dij,dj->di", R, _rows([d.centre for d in found], 3)) + t,
        information=np.linalg.inv(covariance),
        gate_information=np.linalg.inv(covariance + config.position_floor**2 * np.eye(3)),
        own=np.array(own, dtype=float).reshape(len(found), len(own[0]) if len(own) else 0),
    )


def _rows(values: list[np.ndarray], *shape: int) -> np.ndarray:
    return np.array(values, dtype=float).reshape(-1, *shape)

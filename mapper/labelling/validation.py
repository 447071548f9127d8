"""Boxes checked against the labelled cloud (Lai et al., IV-C): one whose label is not that of most points in the middle
of it is pruned, unless those points are not sure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from ...datasets.errors import InputError, UserError
from ...datasets.frame import Frame
from ...datasets.stamps import nearest
from ...datasets.truth import NO_OBJECT
from ...detectors.detections import Detections
from ..evaluation.inputs.load_run import load_run
from ..map.labels_file import PointLabels, read_labels
from ..map.store import OutputFolder
from ..trajectory.rigid import inverse
from .gathering import check_classes
from .mapped_frames import ROUNDING

HALF = 0.5  # of the points in the middle: a majority


@dataclass(frozen=True, slots=True)
class ValidationConfig:
    """How a box is checked.

    Attributes:
        central: share of a box's width and height that is its central region: a quarter of its area, which lies on the
            object also where that is round.
        tolerance: metres that a point may be off the depth measured where it appears: one behind is hidden, one in
            front is not there any more. Two voxels, the noise of a Kinect at 2 m, and slant.
        share: of the points in the whole box, from which on its own label keeps it too: what stands before an object
            hides its middle. (The paper's rule is the middle alone.) On two training tables with simulated boxes that
            lost 8 and 12 points of recall, and with this 0 and 2; false boxes went the same. 0.1 to 0.3 are alike.
        doubt: nats of one look, see `PointLabels`: a point for whose label less speaks may be its second. What is
            found in every third view is labelled away by a little, a wall by 1.2. On seven training tables with HOG
            boxes (most recall 73.0 %) the most recall after was 68.6 % by labels alone, 69.2 with 0.3, 69.6 with 0.6,
            69.9 with 0.9, mean AP 62.2, 62.5, 62.7, 62.8, and precision at 60 % recall 85.9, 85.5, 85.0, 84.6 (73.1
            before). 0: only a point whose label its neighbours have decided.
        least_points: in the central region, below which nobody knows, and the box stays.

    Raises:
        UserError: for a value out of range.
    """

    central: float = 0.5
    tolerance: float = 0.04
    share: float = 0.2
    doubt: float = 0.6
    least_points: int = 3

    def __post_init__(self) -> None:
        positive = self.share > 0.0 and self.tolerance > 0.0 and self.least_points >= 1
        if not (0.0 < self.central <= 1.0 and positive and self.doubt >= 0.0):
            expected = "central in (0, 1], share and tolerance > 0, doubt >= 0, least_points >= 1"
            raise UserError(f"expected {expected}, but got {self}")


@dataclass(frozen=True, slots=True, eq=False)
class Validator:
    """A labelled map that checks boxes.

    Attributes:
        points: (M, 3) metres, map frame.
        labels: of these points.
        classes: of the map.
        stamps: (N,) seconds, ascending, of the frames that were mapped.
        poses: (N, 4, 4) `T_world_camera` of them in the map's frame.
        config: numbers.
    """

    points: np.ndarray
    labels: PointLabels
    classes: tuple[str, ...]
    stamps: np.ndarray
    poses: np.ndarray
    config: ValidationConfig = field(default_factory=ValidationConfig)

    @classmethod
    def load(cls, out: OutputFolder, config: ValidationConfig | None = None) -> Validator:
        """That of a run's folder.

        Raises:
            InputError: it holds no run, the run is not labelled, or a file is damaged.
        """
        run = load_run(out.path)
        if not out.labels_file.is_file():
            raise InputError(out.labels_file, "a labelled cloud", "nothing", f"run `thingmap label {out.path}` first")
        points, labels = read_labels(out.labels_file, run.object_map.classes)
        order = np.argsort(run.stamps, kind="stable")
        poses = (run.stamps[order], run.poses[order])
        return cls(points, labels, run.object_map.classes, *poses, config or ValidationConfig())

    def pose_at(self, stamp: float) -> np.ndarray | None:
        """(4, 4) `T_world_camera` of the mapped frame of that stamp in seconds; None where no such frame was mapped."""
        row = nearest(np.array([stamp]), self.stamps, ROUNDING)[0]
        return None if row < 0 else self.poses[row]

    def validate(self, detections: Detections, frame: Frame, T_world_camera: np.ndarray) -> np.ndarray:
        """(D,) bool: which of D detections stay.

        Those whose label is that of most visible points in the middle; or may be that of half of them, where these are
        not sure; or is that of enough points in the whole box; or where too few points are seen to know. Of labels that
        are equally many, any may be the box's.

        Raises:
            UserError: the detector finds classes that the map does not have.
        """
        check_classes(detections.classes, self.classes)
        uv, rows = visible_points(self.points, frame, T_world_camera, self.config.tolerance)
        label, central = self.labels.label[rows], self.config.central
        votes = self._votes(detections, uv, label, central)
        whole = self._votes(detections, uv, label, 1.0)
        own = np.arange(len(votes)), _columns(detections.classes, self.classes)[detections.class_id]
        total = votes.sum(axis=1)
        agrees = votes[own] == votes.max(axis=1, initial=0)
        agrees |= whole[own] >= self.config.share * whole.sum(axis=1)
        if self.labels.second is not None and self.labels.margin is not None:
            unsure = self.labels.margin[rows] < self.config.doubt
            seconds = self._votes(detections, uv[unsure], self.labels.second[rows[unsure]], central)
            agrees |= votes[own] + seconds[own] >= HALF * total
        return agrees | (total < self.config.least_points)

    def _votes(self, detections: Detections, uv: np.ndarray, label: np.ndarray, central: float) -> np.ndarray:
        return central_votes(detections.xyxy, uv, label, len(self.classes), central)


def visible_points(
    points: np.ndarray, frame: Frame, T_world_camera: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """(V, 2) pixels, where points appear that the frame sees, and (V,) their rows.

    Args:
        points: (M, 3) metres, world.
        frame: with depth; a point is seen where that differs from its own by at most `tolerance`.
        T_world_camera: (4, 4) of the frame.
        tolerance: metres.
    """
    T_camera_world = inverse(T_world_camera)
    local = points @ T_camera_world[:3, :3].T + T_camera_world[:3, 3]
    rows = np.flatnonzero(local[:, 2] > tolerance)
    uv = frame.intrinsics.project(local[rows])
    height, width = frame.depth.shape
    # compared as real numbers: what is far outside would overflow an integer
    is_inside = ((uv >= -0.5) & (uv < np.array([width, height]) - 0.5)).all(axis=1)
    uv, rows = uv[is_inside], rows[is_inside]
    pixel = np.floor(uv + 0.5).astype(np.intp)
    depth = frame.depth[pixel[:, 1], pixel[:, 0]]
    is_seen = (depth > 0.0) & (np.abs(local[rows, 2] - depth) <= tolerance)
    return uv[is_seen], rows[is_seen]


def central_votes(xyxy: np.ndarray, uv: np.ndarray, label: np.ndarray, classes: int, central: float) -> np.ndarray:
    """(D, K + 1) number of points of each label in the central regions of D boxes, the background's last.

    Args:
        xyxy: (D, 4) boxes; they count from the image's outer edge, half a pixel before the first pixel's centre.
        uv: (V, 2) pixels of points, whole numbers at centres.
        label: (V,) 0..K-1, `NO_OBJECT` for background.
        classes: K.
        central: share of the width and height.
    """
    column = np.where(label == NO_OBJECT, classes, label)
    middle, half = (xyxy[:, :2] + xyxy[:, 2:]) / 2.0 - 0.5, (xyxy[:, 2:] - xyxy[:, :2]) * central / 2.0
    return _votes(middle - half, middle + half, uv, column, classes + 1)


@njit(cache=True)
def _votes(low: np.ndarray, high: np.ndarray, uv: np.ndarray, column: np.ndarray, columns: int) -> np.ndarray:
    votes = np.zeros((len(low), columns), np.int64)
    for i in range(len(uv)):
        u, v = uv[i, 0], uv[i, 1]
        for d in range(len(low)):
            if low[d, 0] <= u <= high[d, 0] and low[d, 1] <= v <= high[d, 1]:
                votes[d, column[i]] += 1
    return votes


def _columns(found: Sequence[str], classes: Sequence[str]) -> np.ndarray:
    """(K',) index in `classes` of each class that a detector knows; upper and lower case are the same."""
    index = {name.casefold(): k for k, name in enumerate(classes)}
    return np.array([index[name.casefold()] for name in found], dtype=np.intp)

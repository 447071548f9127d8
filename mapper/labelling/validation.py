"""Boxes checked against the labelled cloud (Lai et al., IV-C): one whose label is not that of most points in the middle
of it is pruned, unless those points are not sure. Where it is known whose the points are, a thing is found once, and
its box is drawn midway to where its points reach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...datasets.errors import InputError
from ...datasets.frame import Frame
from ...datasets.stamps import nearest
from ...detectors.boxes import cut_to_image
from ...detectors.detections import Detections
from ..evaluation.inputs.load_run import load_run
from ..map.labels_file import PointLabels, read_labels
from ..map.store import OutputFolder
from ..trajectory.rigid import inverse
from .box_votes import central_votes
from .gathering import check_classes
from .mapped_frames import ROUNDING
from .thing_extents import ThingPixels, doubles, drawn_anew, reaches, shown_things
from .validation_config import ValidationConfig

HALF = 0.5  # of the points in the middle: a majority


@dataclass(frozen=True, slots=True, eq=False)
class Validated:
    """What became of a frame's boxes.

    Attributes:
        detections: those that stay, in their order, drawn where their things' points say.
        agrees: (D,) bool, which of the D that were found are what the labels say; the others do not stay.
        doubled: how many more do not, since a better box of the same class shows the same thing.
    """

    detections: Detections
    agrees: np.ndarray
    doubled: int

    @property
    def denied(self) -> int:
        """How many are not what the labels say."""
        return int((~self.agrees).sum())


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

    def validate(self, detections: Detections, frame: Frame, T_world_camera: np.ndarray) -> Validated:
        """The detections that labels and things agree with; boxes that belong to masks are not drawn anew.

        Labels agree with those whose label is that of most visible points in the middle; or may be that of half of
        them, where these are not sure; or is that of enough points in the whole box; or where too few points are seen
        to know. Of labels that are equally many, any may be the box's.

        Raises:
            UserError: the detector finds classes that the map does not have.
        """
        check_classes(detections.classes, self.classes)
        in_front, uv, is_seen = project_points(self.points, frame, T_world_camera, self.config.tolerance)
        agrees = self._agrees(detections, uv[is_seen], in_front[is_seen])
        kept = detections.select(agrees)
        if self.labels.instance is None:
            return Validated(kept, agrees, 0)
        shown, anew = self._drawn_to_things(kept, frame, uv, in_front, is_seen)
        is_drawn = ~np.isnan(anew[:, 0])
        single = ~doubles(kept, np.where(is_drawn, shown, 0))
        if kept.mask is None:
            kept = replace(kept, xyxy=np.where(is_drawn[:, None], anew, kept.xyxy))
        return Validated(kept.select(single), agrees, int((~single).sum()))

    def _drawn_to_things(
        self, kept: Detections, frame: Frame, uv: np.ndarray, rows: np.ndarray, is_seen: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(D,) numbers of the things that boxes show, 0 for none, and (D, 4) boxes drawn to their points, or NaN."""
        assert self.labels.instance is not None
        config, least = self.config, self.config.least_own
        whole = ThingPixels(uv, self.labels.instance[rows])
        seen = ThingPixels(uv[is_seen], whole.number[is_seen])
        shown = shown_things(kept, self._claims(kept), seen, self.labels.label[rows[is_seen]], config.central)
        height, width = frame.depth.shape
        extents = reaches(seen, shown, least), cut_to_image(reaches(whole, shown, least), width, height)
        return shown, drawn_anew(kept.xyxy, extents, config.same, config.drawn)

    def _agrees(self, detections: Detections, uv: np.ndarray, rows: np.ndarray) -> np.ndarray:
        label, central = self.labels.label[rows], self.config.central
        votes = self._votes(detections, uv, label, central)
        whole = self._votes(detections, uv, label, 1.0)
        own = np.arange(len(votes)), self._claims(detections)
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

    def _claims(self, detections: Detections) -> np.ndarray:
        """(D,) index in the map's classes of what each box is of."""
        return _columns(detections.classes, self.classes)[detections.class_id]


def project_points(
    points: np.ndarray, frame: Frame, T_world_camera: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A,) rows of the points before the camera, (A, 2) pixels where they appear, and (A,) whether the frame sees them.

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
    inside = np.flatnonzero(((uv >= -0.5) & (uv < np.array([width, height]) - 0.5)).all(axis=1))
    pixel = np.floor(uv[inside] + 0.5).astype(np.intp)
    depth = frame.depth[pixel[:, 1], pixel[:, 0]]
    is_seen = np.zeros(len(rows), dtype=bool)
    is_seen[inside] = (depth > 0.0) & (np.abs(local[rows[inside], 2] - depth) <= tolerance)
    return rows, uv, is_seen


def _columns(found: Sequence[str], classes: Sequence[str]) -> np.ndarray:
    """(K',) index in `classes` of each class that a detector knows; upper and lower case are the same."""
    index = {name.casefold(): k for k, name in enumerate(classes)}
    return np.array([index[name.casefold()] for name in found], dtype=np.intp)

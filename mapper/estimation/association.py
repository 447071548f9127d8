"""Which detection shows which landmark or candidate, with which template.

The cost of a pair is minus twice its log likelihood up to a constant: depth position (Mahalanobis distance), box
alignment Ψ_g (Meger et al., Clutter, III-D: centre error over the detection's scale, error of scale) and the class as
evidence, never as a gate. The cheapest one-to-one assignment is found by the Hungarian method.

Every template is assigned by itself (Explicit Occlusion, section 2.3): whole boxes to whole targets, the box of a half
to that half of a target, and only where the depth map leaves enough of it visible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...detectors.detections import Part
from ...detectors.parts import part_box
from ..config import AssociationConfig
from .association_costs import DetectionArrays, alignment_costs, box_sides, position_costs, shares_inside
from .lifting import LiftedDetection
from .part_association import join_parts

IMPOSSIBLE = 1e6
# Visible share of a half above which its template counts: the "hand-chosen threshold" θ of Explicit Occlusion, equation
# (4). The paper gives no number; Clutter, section IV, finds detectors unreliable where less than 0.3 is visible.
PART_VISIBLE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """What could be seen in this keyframe: landmarks first, then candidates.

    Attributes:
        positions: (M, 3) world, metres; `covariances` (M, 3, 3).
        log_sizes: (M, 3) log half-axes, upright frame.
        xyxy: (M, 4) pixels, projected boxes clipped to the image; NaN where not in front of the camera.
        visible: (M,) share inside the image and not occluded.
        visible_parts: (M, 5) the same by `Part`; `visible` for all of them unless given.
        projected: (M, 4) pixels, projected boxes as they are, of which halves are taken; `xyxy` unless given.
        side_px: (M,) geometric mean of the clipped box's sides.
    """

    positions: np.ndarray
    covariances: np.ndarray
    log_sizes: np.ndarray
    xyxy: np.ndarray
    visible: np.ndarray
    visible_parts: np.ndarray = None  # type: ignore[assignment]
    projected: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.visible_parts is None:
            object.__setattr__(self, "visible_parts", np.repeat(self.visible[:, None], len(Part), axis=1))
        if self.projected is None:
            object.__setattr__(self, "projected", self.xyxy)

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def side_px(self) -> np.ndarray:
        """(M,) geometric mean of the projected box's sides, pixels; 0 where it is not in view."""
        return box_sides(self.xyxy)

    def boxes_of(self, part: Part) -> np.ndarray:
        """(M, 4) pixels, the part of every projected box, clipped to the image; of no area where it lies outside."""
        if part == Part.WHOLE:
            return self.xyxy
        halves = part_box(self.projected, part)
        low = np.maximum(halves[:, :2], self.xyxy[:, :2])
        return np.hstack([low, np.maximum(np.minimum(halves[:, 2:], self.xyxy[:, 2:]), low)])


@dataclass(frozen=True, slots=True, eq=False)
class Assignment:
    """Result of an association of N detections to M targets.

    A detection that none of `target`, `duplicate_of` and `same_as` says anything of shows something new.

    Attributes:
        target: (N,) index of the target each detection shows, -1 where none.
        duplicate_of: (N,) index of the target on which an unassigned detection is a second box, -1 where none.
        detection_of: (M, 5) detection that shows a target with a template (columns: `Part`), -1 where none. Made from
            `target` unless given, as of whole detections; it then ends with the last target that is shown.
        same_as: (N,) index of the detection of the same new object that a part detection goes with, -1 where none.
    """

    target: np.ndarray
    duplicate_of: np.ndarray
    detection_of: np.ndarray = None  # type: ignore[assignment]
    same_as: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.detection_of is None:
            detection_of = np.full((int(self.target.max(initial=-1)) + 1, len(Part)), -1)
            shown = np.flatnonzero(self.target >= 0)[::-1]  # the first of several stays
            detection_of[self.target[shown], Part.WHOLE] = shown
            object.__setattr__(self, "detection_of", detection_of)
        if self.same_as is None:
            object.__setattr__(self, "same_as", np.full(len(self.target), -1))

    def shown_by(self, target: int) -> np.ndarray:
        """(5,) detections that show a target, by template; -1 where none."""
        return self.detection_of[target] if target < len(self.detection_of) else np.full(len(Part), -1)

    def starts_new(self) -> np.ndarray:
        """(N,) bool, detections that show something new and lead all that show it."""
        return (self.target < 0) & (self.duplicate_of < 0) & (self.same_as < 0)


def associate(
    detections: list[LiftedDetection],
    targets: Targets,
    class_evidence: np.ndarray,
    T_world_camera: np.ndarray,
    R_world_upright: np.ndarray,
    config: AssociationConfig,
) -> Assignment:
    """Assignment of detections to targets, one-to-one for every template.

    Args:
        detections: of one keyframe.
        targets: as predicted in it.
        class_evidence: (N, M) log likelihood ratio of each detection's scores under each target's class posterior
            against a new object, nats.
        T_world_camera: (4, 4) predicted pose.
        R_world_upright: (3, 3) frame of the volumes.
        config: gates and weights.
    """
    found = DetectionArrays.of(detections, T_world_camera)
    target, detection_of = np.full(len(detections), -1), np.full((len(targets), len(Part)), -1)
    position = position_costs(found.positions, found.covariances, targets.positions, targets.covariances)
    for part in Part:
        rows = np.flatnonzero(found.part == part)
        if not len(rows) or not len(targets):
            continue
        cost = position[rows] + alignment_costs(found.xyxy[rows], targets.boxes_of(part), config)
        cost -= 2.0 * config.class_weight * class_evidence[rows]
        cost[(position[rows] > config.gate) | ~_is_visible(targets, part, config) | ~np.isfinite(cost)] = IMPOSSIBLE
        shown, by = _one_to_one(cost, config.new_cost)
        target[rows[by]] = shown
        detection_of[shown, part] = rows[by]
    duplicate_of = _duplicates(found, targets, target, R_world_upright, config)
    duplicate_of, same_as = join_parts(found, target, duplicate_of)
    return Assignment(target, duplicate_of, detection_of, same_as)


def _is_visible(targets: Targets, part: Part, config: AssociationConfig) -> np.ndarray:
    """(M,) whether enough of a target's part shows for its template to be believed."""
    if part == Part.WHOLE:
        return targets.visible >= config.min_visible
    return targets.visible_parts[:, part] > PART_VISIBLE


def _one_to_one(cost: np.ndarray, new_cost: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the cheapest assignment of (n, M) costs, in which every row may cost `new_cost` instead."""
    n, m = cost.shape
    rows, columns = linear_sum_assignment(np.hstack([cost, np.full((n, n), new_cost)]))
    accepted = columns < m
    return columns[accepted], rows[accepted]


def _duplicates(
    found: DetectionArrays, targets: Targets, target: np.ndarray, R_world_upright: np.ndarray, config: AssociationConfig
) -> np.ndarray:
    """A box without target that lies on a target, in the image and in space, is a second box on it.

    Of a part, the whole box that it implies; this reaches beyond the image as the projected box does.
    """
    result, free = np.full(len(target), -1), np.flatnonzero(target < 0)
    if not len(free) or not len(targets):
        return result
    boxes = found.whole_xyxy[free]
    is_whole = (found.part[free] == Part.WHOLE)[:, None]
    inside = np.where(is_whole, shares_inside(boxes, targets.xyxy), shares_inside(boxes, targets.projected))
    reach = np.exp(targets.log_sizes)[None] * 1.2 + found.sigma_range[free, None, None]
    away = (found.positions[free, None] - targets.positions[None]) @ R_world_upright
    offset = np.linalg.norm(away / reach, axis=2)
    # a much smaller thing at the same place is another one: a mug on a table
    alike = box_sides(boxes)[:, None] > config.duplicate_scale * targets.side_px[None]
    on_target = (inside > config.duplicate_overlap) & (offset < 1.0) & alike & (targets.visible > 0.0)[None]
    nearest = np.argmin(np.where(on_target, offset, np.inf), axis=1)
    result[free] = np.where(on_target.any(axis=1), nearest, -1)
    return result

"""From 2D boxes and a depth map to 3D measurements with uncertainty.

The box of a half (`Part`) implies the box of the whole object, as wide again on the side that its template does not
look at. Depth is read where the half is, for there the object shows; centre and extents are those of the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...datasets.frame import Frame
from ...detectors.detections import Detections, Part
from ...detectors.parts import whole_box
from ..config import LiftingConfig
from .outcomes import Outcome

# What a half knows less of than the whole. Across the ray its centre is where one side of the box ends, not the mean of
# two sides, so that the same noise makes it sqrt(2) as unsure. Along the ray its depth scatters 10-20 % wider about the
# object's centre, and is more often that of something behind: over some 1,000 noisy boxes of each part, in 15 rendered
# scenes, the median absolute deviation rose from 0.37 half depths to 0.41-0.45, the standard deviation from 0.5 to 1.
HALF_TANGENTIAL = 2.0**0.5
HALF_RANGE = 1.25


@dataclass(frozen=True, slots=True, eq=False)
class LiftedDetection:
    """A detection with its place in space.

    Attributes:
        scores: (K,) as the detector gave them.
        xyxy: (4,) pixels, pixel centres at integers (detectors count from the image's edge: half a pixel more); the
            box of the part.
        sides_seen: (4,) bool, False where the image border cuts the box.
        sigma_px: noise of a box side, pixels; it grows with the whole box, as the middle of an object is no edge.
        centre: (3,) centre of the whole object, camera frame, metres.
        sigma_tangential, sigma_range: of `centre` across and along the ray, metres.
        half_extents: (3,) metres, of the whole object: half width, half depth (assumed), half height.
        part: `Part` that the box shows.
        whole_xyxy: (4,) pixels, box of the whole object that this implies, not clipped; `xyxy` unless given.
        embedding: (D,) float32 as the detector gave it, or None.
    """

    scores: np.ndarray
    xyxy: np.ndarray
    sides_seen: np.ndarray
    sigma_px: float
    centre: np.ndarray
    sigma_tangential: float
    sigma_range: float
    half_extents: np.ndarray
    part: int = Part.WHOLE
    whole_xyxy: np.ndarray = None  # type: ignore[assignment]
    embedding: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.whole_xyxy is None:
            object.__setattr__(self, "whole_xyxy", self.xyxy)

    @property
    def class_id(self) -> int:
        """Index of the best class."""
        return int(np.nanargmax(self.scores))

    @property
    def confidence(self) -> float:
        """Score of the best class."""
        return float(np.nanmax(self.scores))

    def covariance(self) -> np.ndarray:
        """(3, 3) of `centre`, camera frame."""
        ray = self.centre / np.linalg.norm(self.centre)
        along, across = self.sigma_range**2, self.sigma_tangential**2
        return across * np.eye(3) + (along - across) * np.outer(ray, ray)


def lift(
    detections: Detections, frame: Frame, config: LiftingConfig, use_parts: bool = True
) -> tuple[list[LiftedDetection], list[Outcome]]:
    """The usable detections of a frame in space, and why the others are not usable.

    Without `use_parts`, detections of halves are not.
    """
    lifted, refused = [], []
    width, height = frame.intrinsics.width, frame.intrinsics.height
    boxes = np.clip(detections.xyxy, 0.0, [width, height, width, height])  # not every source clips
    confidence = detections.confidence
    for i in range(len(detections)):
        if not confidence[i] >= config.min_confidence:
            refused.append(Outcome.LOW_CONFIDENCE)
        elif detections.part[i] != Part.WHOLE and not use_parts:
            refused.append(Outcome.PART_UNUSED)
        else:
            result = lift_box(boxes[i] - 0.5, detections.scores[i], frame, config, int(detections.part[i]))
            if isinstance(result, Outcome):
                refused.append(result)
            else:
                embedding = None if detections.embedding is None else detections.embedding[i]
                lifted.append(result if embedding is None else replace(result, embedding=embedding))
    return lifted, refused


def lift_box(
    xyxy: np.ndarray, scores: np.ndarray, frame: Frame, config: LiftingConfig, part: int = Part.WHOLE
) -> LiftedDetection | Outcome:
    """One box of a part, (4,) pixels with pixel centres at integers, in space.

    Depth is the median of the box's centre; the object's centre lies behind a surface that far away, on the ray
    through the middle of the whole object's box, by most of its half depth.

    The half depth is unknown from one view: the smaller half extent stands in for it, and its share in the range's
    noise says so.
    """
    k = frame.intrinsics
    sides = xyxy[2:] - xyxy[:2]
    if not np.all(sides > 0.0):
        return Outcome.NO_DEPTH
    readings = _central_depth(frame.depth, (xyxy[:2] + xyxy[2:]) / 2.0, sides * config.central_share / 2.0)
    if len(readings) < config.min_readings:
        return Outcome.NO_DEPTH
    z = float(np.median(readings))
    if z > config.max_range:
        return Outcome.OUT_OF_RANGE
    whole = xyxy if part == Part.WHOLE else whole_box(xyxy, part)
    whole_sides = whole[2:] - whole[:2]
    half_width, half_height = whole_sides / 2.0 * z / np.array([k.fx, k.fy])
    half_depth = min(half_width, half_height)
    surface = k.back_project((whole[None, :2] + whole[None, 2:]) / 2.0, np.array([z]))[0]
    distance = float(np.linalg.norm(surface))
    spread = 1.4826 * float(np.median(np.abs(readings - z)))
    noise = config.noise_floor + config.sensor_noise * z * z
    seen = _sides_seen(xyxy, k.width, k.height, config.border)
    tangential, along = (1.0, 1.0) if part == Part.WHOLE else (HALF_TANGENTIAL, HALF_RANGE)
    across = config.sigma_tangential if seen.all() else 1.0  # the centre of a cut box is not the object's
    return LiftedDetection(
        scores=scores,
        xyxy=xyxy,
        sides_seen=seen,
        sigma_px=config.sigma_px + config.sigma_relative * float(np.sqrt(whole_sides.prod())),
        centre=surface * (1.0 + config.surface_offset * half_depth / distance),
        sigma_tangential=max(noise, tangential * across * float(np.sqrt(half_width * half_height))),
        sigma_range=along * float(np.sqrt(noise**2 + spread**2 + (config.sigma_range * half_depth) ** 2)),
        half_extents=np.array([half_width, half_depth, half_height]),
        part=part,
        whole_xyxy=whole,
    )


def _central_depth(depth: np.ndarray, centre: np.ndarray, half: np.ndarray) -> np.ndarray:
    (x0, y0), (x1, y1) = np.floor(centre - half).astype(int), np.ceil(centre + half).astype(int) + 1
    crop = depth[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)]
    return crop[crop > 0.0]


def _sides_seen(xyxy: np.ndarray, width: int, height: int, border: int) -> np.ndarray:
    return np.array([xyxy[0] > border, xyxy[1] > border, xyxy[2] < width - 1 - border, xyxy[3] < height - 1 - border])

"""From 2D boxes and a depth map to 3D measurements with uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Frame
from ...detectors.detections import Detections, Part
from ..config import LiftingConfig
from .outcomes import Outcome


@dataclass(frozen=True, slots=True, eq=False)
class LiftedDetection:
    """A detection with its place in space.

    Attributes:
        scores: (K,) as the detector gave them.
        xyxy: (4,) pixels, pixel centres at integers (detectors count from the image's edge: half a pixel more).
        sides_seen: (4,) bool, False where the image border cuts the box.
        sigma_px: noise of a box side, pixels.
        centre: (3,) object centre, camera frame, metres.
        sigma_tangential, sigma_range: of `centre` across and along the ray, metres.
        half_extents: (3,) metres: half width, half depth (assumed), half height.
    """

    scores: np.ndarray
    xyxy: np.ndarray
    sides_seen: np.ndarray
    sigma_px: float
    centre: np.ndarray
    sigma_tangential: float
    sigma_range: float
    half_extents: np.ndarray

    def covariance(self) -> np.ndarray:
        """(3, 3) of `centre`, camera frame."""
        ray = self.centre / np.linalg.norm(self.centre)
        along, across = self.sigma_range**2, self.sigma_tangential**2
        return across * np.eye(3) + (along - across) * np.outer(ray, ray)


def lift(detections: Detections, frame: Frame, config: LiftingConfig) -> tuple[list[LiftedDetection], list[Outcome]]:
    """The usable whole-object detections of a frame in space, and why the others are not usable."""
    lifted, refused = [], []
    width, height = frame.intrinsics.width, frame.intrinsics.height
    boxes = np.clip(detections.xyxy, 0.0, [width, height, width, height])  # not every source clips
    confidence = detections.confidence
    for i in range(len(detections)):
        if not confidence[i] >= config.min_confidence:
            refused.append(Outcome.LOW_CONFIDENCE)
        elif detections.part[i] != Part.WHOLE:
            refused.append(Outcome.PART_UNUSED)
        else:
            result = lift_box(boxes[i] - 0.5, detections.scores[i], frame, config)
            (refused if isinstance(result, Outcome) else lifted).append(result)  # type: ignore[arg-type]
    return lifted, refused


def lift_box(xyxy: np.ndarray, scores: np.ndarray, frame: Frame, config: LiftingConfig) -> LiftedDetection | Outcome:
    """One box, (4,) pixels with pixel centres at integers, in space.

    Depth is the median of the box's centre; the object's centre lies behind that surface by most of its half depth.

    The half depth is unknown from one view: the smaller half extent stands in for it, and its share in the range's
    noise says so.
    """
    k = frame.intrinsics
    centre_px, sides = (xyxy[:2] + xyxy[2:]) / 2.0, xyxy[2:] - xyxy[:2]
    if not np.all(sides > 0.0):
        return Outcome.NO_DEPTH
    readings = _central_depth(frame.depth, centre_px, sides * config.central_share / 2.0)
    if len(readings) < config.min_readings:
        return Outcome.NO_DEPTH
    z = float(np.median(readings))
    if z > config.max_range:
        return Outcome.OUT_OF_RANGE
    half_width, half_height = sides / 2.0 * z / np.array([k.fx, k.fy])
    half_depth = min(half_width, half_height)
    surface = k.back_project(centre_px[None], np.array([z]))[0]
    distance = float(np.linalg.norm(surface))
    spread = 1.4826 * float(np.median(np.abs(readings - z)))
    noise = config.sensor_noise * z * z
    seen = _sides_seen(xyxy, k.width, k.height, config.border)
    across = config.sigma_tangential if seen.all() else 1.0  # the centre of a cut box is not the object's
    return LiftedDetection(
        scores=scores,
        xyxy=xyxy,
        sides_seen=seen,
        sigma_px=config.sigma_px + config.sigma_relative * float(np.sqrt(sides.prod())),
        centre=surface * (1.0 + config.surface_offset * half_depth / distance),
        sigma_tangential=max(noise, across * float(np.sqrt(half_width * half_height))),
        sigma_range=float(np.sqrt(noise**2 + spread**2 + (config.sigma_range * half_depth) ** 2)),
        half_extents=np.array([half_width, half_depth, half_height]),
    )


def _central_depth(depth: np.ndarray, centre: np.ndarray, half: np.ndarray) -> np.ndarray:
    (x0, y0), (x1, y1) = np.floor(centre - half).astype(int), np.ceil(centre + half).astype(int) + 1
    crop = depth[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)]
    return crop[crop > 0.0]


def _sides_seen(xyxy: np.ndarray, width: int, height: int, border: int) -> np.ndarray:
    return np.array([xyxy[0] > border, xyxy[1] > border, xyxy[2] < width - 1 - border, xyxy[3] < height - 1 - border])

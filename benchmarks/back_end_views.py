"""What the keyframes of a simulated run hand to the back end: odometry, up, detections in space, what is hidden."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from back_end_world import KINECT, UP, World, camera_poses, clip, score_vector
from scipy.spatial.transform import Rotation

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.config import LiftingConfig, UpConfig, VisualConfig
from thingmap.mapper.estimation.lifting import LiftedDetection
from thingmap.mapper.trajectory.rigid import inverse

ODOMETRY_SIGMAS = np.repeat([0.002, 0.004], 3)  # rad, m: one keyframe step of KISS-ICP on hand-held RGB-D
MIN_IN_IMAGE = 0.4  # share of a box in the image below which a detector does not respond
BORDER = LiftingConfig().border
DETECTION = generic_evidence_model().detection


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredMotion:
    """(4, 4) motion from keyframe `a` to this one, with its (6, 6) covariance [rad, m]."""

    a: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedView:
    """One keyframe.

    Attributes:
        keyframe: its number.
        T_world_camera: (4, 4) true.
        odometry: from the keyframe before; None for the first.
        visual: from the last two, as image features give it.
        up: (3,) measured, camera axes; None where no plane was looked for.
        occluded: (N,) hidden share of every thing of the world.
        in_image: (N,) share of every thing's box in the image.
        detections: thing -> its detection.
    """

    keyframe: int
    T_world_camera: np.ndarray
    odometry: MeasuredMotion | None
    visual: tuple[MeasuredMotion, ...]
    up: np.ndarray | None
    occluded: np.ndarray
    in_image: np.ndarray
    detections: dict[int, LiftedDetection]


def simulate(world: World, keyframes: int, laps: float, rng: np.random.Generator) -> Iterator[SimulatedView]:
    """Views of a camera that goes along the room and back `laps` times."""
    poses = camera_poses(keyframes, laps)
    visual_sigmas = np.repeat(VisualConfig().covariance_floor, 3)
    for t, T in enumerate(poses):
        back = range(max(t - VisualConfig().neighbours, 0), t)
        xyxy, in_image = world.view(T)
        occluded = world.occlusion(T)
        yield SimulatedView(
            keyframe=t,
            T_world_camera=T,
            odometry=_motion(poses, t - 1, t, ODOMETRY_SIGMAS, rng) if t else None,
            visual=tuple(_motion(poses, a, t, visual_sigmas, rng) for a in back),
            up=_up(T, rng) if t % UpConfig().every == 0 else None,
            occluded=occluded,
            in_image=in_image,
            detections=_detections(world, T, xyxy, in_image, occluded, rng),
        )


def _motion(poses: np.ndarray, a: int, b: int, sigmas: np.ndarray, rng: np.random.Generator) -> MeasuredMotion:
    error = sigmas * rng.normal(size=6)
    noise = np.eye(4)
    noise[:3, :3], noise[:3, 3] = Rotation.from_rotvec(error[:3]).as_matrix(), error[3:]
    return MeasuredMotion(a, inverse(poses[a]) @ poses[b] @ noise, np.diag(sigmas**2))


def _up(T: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    up = T[:3, :3].T @ UP + UpConfig().plane_sigma * rng.normal(size=3)
    return up / np.linalg.norm(up)


def _detections(
    world: World,
    T: np.ndarray,
    xyxy: np.ndarray,
    in_image: np.ndarray,
    occluded: np.ndarray,
    rng: np.random.Generator,
) -> dict[int, LiftedDetection]:
    sides = np.maximum(xyxy[:, 2:] - xyxy[:, :2], 0.0)
    visible = in_image * (1.0 - occluded)
    chance = world.rate * DETECTION.relative(visible, np.sqrt(sides.prod(axis=1)))
    found = np.flatnonzero((rng.random(len(world)) < chance) & (in_image > MIN_IN_IMAGE))
    detections = {}
    for j in found.tolist():
        scores = score_vector(world, j, float(occluded[j]), rng)
        detections[j] = _detection(world.positions[j], T, xyxy[j], float(visible[j]), scores, rng)
    return detections


def _detection(
    position: np.ndarray, T: np.ndarray, xyxy: np.ndarray, visible: float, scores: np.ndarray, rng: np.random.Generator
) -> LiftedDetection:
    """A noisy box and centre with the standard deviations that `lift_box` would state for them."""
    config, share = LiftingConfig(), np.sqrt(max(visible, 0.1))
    centre = (position - T[:3, 3]) @ T[:3, :3]
    distance = float(np.linalg.norm(centre))
    sigma_px = config.sigma_px + config.sigma_relative * float(np.sqrt((xyxy[2:] - xyxy[:2]).prod()))
    box = clip((xyxy + sigma_px / share * rng.normal(size=4))[None])[0]
    box[2:] = np.maximum(box[2:], box[:2] + 2.0)  # never empty
    half_width, half_height = (box[2:] - box[:2]) / 2.0 * centre[2] / np.array([KINECT.fx, KINECT.fy])
    half_depth, noise = min(half_width, half_height), config.sensor_noise * centre[2] ** 2
    limits = np.array([KINECT.width, KINECT.height]) - 1 - BORDER
    seen = np.concatenate([box[:2] > BORDER, box[2:] < limits])
    across = config.sigma_tangential if seen.all() else 1.0
    tangential = max(noise, across * float(np.sqrt(half_width * half_height)))
    along = float(np.hypot(noise, config.sigma_range * half_depth))
    ray, error = centre / distance, rng.normal(size=3)
    radial = (error @ ray) * ray
    shift = along * radial + min(tangential, half_width) * (error - radial)
    return LiftedDetection(
        scores=scores,
        xyxy=box,
        sides_seen=seen,
        sigma_px=sigma_px,
        centre=centre + shift / share,
        sigma_tangential=tangential,
        sigma_range=along,
        half_extents=np.array([half_width, half_depth, half_height]),
    )

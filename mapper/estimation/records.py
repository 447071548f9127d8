"""What is measured, one class a kind: the entries of the ledger."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Gauge:
    """Where the first keyframe is: (4, 4) `T_world_camera` and its sigmas (rad, m)."""

    T_world_camera: np.ndarray
    sigmas: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Odometry between keyframes `a` and `b`: (4, 4) `T_a_b` and its (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """Motion between keyframes `a` and `b` from image features: (4, 4) `T_a_b`, (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Loop closure: keyframe `b` as seen from an earlier `a`: (4, 4) `T_a_b`, (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class DropLoop:
    """The `Loop` (or `Visual`) of this number in the ledger was found wrong: it leaves the graph."""

    record: int


@dataclass(frozen=True, slots=True, eq=False)
class ScanMatch:
    """Motion between keyframes `a` and `b` from their depth: (4, 4) `T_a_b`, (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class UpPrior:
    """What is known of the world's up direction beforehand: (3,) unit vector, world axes; sigma in rad."""

    direction: np.ndarray
    sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class Up:
    """Up as measured in one keyframe: (3,) unit vector, camera axes; sigma in rad."""

    keyframe: int
    direction: np.ndarray
    sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class NewLandmark:
    """A landmark enters the graph: (3,) position, world, metres; (3,) log half-axes."""

    landmark: int
    position: np.ndarray
    log_size: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class DepthCentre:
    """Object centre from depth: (3,) camera frame, metres; sigmas across and along the ray, metres."""

    keyframe: int
    landmark: int
    centre: np.ndarray
    sigma_tangential: float
    sigma_range: float
    visibility: float


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """Detection box (4,) pixels; (4,) bool, sides that are not cut off by the image border; sigma in pixels.

    `part` is the `VolumePart` that the box shows.
    """

    keyframe: int
    landmark: int
    xyxy: np.ndarray
    sides_seen: np.ndarray
    sigma_px: float
    part: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What one keyframe by itself said about a landmark: hits, misses, log likelihood of the free ratio (nats).

    `visible` (5,) is the share of every `VolumePart` that was seen, `depth` the mean log ratio of the depth likelihood
    (nats); `free` and `depth` are times `seen`, the share of the volume that depth told of. How new the view was is
    known from the poses.
    """

    keyframe: int
    landmark: int
    hits: float
    misses: float
    free: float
    visible: np.ndarray = field(default_factory=lambda: np.ones(5, dtype=np.float32))
    depth: float = 0.0
    seen: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """Detector scores (K,) of a landmark's `VolumePart`, the part's occlusion then, and the view's weight."""

    keyframe: int
    landmark: int
    scores: np.ndarray
    occlusion: float
    weight: float
    part: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """The Gaussian stand-in for the class mixture on a landmark's size: (3,) mean, (3, 3) information."""

    landmark: int
    mean: np.ndarray
    information: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Merge:
    """`absorbed` turned out to be `kept`: its measurements count for `kept` from now on."""

    kept: int
    absorbed: int


@dataclass(frozen=True, slots=True, eq=False)
class Retire:
    """The landmark is no object: its measurements leave the graph."""

    landmark: int


@dataclass(frozen=True, slots=True, eq=False)
class DropMeasurement:
    """The `DepthCentre`, `Box`, `Look` or `Scores` of this number was of something else: it leaves the graph."""

    record: int


@dataclass(frozen=True, slots=True, eq=False)
class Revive:
    """A retired landmark was there all along: its measurements come back. (3,) position and log half-axes to start."""

    landmark: int
    position: np.ndarray
    log_size: np.ndarray


Record = (
    Gauge
    | Motion
    | Visual
    | ScanMatch
    | Loop
    | DropLoop
    | UpPrior
    | Up
    | NewLandmark
    | DepthCentre
    | Box
    | Look
    | Scores
    | Site
    | Merge
    | Retire
    | DropMeasurement
    | Revive
)
KINDS: tuple[type, ...] = (
    Gauge, Motion, Visual, ScanMatch, Loop, DropLoop, UpPrior, Up,
    NewLandmark, DepthCentre, Box, Look, Scores, Site, Merge, Retire, DropMeasurement, Revive,
)  # fmt: skip
Link = Motion | Visual | ScanMatch | Loop  # between two keyframes

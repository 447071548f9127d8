"""Every number of the mapper: its default, its unit and where it came from.

One YAML file may override any of it (`config_file.load_config`); its keys are the field names below.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from ..factors.free_space import FreeSpace


class OdometrySource(Enum):
    """Where the relative motion between keyframes comes from."""

    KISS_ICP = "kiss-icp"
    POSES = "poses"


@dataclass(frozen=True, slots=True)
class OdometryConfig:
    """KISS-ICP on depth images: a preset measured on hand-held RGB-D, where its own defaults (for LiDAR) fail."""

    source: OdometrySource = OdometrySource.KISS_ICP
    pixel_step: int = 4  # every 4th pixel in both directions: 17k points of 640x480
    min_range: float = 0.3  # m, below it a Kinect reads nothing
    max_range: float = 3.5  # m; the range cap is decisive: depth noise grows with z^2
    voxel_size: float = 0.08  # m
    initial_threshold: float = 0.1  # m, first correspondence threshold
    min_motion: float = 0.005  # m, motion below which the adaptive threshold does not learn
    max_iterations: int = 50
    threads: int = 2
    covariance_floor: tuple[float, float] = (0.003, 0.005)  # rad, m: makes NEES per dof of real keyframe steps about 1
    drift: tuple[float, float] = (0.01, 0.01)  # rad per rad turned, m per m moved: scan-to-map drift between keyframes
    pose_sigma: tuple[float, float] = (0.002, 0.004)  # rad, m: noise of given poses taken as measurements


@dataclass(frozen=True, slots=True)
class VisualConfig:
    """ORB features with depth between neighbouring keyframes, beside KISS-ICP."""

    enabled: bool = True
    features: int = 1000
    fast_threshold: int = 10  # grey levels
    neighbours: int = 1  # keyframes back that a new one is measured against; wider baselines match worse points
    ratio: float = 0.85  # of Lowe's test
    inlier_distance: float = 0.03  # m at 1 m and nearer, growing with z: three times a Kinect's depth noise at 2 m
    min_inliers: int = 30
    depth_range: tuple[float, float] = (0.3, 4.0)  # m
    covariance_floor: tuple[float, float] = (0.003, 0.004)  # rad, m: colour is only roughly registered to depth


@dataclass(frozen=True, slots=True)
class KeyframeConfig:
    """A frame becomes a keyframe when the camera has moved this far from the last one."""

    translation: float = 0.06  # m; about 3 degrees of parallax at 1.2 m
    rotation: float = 0.09  # rad (5 degrees)
    max_gap: int = 15  # frames (0.5 s at 30 Hz): a still camera still contributes


@dataclass(frozen=True, slots=True)
class UpConfig:
    """The up direction of the world, a variable of the graph."""

    prior_sigma: float = 0.6  # rad, a hand-held camera is roughly upright
    plane_sigma: float = 0.2  # rad; a room's normals are off by 1-4 degrees together, so each must say little
    accelerometer_sigma: float = 0.08  # rad, hand accelerations of about 0.8 m/s^2
    gravity_sigma: float = 0.01  # rad, a gravity file
    max_tilt: float = 0.8  # rad, planes further than this from the current up are not supports (walls)
    min_plane_share: float = 0.06  # of the valid pixels
    every: int = 2  # keyframes between plane searches (9 ms each)
    upright_tolerance: float = 0.026  # rad (1.5 degrees): volumes are turned when up has moved further


@dataclass(frozen=True, slots=True)
class LiftingConfig:
    """From a 2D box and the depth map to a 3D measurement."""

    min_confidence: float = 0.08  # boxes below it are noise; low, because misses are counted as evidence too
    central_share: float = 0.5  # of width and height: the part of the box whose depth is read
    min_readings: int = 12  # pixels with depth
    max_range: float = 6.0  # m, beyond it Kinect depth is worse than 10 cm
    surface_offset: float = 0.7  # of the half depth, from that surface to the centre: 1 for a box, 0 for a flat thing
    border: int = 3  # px: a box side this close to the image border is cut off by it
    sigma_px: float = 2.5  # px, floor of a box side's noise
    sigma_relative: float = 0.06  # of the box's side lengths: noise of a box side grows with the box
    sigma_tangential: float = 0.3  # of the half extents: a box's centre is this close to the object's
    sigma_range: float = 1.5  # of the object's assumed half depth; views share the error, so each must say little
    sensor_noise: float = 0.0028  # m at 1 m, growing with z^2 (Khoshelham and Elberink 2012: 1.425 mm/m^2 a reading)


@dataclass(frozen=True, slots=True)
class AssociationConfig:
    """Which detection shows which landmark: box overlap, depth position, class as evidence and never as a gate."""

    gate: float = 16.27  # chi-square, 3 degrees of freedom, 99.9 %
    centre_variance: float = 0.25  # of the box scale squared (Meger et al., Clutter, footnote 2)
    scale_variance: float = 0.1  # of log scale; 0.5 in the same place, for a detector with coarser boxes
    min_visible: float = 0.1  # landmarks seen less than this are not associated
    new_cost: float = 14.0  # nats-like cost at which a detection is rather something new
    class_weight: float = 0.5  # views share errors, so a view's class evidence counts half
    duplicate_overlap: float = 0.55  # share of a box inside an explained one at the same place: the same object again
    duplicate_scale: float = 0.35  # of the projected box's side: smaller boxes are other things or parts
    position_floor: float = 0.03  # m, pose error between a view and the landmarks of older views


@dataclass(frozen=True, slots=True)
class TrackConfig:
    """Candidates, followed by a Kalman filter until they earn a landmark."""

    min_existence: float = 0.3  # probability that it is an object, from which it is a landmark however few its views
    min_hits: int = 3  # keyframes that make it a landmark however doubtful
    min_hit_rate: float = 0.3  # hits / keyframes in which it should have been seen
    max_misses: int = 6  # keyframes in a row where it should have been seen
    process_sigma: float = 0.01  # m per keyframe, odometry drift against the map


@dataclass(frozen=True, slots=True)
class BeliefConfig:
    """Class and existence: how much each kind of evidence counts."""

    view_angle: float = 0.17  # rad (10 degrees): views closer than this are not independent (Georgakis et al., eq. 2)
    view_log_range: float = 0.3  # the same for log distance
    repeat_correlation: float = 0.9  # of looks from the same place: at most 1.1 views' worth, however many
    size_outlier: float = 0.05  # objects of which only a part is ever measured, such as chairs pushed under a table
    site_tolerance: float = 0.05  # symmetric change of a size site below which it is left as it is
    size_coupling: bool = True  # off: sizes say nothing of classes, nor classes of sizes


@dataclass(frozen=True, slots=True)
class PresenceConfig:
    """When a thing that was there counts as taken away."""

    hazard: float = 1e-4  # probability of it between two looks: about seven clear looks make it likelier than not
    detected: float = 3.0  # nats, a detection against it; as many as one look through it says for it at most
    usual_most: float = (
        0.4  # share that a first look from somewhere may show and still be usual from there; tried: with
    )
    # 0.3 a thing that a detector hardly ever finds is lost before a still camera, with 0.5 a cup taken away is kept
    usual_free: float = 0.15  # share of an object's volume that is free, before it is known for the one at hand


@dataclass(frozen=True, slots=True)
class EvidenceConfig:
    """The likelihoods outside the graph; each says where its numbers come from.

    The switches turn a kind of evidence off, to measure what it is worth (benchmarks/run.py).
    """

    occlusion: bool = True  # off: as if nothing were ever hidden, nor seen through (Meger et al., Clutter, VI-C)
    misses: bool = True  # off: what should have been seen and was not says nothing
    depth: bool = True  # off: depth at an object's place says nothing for or against it
    parts: bool = True  # off: detections of object parts are not used
    model: str = ""  # path of an evidence model that `thingmap learn` wrote; "generic" for none; empty: the shipped one
    # for a detector of its classes, the generic one for others
    free_space: FreeSpace = field(default_factory=FreeSpace)
    presence: PresenceConfig = field(default_factory=PresenceConfig)


@dataclass(frozen=True, slots=True)
class SmootherConfig:
    """ISAM2; thresholds measured with 1000 keyframes and 100 objects (benchmarks/throughput.py)."""

    relinearize_skip: int = 10  # updates
    threshold_rotation: float = 0.02  # rad
    threshold_translation: float = 0.1  # m
    threshold_position: float = 0.1  # m
    threshold_size: float = 0.1  # log units
    threshold_up: float = 0.02  # rad
    guard_position: float = 10.0  # m, weak permanent prior on positions
    guard_size: float = 1.5  # log units, weak permanent prior on sizes
    robust_odometry: bool = False
    joint: bool = True  # off: objects do not move cameras; each is estimated by itself from poses taken as exact


@dataclass(frozen=True, slots=True)
class LifecycleConfig:
    """Merging and retirement."""

    merge_gate: float = 16.81  # chi-square, 6 degrees of freedom, 99 %: two positions (joint covariance) and sizes
    merge_log_size: float = 0.35  # log units, boxes of one object differ this much with what of it was visible
    merge_overlap: float = 0.15  # intersection over the smaller volume that makes two things one
    merge_every: int = 5  # keyframes
    merge_extent: float = 0.5  # of the mean half axis: a partly seen object's centre is this uncertain
    retire_below: float = 0.02  # existence
    retire_views: float = 3.0  # effective views before a landmark can be retired


class ScorePotential(Enum):
    """What a detector's score says for a hypothesis, Psi_s (Meger et al., Explicit Occlusion, 2.3; Clutter, III-D)."""

    OCCLUSION = "occlusion"  # learned densities, given how much is hidden
    LINEAR = "linear"  # a line from -1 to 1
    PLATT = "platt"  # log odds of Platt's probability


@dataclass(frozen=True, slots=True)
class BatchConfig:
    """Inference over a fixed set of views, as both papers of Meger et al. do it (`run --inference batch`)."""

    samples: int = 300  # volumes drawn from detections, by score (Explicit Occlusion, section 3)
    max_iterations: int = 10  # association and optimisation, alternating; about 4 are needed (Clutter, V)
    sliding_spacing: float = 0.5  # of a class's mean size, between neighbouring sliding volumes (Clutter, V)
    score_potential: ScorePotential = ScorePotential.OCCLUSION
    overlap: float = 0.25  # intersection over union in space above which the less likely of two volumes is suppressed


@dataclass(frozen=True, slots=True)
class CloudConfig:
    """The coloured cloud that is written beside the map."""

    voxel_size: float = 0.02  # m
    pixel_step: int = 4
    max_range: float = 4.0  # m


@dataclass(frozen=True, slots=True)
class MapperConfig:
    """Everything together."""

    seed: int = 0
    class_sizes: str = ""  # path of an own YAML of class sizes, added to the shipped one
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    visual: VisualConfig = field(default_factory=VisualConfig)
    keyframes: KeyframeConfig = field(default_factory=KeyframeConfig)
    up: UpConfig = field(default_factory=UpConfig)
    lifting: LiftingConfig = field(default_factory=LiftingConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    tracks: TrackConfig = field(default_factory=TrackConfig)
    beliefs: BeliefConfig = field(default_factory=BeliefConfig)
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)
    lifecycle: LifecycleConfig = field(default_factory=LifecycleConfig)
    batch: BatchConfig = field(default_factory=BatchConfig)
    cloud: CloudConfig = field(default_factory=CloudConfig)

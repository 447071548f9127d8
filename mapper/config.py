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
    SMALL_GICP = "small-gicp"
    POSES = "poses"  # the dataset's own
    FILE = "file"  # a trajectory of another system, at `path`


@dataclass(frozen=True, slots=True)
class FlowConfig:
    """Optical flow between neighbouring frames, at half resolution."""

    corners: int = 250
    quality: float = 0.01  # of the best corner's score
    spacing: int = 7  # px of the small image, between corners
    window: int = 15  # px
    levels: int = 4  # of the pyramid: motions up to about 100 px of the small image
    inlier_distance: float = 0.03  # m at 1 m and nearer, growing with z, as VisualConfig's
    min_inliers: int = 20


@dataclass(frozen=True, slots=True)
class GicpConfig:
    """small_gicp against a model of Gaussians, one a voxel; measured on 300 frames each of a render and redkitchen."""

    spacing: float = 0.05  # m between the points of a frame
    neighbours: int = 20  # points that a point's plane is fitted to; with 10, a table-top's noise lets it slip
    voxel_size: float = 0.1  # m, of the model
    correspondence: float = 0.3  # m, three voxels
    max_iterations: int = 20
    step: tuple[float, float] = (0.08, 0.05)  # rad, m: the model takes a frame in when the camera has moved this far
    horizon: int = 100  # frames taken in, after which a voxel that nothing fell into is forgotten: 5 m of way
    min_match: float = 0.5  # of a frame's points in the model, below which it is lost
    degenerate_ratio: float = 0.02  # smallest / largest of the translation: walls .003, rooms from .05
    # of a step: set so that, on rendered hand-held sequences, NEES per dof of poses 1, 5 and 20 keyframes apart, by all
    # links together, is 0.7, 1.1 and 1.4; steps by themselves then have 0.5
    inflation: float = 0.5  # of the point-to-plane covariance, which takes a sample of the points
    covariance_floor: tuple[float, float] = (0.0005, 0.0008)  # rad, m
    drift: tuple[float, float] = (0.003, 0.003)  # rad per rad turned, m per m moved
    guess_sigma: tuple[float, float] = (0.02, 0.01)  # rad, m: a hand's 20 rad/s^2 and 10 m/s^2 over 1/30 s
    image_sigma: tuple[float, float] = (0.003, 0.004)  # rad, m: of optical flow over a frame, 0.14 degrees and 2.7 mm
    far_apart: float = 0.2  # s between frames, from which the image tells better than the motion where to start
    open_sigma: float = 0.1  # m, of a step along what its planes leave open: a hand's 1 m/s^2 over 0.5 s
    lost_frames: int = 15  # lost in a row (0.5 s at 30 Hz), after which a new model begins
    lost_sigma: tuple[float, float] = (0.5, 0.5)  # rad, m: of a step that nothing measured; with (1, 2), beside links
    # of half a millimetre, GTSAM called the graph indeterminate


@dataclass(frozen=True, slots=True)
class LidarConfig:
    """KISS-ICP on a LiDAR's sweeps, with its own defaults where it has any (Vizzo et al. 2023, table I)."""

    max_range: float = 100.0  # m
    min_range: float = 1.0  # m, nearer is what carries the scanner
    voxel_size: float = 1.0  # m, of the map: a hundredth of max_range, as KISS-ICP has it
    initial_threshold: float = 2.0  # m, first correspondence threshold
    min_motion: float = 0.1  # m, motion below which the adaptive threshold does not learn
    max_iterations: int = 500
    deskew: bool = True  # take the motion within a sweep out, where its points have times
    elevation_offset: float = 0.0  # rad, added to every point's; KITTI's scans are 0.0036 (0.205 degrees) too low
    plane_radius: float = 1.5  # m, of the map around a point to which its plane is fitted
    min_match: float = 0.3  # of a sweep's points on a plane of the map, below which it is lost
    max_residual: float = 0.5  # m, robust deviation from those planes, above which it is lost
    degenerate_ratio: float = 0.02  # of the translation's eigenvalues, as GicpConfig.degenerate_ratio
    guess_sigma: tuple[float, float] = (0.02, 0.1)  # rad, m: a vehicle's 2 rad/s^2 and 10 m/s^2 over 0.1 s
    lost_frames: int = 5  # lost in a row (0.5 s at 10 Hz), after which a new map begins
    lost_sigma: tuple[float, float] = (0.2, 2.0)  # rad, m: what a vehicle may do unseen in that time
    covariance_floor: tuple[float, float] = (0.001, 0.025)  # rad, m: NEES per dof of steps along a cast street 0.8
    drift: tuple[float, float] = (0.005, 0.005)  # rad per rad turned, m per m moved


@dataclass(frozen=True, slots=True)
class OdometryConfig:
    """KISS-ICP on depth images: a preset measured on hand-held RGB-D, where its own defaults (for LiDAR) fail."""

    source: OdometrySource = OdometrySource.KISS_ICP
    path: str = ""  # of a trajectory with `source: file`: rows `stamp tx ty tz qx qy qz qw`, camera to world
    pixel_step: int = 4  # every 4th pixel in both directions: 17k points of 640x480
    min_range: float = 0.3  # m, below it a Kinect reads nothing
    max_range: float = 3.5  # m; the range cap is decisive: depth noise grows with z^2
    voxel_size: float = 0.12  # m; 0.08 took twice the time and led to the same refined poses
    initial_threshold: float = 0.1  # m, first correspondence threshold
    min_motion: float = 0.005  # m, motion below which the adaptive threshold does not learn
    max_iterations: int = 10  # the pose is refined afterwards; 50 changed nothing but the time
    threads: int = 2
    covariance_floor: tuple[float, float] = (0.003, 0.005)  # rad, m: makes NEES per dof of real keyframe steps about 1
    drift: tuple[float, float] = (0.01, 0.01)  # rad per rad turned, m per m moved: scan-to-map drift between keyframes
    pose_sigma: tuple[float, float] = (0.002, 0.004)  # rad, m: noise of given poses taken as measurements
    path_sigma: tuple[float, float] = (0.003, 0.005)  # rad, m: noise of a step of the trajectory at `path`
    path_drift: tuple[float, float] = (0.01, 0.01)  # its growth: rad per rad turned, m per m moved
    gicp: GicpConfig = field(default_factory=GicpConfig)
    flow: FlowConfig = field(default_factory=FlowConfig)
    lidar: LidarConfig = field(default_factory=LidarConfig)

    def __post_init__(self) -> None:
        if (self.source is OdometrySource.FILE) != bool(self.path):
            raise ValueError(
                f"source {self.source.value} with path {self.path!r}; `file` needs a path, others have none"
            )


@dataclass(frozen=True, slots=True)
class VisualConfig:
    """ORB features with depth between neighbouring keyframes, beside KISS-ICP."""

    enabled: bool = True
    features: int = 1000
    fast_threshold: int = 10  # grey levels
    few_features: int = 600  # below which faint ones are looked for; a kitchen's frames have 670 to 960, before a plain
    # cabinet in an empty hall 50 to 660: with faint ones 55 of 57 steps of 0.2 m were measured there, else 33
    faint_features: int = 2000
    faint_threshold: int = 4  # grey levels
    neighbours: int = 1  # keyframes back that a new one is measured against; wider baselines match worse points
    ratio: float = 0.85  # of Lowe's test
    inlier_distance: float = 0.03  # m at 1 m and nearer, growing with z: three times a Kinect's depth noise at 2 m
    min_inliers: int = 30
    depth_range: tuple[float, float] = (0.3, 4.0)  # m
    gate: float = 22.46  # chi-square, 6 degrees of freedom, 99.9 %: odometry that contradicts features is doubted
    covariance_floor: tuple[float, float] = (0.003, 0.004)  # rad, m: colour is only roughly registered to depth


@dataclass(frozen=True, slots=True)
class ScanConfig:
    """Matching the depth of two keyframes by GICP; measured on rendered hand-held sequences and redkitchen."""

    spacing: float = 0.03  # m between points: 1.4 mm median error; 0.04: 1.9, 0.025: 1.2 at twice the time
    neighbours: int = 20  # points that a point's plane is fitted to; with 10 a table-top's noise lets it slip
    reaches: tuple[float, ...] = (0.08, 0.04)  # m, partners are looked for within, first and last
    max_iterations: int = 20  # each
    min_share: float = 0.4  # of the smaller scan's points that must have a partner
    degenerate_ratio: float = 0.02  # of the translation's eigenvalues, as GicpConfig.degenerate_ratio
    open_sigma: float = 0.2  # m, along what planes leave open: before one side of a cabinet matches slid 0.1-0.4 m
    inflation: float = 0.35  # of the point-to-plane covariance: all points were matched, not its sample
    covariance_floor: tuple[float, float] = (0.0003, 0.0005)  # rad, m


@dataclass(frozen=True, slots=True)
class HybridConfig:
    """Open3D's hybrid RGB-D odometry between keyframes; measured on rendered hand-held pairs and redkitchen."""

    enabled: bool = True  # of use where geometry is degenerate only
    iterations: tuple[int, ...] = (20, 10, 5, 2)  # coarsest to full resolution; with three levels 20 px are too far
    max_distance: float = 0.07  # m between two depths of one pixel, beyond which one hides the other
    depth_range: tuple[float, float] = (0.3, 4.5)  # m
    min_share: float = 0.5  # of b's depth readings that must agree
    max_shift: float = 1.5  # px between edges of equal brightness: right motions at most 0.3 (rendered), wrong ones 2-9
    min_inliers: int = 1000  # pixels
    max_correction: tuple[float, float] = (0.3, 0.3)  # rad, m: an answer this far from the guess is a wrong one
    pixel_step: int = 4  # px between the points that the covariance is computed from
    blur: float = 1.5  # px, before brightness gradients are taken
    min_gradient: float = 1.0  # grey levels a pixel, what noise leaves after that blur
    # pixels of brightness, of depth, that count as independent: NEES per dof 0.95 on rendered pairs of a wall, 1.7 on
    # redkitchen (its poses taken as known to 4 mrad, 5 mm), where colour lies beside depth; 0.1 on a rendered table-top
    samples: tuple[int, int] = (30, 4)
    covariance_floor: tuple[float, float] = (0.0002, 0.0002)  # rad, m
    guess_sigma: tuple[float, float] = (0.1, 0.2)  # rad, m, where nothing is to be seen


@dataclass(frozen=True, slots=True)
class KeyframeConfig:
    """A frame becomes a keyframe when the camera has moved this far from the last one."""

    translation: float = 0.06  # m; about 3 degrees of parallax at 1.2 m
    rotation: float = 0.09  # rad (5 degrees)
    max_gap: int = 15  # frames (0.5 s at 30 Hz): a still camera still contributes
    lost_gap: int = 5  # frames while LOST: the motion is a guess, and images a few frames apart may bridge it


@dataclass(frozen=True, slots=True)
class PlaceConfig:
    """Keyframes recognised by appearance; numbers from benchmarks/places.py."""

    votes: int = 5  # keyframes that a feature votes for; 3 to 8 are alike
    max_distance: int = 63  # bits of 256 between a feature and one it votes for; 55 finds less, 70 nothing more
    max_comparisons: int = 150_000  # of features in a query, 3 ms; beyond it those of rare words are asked alone
    neighbours: int = 2  # keyframes on both sides of a better one that are not named beside it
    unseen: int = 20  # keyframes added to the average without a vote: a few keyframes of one place are no background
    min_score: float = 0.015  # share of features; nine of ten revisits of a recorded kitchen score more


@dataclass(frozen=True, slots=True)
class LoopConfig:
    """Links between keyframes that are not neighbours: by depth where it is known where they are, else by the image."""

    enabled: bool = True
    appearance: bool = True  # places are recognised by their images
    constellation: bool = True  # and by the things in them
    process: bool = True  # matching is done by another process; off: here, with the same result
    lag: int = 5  # keyframes after which links enter the graph: 1 s, in which the other process makes them
    place_spacing: tuple[float, float] = (0.1, 0.1)  # rad, m: a keyframe is remembered if no place is as near
    reach: tuple[float, float] = (0.5, 0.5)  # rad, m, within which two views overlap enough to be matched by depth
    skip: int = 3  # keyframes between ends of a link; nearer ones are tied by odometry
    ages: tuple[int, ...] = (8, 40)  # keyframes: a link each to the nearest place younger, in between, and older
    known: tuple[float, float] = (0.03, 0.05)  # rad, m: deviation of a relative pose up to which depth needs no image
    gate: float = 22.46  # chi-square, 6 degrees of freedom, 99.9 %: a link this far from the estimate is refused
    gate_floor: tuple[float, float] = (0.005, 0.01)  # rad, m: of the estimate, for what its covariance leaves out
    candidates: int = 3  # places that look alike, verified for a keyframe
    min_age: int = 30  # keyframes, from which a place that looks alike closes a loop
    min_inliers: int = 25  # matched features that agree on one motion
    agreement: tuple[float, float] = (0.05, 0.08)  # rad, m: between the motions by features and by depth
    check_every: int = 20  # keyframes between checks of all loops by GNC, if there are new ones
    check_lag: int = 10  # keyframes until a check's verdict enters the graph
    probability: float = 0.9999  # with which a right loop passes the check
    patience: int = 60  # keyframes without a known place after which the map goes on from a guessed one
    constellation_every: int = 10  # keyframes


@dataclass(frozen=True, slots=True)
class ConstellationConfig:
    """Things that were mapped twice, once before and once after the camera drifted, recognised by how they lie."""

    recent_keyframes: int = 60  # a recent thing was first seen within these; about a quarter of a lap of two rooms
    old_keyframes: int = 60  # an old thing was not seen within these
    again_keyframes: int = 10  # an old thing seen within these was seen again: as often as LoopConfig asks
    min_existence: float = 0.7  # only things one is sure of
    min_matches: int = 3  # things; with two any pair of cups lies on any other
    sigma_position: float = 0.02  # m, floor of a centre's noise against its neighbours
    sigma_extent: float = 0.15  # of the mean half axis: a centre moves when the thing is seen from another side
    sigma_limit: float = 0.1  # m, above which a thing's place among its neighbours says too little: cut down to it
    sigma_size: float = 0.35  # log units between two boxes of one thing, as in LifecycleConfig.merge_log_size
    sigma_tilt: float = 0.03  # rad, of the correction against gravity: UpConfig.upright_tolerance
    gate: float = 11.34  # chi-square, 3 degrees of freedom, 99 %
    min_baseline: float = 0.2  # m, horizontal, between the two pairs that a correction is first made from
    class_error: float = 0.1  # probability that a class posterior says nothing
    min_class_ratio: float = 0.5  # of one class against any two, below which a pair is not tried; 0.19 at least
    detection: float = 0.6  # probability that a thing in view becomes a confident landmark again
    seen_before: float = 0.5  # prior share of recent things that are old ones, where the camera is at a known place
    view_radius: float = 0.5  # m around recent things within which an old one should have been mapped again
    spread: float = 0.1  # m, added to how far things are spread, for few of them
    prior_log_odds: float = -2.2  # that the camera is at a known place: 0.1
    min_log_odds: float = 2.0  # from which a correction is believed: 0.88; in made-up rooms 99 % of these are right
    max_pairs: int = 1500  # compatible pairs that are looked at, the most telling first
    max_corrections: int = 24  # weighed against each other
    max_candidates: int = 3  # pairs of keyframes proposed for a correction


@dataclass(frozen=True, slots=True)
class UpConfig:
    """The up direction of the world, a variable of the graph."""

    prior_sigma: float = 0.6  # rad, a hand-held camera is roughly upright
    plane_sigma: float = 0.2  # rad; a room's normals are off by 1-4 degrees together, so each must say little
    accelerometer_sigma: float = 0.08  # rad, hand accelerations of about 0.8 m/s^2
    gravity_sigma: float = 0.01  # rad, a gravity file
    scanner_sigma: float = 0.1  # rad, a LiDAR stands upright on what carries it
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
    noise_floor: float = 0.0  # m, the sensor's at any range: a LiDAR's 0.02
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
    scans: ScanConfig = field(default_factory=ScanConfig)
    hybrid: HybridConfig = field(default_factory=HybridConfig)
    keyframes: KeyframeConfig = field(default_factory=KeyframeConfig)
    loops: LoopConfig = field(default_factory=LoopConfig)
    places: PlaceConfig = field(default_factory=PlaceConfig)
    constellation: ConstellationConfig = field(default_factory=ConstellationConfig)
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

"""How the camera's motion from frame to frame is measured."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


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

"""Camera motion from the sweeps of a LiDAR, by KISS-ICP (Vizzo et al. 2023), which was made for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from kiss_icp.kiss_icp import KissICP
from scipy.spatial.transform import Rotation

from ....datasets.frame import BrokenFrame, Frame, FrameProblem
from ....datasets.lidar import LidarScan
from ....factors.plane_information import SAMPLES, PlaneInformation, point_to_plane_covariance
from ...config import OdometryConfig
from ..rigid import inverse, nearest_rigid, pose_covariance
from .kiss_config import kiss_config
from .odometry import KeyframeSteps, OdometryStep, Tracking, TrackingOutcome, weighed

MIN_POINTS = 200  # fewer returns in range than this cannot be registered
MAX_GAP = 5.0  # frames, over which the last velocity is taken to go on
THREADS = 2
DIGITS = 9  # KISS-ICP adds in parallel, so its last bits differ from run to run; a map, and the next guess, must not


class LidarOdometry:
    """Sweeps registered to a map of the sweeps before, in the axes of the camera beside the LiDAR.

    KISS-ICP's own steps (its voxel grid, adaptive threshold, registration and local map), but for three things. The
    motion within a sweep is taken out towards the frame's stamp, when the image was taken, and not towards the sweep's
    end. A sweep that is LOST (few points on the map's planes, or far from them) gets the guess for its pose and changes
    no map; after `lost_frames` of those a new map begins where the guesses have led. Where the planes leave a direction
    open (a tunnel), the pose follows the guess in it, and is DEGENERATE.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = c = config.lidar
        self._icp = KissICP(kiss_config(c, THREADS))
        self._keyframes = KeyframeSteps(c.covariance_floor, c.drift)
        self._T = np.eye(4)
        self._motion = np.eye(4)  # T_last_now of the last frame
        self._seconds = 0.0  # that it took
        self._stamp: float | None = None
        self._information: PlaneInformation | None = None
        self._lost_in_a_row = 0
        self._lost_since_keyframe = False

    def register(self, frame: Frame, guess: np.ndarray | None = None) -> Tracking:
        """`guess`: (4, 4) `T_last_now` of the camera; the last motion once more where None.

        Raises:
            BrokenFrame: there is no scan, or too few of its points are in range.
        """
        seconds = 0.0 if self._stamp is None else frame.stamp - self._stamp
        motion = self._expected(seconds) if guess is None else guess
        points = self._points(frame, motion, seconds)
        source, dense = self._icp.voxelize(points)
        outcome, T = TrackingOutcome.GOOD, self._T
        if self._stamp is not None:
            T, outcome = self._align(source, _rounded(self._T @ motion))
            self._motion, self._seconds = inverse(self._T) @ T, seconds
        self._T, self._stamp = T, frame.stamp
        if outcome is TrackingOutcome.LOST:
            self._lose(dense)
        else:
            self._lost_in_a_row = 0
            self._icp.local_map.update(dense, T)
        return Tracking(T, outcome)

    def keyframe(self) -> OdometryStep | None:
        covariance = np.zeros((6, 6))
        if self._information is not None:
            # two sweeps were matched to the same map
            covariance = 2.0 * self._information.covariance(*self._config.guess_sigma)
        if self._lost_since_keyframe:
            covariance = covariance + pose_covariance(self._config.lost_sigma)
        self._lost_since_keyframe = False
        return self._keyframes.step(self._T, covariance)

    def _expected(self, seconds: float) -> np.ndarray:
        """(4, 4) `T_last_now` after so long at the last velocity: a frame in between may be missing."""
        if self._seconds <= 0.0 or seconds <= 0.0:
            return self._motion
        share = np.array([min(seconds / self._seconds, MAX_GAP)])
        motion = np.eye(4)
        motion[:3, :3] = _rotations(self._motion, share).as_matrix()[0]
        motion[:3, 3] = share * self._motion[:3, 3]
        return motion

    def _points(self, frame: Frame, motion: np.ndarray, seconds: float) -> np.ndarray:
        """(N, 3) float64 metres, camera axes, within range, as seen from the frame's stamp."""
        if frame.scan is None:
            raise BrokenFrame(frame.name, FrameProblem.NO_DEPTH, "no LiDAR scan, as the frames before had")
        c, scan = self._config, frame.scan
        distance = np.linalg.norm(scan.points, axis=1)
        used = (distance > c.min_range) & (distance < c.max_range)
        if used.sum() < MIN_POINTS:
            raise BrokenFrame(frame.name, FrameProblem.NO_DEPTH, f"{used.sum()} returns in range")
        times = None if scan.times is None else scan.times[used]
        points = _raised(scan.points[used].astype(np.float64), c.elevation_offset)
        points = LidarScan(points, scan.T_camera_lidar).camera_points()
        if times is None or not c.deskew or seconds <= 0.0:
            return points
        share = times / seconds
        return _rotations(motion, share).apply(points) + share[:, None] * motion[:3, 3]

    def _align(self, source: np.ndarray, T_guess: np.ndarray) -> tuple[np.ndarray, TrackingOutcome]:
        c, icp = self._config, self._icp
        threshold = icp.adaptive_threshold.get_threshold()
        T = icp.registration.align_points_to_map(
            points=source,
            voxel_map=icp.local_map,
            initial_guess=T_guess,
            max_correspondance_distance=3.0 * threshold,
            kernel=threshold,
        )
        T = _rounded(T)
        planes = point_to_plane_covariance(source, T, icp.local_map.point_cloud(), radius_m=c.plane_radius)
        lost = planes.pairs < c.min_match * min(len(source), SAMPLES) or planes.residual_sigma_m > c.max_residual
        self._information = None if lost else planes
        if lost:
            return T_guess, TrackingOutcome.LOST
        if planes.translation_eigenvalue_ratio < c.degenerate_ratio:
            self._information = _opened(planes, c.degenerate_ratio)
            guess = np.linalg.inv(pose_covariance(c.guess_sigma))
            return weighed(T, self._information.information, T_guess, guess), TrackingOutcome.DEGENERATE
        icp.adaptive_threshold.update_model_deviation(inverse(T_guess) @ T)
        return T, TrackingOutcome.GOOD

    def _lose(self, points: np.ndarray) -> None:
        self._lost_since_keyframe = True
        self._lost_in_a_row += 1
        if self._lost_in_a_row >= self._config.lost_frames:
            self._lost_in_a_row = 0
            self._icp.local_map.clear()
            self._icp.local_map.update(points, self._T)


def _rounded(T: np.ndarray) -> np.ndarray:
    """To `DIGITS`, the rotation exact again: KISS-ICP ends the interpreter on a guess whose rotation is off by 1e-9."""
    return nearest_rigid(np.round(T, DIGITS))


def _opened(planes: PlaneInformation, ratio: float) -> PlaneInformation:
    """Without what is said of directions of translation weaker than a share of the strongest.

    Rings on a road and along walls seem to hold the way ahead: 300 points whose normals are off by a few degrees, all
    to the same side, are worth centimetres that are not there.
    """
    weak = planes.open_directions(ratio)
    kept = np.eye(6)
    kept[3:, 3:] -= weak @ weak.T
    return replace(planes, information=kept @ planes.information @ kept)


def _rotations(motion: np.ndarray, share: np.ndarray) -> Rotation:
    """(N,) shares of a motion's rotation."""
    return Rotation.from_rotvec(share[:, None] * Rotation.from_matrix(motion[:3, :3]).as_rotvec())


def _raised(points: np.ndarray, angle: float) -> np.ndarray:
    """(N, 3) points in lidar axes with their elevation above the x-y plane increased by an angle, rad."""
    if angle == 0.0:
        return points
    level = np.linalg.norm(points[:, :2], axis=1)
    elevation = np.arctan2(points[:, 2], level) + angle
    distance = np.linalg.norm(points, axis=1)
    scale = distance * np.cos(elevation) / np.maximum(level, 1e-9)
    return np.c_[points[:, :2] * scale[:, None], distance * np.sin(elevation)]

"""Camera motion by small_gicp (Koide 2024): every frame registered to a model of the frames before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import gtsam
import numpy as np
import small_gicp

from ....datasets.frame import Frame
from ....factors.plane_information import PlaneInformation, point_to_plane_covariance
from ...config import OdometryConfig
from ..depth_points import DepthPoints
from ..rigid import inverse, nearest_rigid, pose_covariance, retracted, tangent
from .gaussian_model import GaussianModel
from .image_motion import ImageMotion
from .odometry import KeyframeSteps, OdometryStep, Tracking, TrackingOutcome, weighed

EVEN = 1.5  # frames this many times as far apart in time as those before, or as near, come at their usual pace
MAX_GAP = 3.0  # times the last interval, for which the last velocity is taken to go on


@dataclass(frozen=True, slots=True, eq=False)
class _Guess:
    """Where a registration starts: (4, 4) pose, its (rad, m) standard deviations, and whether the image says so."""

    T: np.ndarray
    sigma: tuple[float, float]
    by_image: bool = False


class GicpOdometry:
    """Scan to model (see `GaussianModel`).

    A registration starts where the motion before leads; where that does not fit, where the image says, then at rest.

    A frame is DEGENERATE where the planes of the last keyframe leave a direction open: the registration is then weighed
    against the guess, the image's if it has one, by the information of both, so that an open direction follows the
    guess. It is LOST where few of its points fall into the model: its pose is the guess, and the model stays as it
    was. After `lost_frames` of those in a row a new model begins where the guesses have led. A step that was lost on
    the way says so by its covariance.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._points = DepthPoints(config.pixel_step, config.min_range, config.max_range)
        self._keyframes = KeyframeSteps(config.gicp.covariance_floor, config.gicp.drift)
        self._model = GaussianModel(config.gicp)
        self._image = ImageMotion(config.flow)
        self._T = np.eye(4)
        self._motion = np.eye(4)  # of the last frame, the next one's guess
        self._seconds = 0.0  # that it took
        self._stamp: float | None = None
        self._pace = 1.0  # time since the last frame, in those seconds
        self._source = np.empty((0, 3))  # points of the last frame, camera
        self._reference: np.ndarray | None = None  # points of the last keyframe, odometry's world
        self._open = np.zeros((6, 6))  # covariance of the last frame's pose along what its planes leave open
        self._open_at_keyframe = np.zeros((6, 6))
        self._T_keyframe = np.eye(4)
        self._lost_in_a_row = 0
        self._lost_since_keyframe = False

    def register(self, frame: Frame, guess: np.ndarray | None = None) -> Tracking:
        """Where this frame was; `guess` is a (4, 4) `T_last_now`, where None the last motion once more."""
        points = self._points(frame)
        cloud = self._model.prepare(points)
        self._source = cloud.points()[:, :3].copy()
        seconds = 0.0 if self._stamp is None else frame.stamp - self._stamp
        self._pace = seconds / self._seconds if seconds > 0.0 and self._seconds > 0.0 else 1.0
        T, outcome = self._T, TrackingOutcome.GOOD
        self._open = np.zeros((6, 6))
        if not self._model.empty:
            T, outcome = self._align(frame, points, cloud, guess)
        self._T, self._motion = T, inverse(self._T) @ T
        self._stamp, self._seconds = frame.stamp, seconds
        self._image.remember(frame)
        if outcome is TrackingOutcome.LOST:
            self._lose(cloud, points)
        else:
            self._lost_in_a_row = 0
            self._take_in(cloud, points)
        return Tracking(T, outcome)

    def keyframe(self) -> OdometryStep | None:
        covariance = np.zeros((6, 6))
        if self._reference is not None:
            covariance = self._covariance(point_to_plane_covariance(self._source, self._T, self._reference))
            # a frame that the model holds again tells of the drift until then: the step takes it back
            moved = gtsam.Pose3(nearest_rigid(inverse(self._T) @ self._T_keyframe)).AdjointMap()
            covariance = covariance + moved @ self._open_at_keyframe @ moved.T
        if self._lost_since_keyframe:
            covariance = covariance + pose_covariance(self._config.gicp.lost_sigma)
        lost = self._lost_in_a_row > 0
        self._lost_since_keyframe = lost  # the step away from a guessed pose is not known either
        self._T_keyframe, self._open_at_keyframe = self._T, self._open
        if not lost:
            self._reference = self._placed()
        return self._keyframes.step(self._T, covariance)

    def _approach(self, points: np.ndarray, T_guess: np.ndarray) -> np.ndarray:
        """A pose nearer to the truth than a guess, for those who know how."""
        return T_guess

    def _take_in(self, cloud: small_gicp.PointCloud, points: np.ndarray) -> None:
        """The last frame, as registered, becomes part of what the next ones are registered to."""
        self._model.take_in(cloud, self._T)

    def _start_anew(self, cloud: small_gicp.PointCloud, points: np.ndarray) -> None:
        """Forgets what frames are registered to, but for the last one."""
        self._model.clear()
        self._take_in(cloud, points)

    def _guesses(self, frame: Frame, guess: np.ndarray | None) -> Iterator[_Guess]:
        """The likeliest first; of frames at a camera's rate the image is only asked once the first has failed."""
        c = self._config.gicp
        wide = self._guess_sigma()
        by_motion = _Guess(self._T @ (self._expected() if guess is None else guess), wide)
        far_apart = self._stamp is not None and frame.stamp - self._stamp > c.far_apart
        if not far_apart:
            yield by_motion
        seen = self._image.since_last(frame)
        if seen is not None:
            yield _Guess(self._T @ seen, c.image_sigma, by_image=True)
        if far_apart:
            yield by_motion
        yield _Guess(self._T, wide)

    def _expected(self) -> np.ndarray:
        """(4, 4) `T_last_now` at the last velocity: frames in between may be missing."""
        if 1.0 / EVEN < self._pace < EVEN:
            return self._motion
        return retracted(np.eye(4), min(self._pace, MAX_GAP) * tangent(np.eye(4), self._motion))

    def _guess_sigma(self) -> tuple[float, float]:
        """(rad, m) of the motion prior: what a hand's acceleration does grows with the square of the time."""
        c = self._config.gicp
        if self._pace < EVEN:
            return c.guess_sigma
        turn, move = (min(self._pace**2 * s, lost) for s, lost in zip(c.guess_sigma, c.lost_sigma, strict=True))
        return turn, move

    def _align(
        self, frame: Frame, points: np.ndarray, cloud: small_gicp.PointCloud, guess: np.ndarray | None
    ) -> tuple[np.ndarray, TrackingOutcome]:
        c, weak = self._config.gicp, None
        guesses = list[_Guess]()
        for start in self._guesses(frame, guess):
            guesses.append(start)
            fit = self._model.align(cloud, self._approach(points, start.T))
            # the nearest match is no further than a correspondence: a pose beyond it has slid along something
            slid = np.linalg.norm(fit.T[:3, 3] - start.T[:3, 3]) >= c.correspondence
            if slid or fit.share < c.min_match:
                continue
            planes = self._open_directions(fit.T, fit.translation_ratio)
            if planes is None:
                return fit.T, TrackingOutcome.GOOD
            if weak is None or start.by_image:
                weak = _weigh(fit.T, planes, start)
                self._open[3:, 3:] = self._open_covariance(planes)
            if start.by_image:
                break
        if weak is not None:
            return weak, TrackingOutcome.DEGENERATE
        by_image = [g for g in guesses if g.by_image]
        return nearest_rigid((by_image or guesses)[0].T), TrackingOutcome.LOST

    def _open_directions(self, T: np.ndarray, translation_ratio: float) -> PlaneInformation | None:
        """What the planes in view say, if they leave a direction open; None where they do not."""
        limit = self._config.gicp.degenerate_ratio
        if self._reference is None or translation_ratio >= limit:
            return None
        planes = point_to_plane_covariance(self._source, T, self._reference)
        return planes if planes.translation_eigenvalue_ratio < limit else None

    def _covariance(self, planes: PlaneInformation) -> np.ndarray:
        """(6, 6) of a step: two scans were matched to the same model, and said nothing along an open direction."""
        covariance = self._config.gicp.inflation * planes.covariance()
        covariance[3:, 3:] += self._open_covariance(planes)
        return covariance

    def _open_covariance(self, planes: PlaneInformation) -> np.ndarray:
        """(3, 3) m^2 of a translation along what planes leave open."""
        c = self._config.gicp
        weak = planes.open_directions(c.degenerate_ratio)
        return c.open_sigma**2 * weak @ weak.T

    def _lose(self, cloud: small_gicp.PointCloud, points: np.ndarray) -> None:
        self._lost_since_keyframe = True
        self._lost_in_a_row += 1
        if self._lost_in_a_row > 1:
            self._motion = np.eye(4)  # a hand turns round: a stale motion leads further off than none
        if self._lost_in_a_row >= self._config.gicp.lost_frames:
            self._lost_in_a_row = 0
            self._start_anew(cloud, points)
            self._reference = self._placed()

    def _placed(self) -> np.ndarray:
        """(N, 3) the last frame's points, odometry's world, metres."""
        return self._source @ self._T[:3, :3].T + self._T[:3, 3]


def _weigh(T: np.ndarray, planes: PlaneInformation, guess: _Guess) -> np.ndarray:
    """The mean of the registered pose and the guess: an open direction follows the guess."""
    return weighed(T, planes.information, guess.T, np.linalg.inv(pose_covariance(guess.sigma)))

"""A detector for synthetic sequences: it knows the truth and errs as real detectors do.

It is no mirror of the mapper's likelihoods: scores are beta distributed about a logistic response to visibility, the
split over classes is Dirichlet, boxes err with Student's t, and what is hard from one direction stays hard from the
next one, so that errors of neighbouring frames are not independent.
"""

from __future__ import annotations

from zlib import crc32

import numpy as np

from ..datasets.errors import UserError
from ..datasets.frame import Frame
from ..datasets.truth import FrameTruth, HasTruth
from .detections import Detections
from .simulated_config import SimulatedDetectorConfig
from .simulated_spots import Spot, find_spots, unit, whole_of


class SimulatedDetector:
    """Detections of a sequence's own objects. Equal seeds and frame names give equal detections.

    Args:
        sequence: whose objects are known (`HasTruth`); frames must come from it.
        config: how good the detector is.
        seed: of all its errors.

    Raises:
        UserError: the sequence has no truth, the seed is negative, or nothing of the score is left for the true class.
    """

    def __init__(
        self,
        sequence: HasTruth,
        config: SimulatedDetectorConfig = SimulatedDetectorConfig(),  # noqa: B008
        seed: int = 0,
    ) -> None:
        if not isinstance(sequence, HasTruth):
            name = getattr(sequence, "name", type(sequence).__name__)
            raise UserError(
                f"{name}: expected a sequence whose objects are known (such as sample:tabletop), found none known; "
                "use a detector that looks at images"
            )
        if seed < 0:
            raise UserError(f"detector simulated: expected a seed >= 0, found {seed}; change it")
        self.config, self.seed = config, seed
        self.classes = sequence.classes
        self._sequence = sequence
        self._objects = {thing.id: thing for thing in sequence.objects}
        self._moods = {
            thing.id: _Mood(np.random.default_rng([seed, 1, thing.id]), config) for thing in sequence.objects
        }
        self._shares = _mean_shares(self.classes, config)
        self._spots: tuple[Spot, ...] | None = None

    def __call__(self, frame: Frame, /) -> Detections:
        truth = self._truth_of(frame)
        rows = [self._object(frame, truth, k) for k in range(len(truth.object_id))]
        if frame.T_world_camera is not None:
            rows += [self._spot(frame, k, spot) for k, spot in enumerate(self._known_spots())]
        rows += self._chance(frame)
        found = [row for row in rows if row is not None and row[1].max() >= self.config.min_score]
        if not found:
            return Detections.empty(self.classes)
        boxes, scores = (np.stack(column) for column in zip(*found, strict=True))
        return Detections(self.classes, boxes, scores).clip(frame.intrinsics.width, frame.intrinsics.height)

    def find_probability(
        self, visibility: np.ndarray | float, side: np.ndarray | float, mood: float = 0.0
    ) -> np.ndarray:
        """Chance to find an object, by visible share and the root of its visible box's area in pixels."""
        c = self.config
        seen = _logistic((np.asarray(visibility) - c.half_visibility) / c.visibility_width + c.mood * mood)
        return c.max_recall * seen * _logistic(np.log2(np.asarray(side) / c.half_side) / c.side_width)

    def mean_score(self, visibility: np.ndarray | float, side: np.ndarray | float, mood: float = 0.0) -> np.ndarray:
        """Mean score of what is found; arguments as `find_probability`."""
        c = self.config
        low, high = c.score_range
        seen = _logistic((np.asarray(visibility) - c.score_visibility) / c.score_visibility_width + 0.5 * c.mood * mood)
        return low + (high - low) * seen * _logistic(np.log2(np.asarray(side) / c.score_side) / c.score_side_width)

    def _truth_of(self, frame: Frame) -> FrameTruth:
        """The frame's truth.

        Raises:
            UserError: the frame is not of this detector's sequence.
        """
        poses = getattr(self._sequence, "poses", None)
        belongs = poses is None or frame.index < len(poses)
        if belongs and poses is not None and frame.T_world_camera is not None:
            belongs = np.allclose(poses[frame.index], frame.T_world_camera)
        if not belongs:
            raise UserError(
                f"{frame.name}: expected a frame of the sequence the simulated detector was made for, found another; "
                "make the detector from the sequence it runs on"
            )
        return self._sequence.truth(frame.index)

    def _rng(self, frame: Frame, *key: int) -> np.random.Generator:
        """Each source of detections has its own, so that none disturbs another."""
        return np.random.default_rng([self.seed, 2, crc32(frame.name.encode()), *key])

    def _object(self, frame: Frame, truth: FrameTruth, k: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Box and scores of the k-th object in the frame, or None where it is missed."""
        c, number, visibility = self.config, int(truth.object_id[k]), float(truth.visibility[k])
        if visibility <= 0.0:
            return None
        rng = self._rng(frame, 0, number)
        visible = truth.xyxy_visible[k]
        extent = np.maximum(visible[2:] - visible[:2], 1.0)
        finding, naming = self._moods[number](frame, self._objects[number].position)
        side = np.sqrt(extent.prod())
        if rng.random() >= self.find_probability(visibility, side, finding):
            return None
        score = _beta(rng, float(self.mean_score(visibility, side, finding)), c.score_strength)
        shares = self._split(rng, self.classes.index(self._objects[number].label), visibility, naming)
        return self._box(rng, visible, truth.xyxy[k], visibility), score * shares

    def _split(self, rng: np.random.Generator, true_class: int, visibility: float, naming: float) -> np.ndarray:
        """(K,) shares of the score: a draw about the mean shares, which shift with occlusion and direction."""
        c = self.config
        mean = self._shares[true_class].copy()
        other = np.arange(len(mean)) != true_class
        mean[other] *= (1.0 + (c.confusion_growth - 1.0) * (1.0 - visibility)) * np.exp(c.mood * naming)
        return rng.dirichlet(c.split_strength * mean / mean.sum())

    def _box(self, rng: np.random.Generator, visible: np.ndarray, whole: np.ndarray, visibility: float) -> np.ndarray:
        """(4,) box between the visible part and the whole, with noise; counted from the image's outer edges."""
        c = self.config
        box = visible + rng.beta(*c.amodal, size=4) * (whole - visible)
        extent = np.tile(np.maximum(box[2:] - box[:2], 2.0), 2)
        sigma = c.box_sigma * (1.0 + (c.box_growth - 1.0) * (1.0 - visibility))
        box = box + sigma * extent * rng.standard_t(c.box_tail, size=4) * np.sqrt((c.box_tail - 2.0) / c.box_tail)
        return _ordered(box) + 0.5  # truth has pixel centres at integers

    def _known_spots(self) -> tuple[Spot, ...]:
        if self._spots is None:
            rng = np.random.default_rng([self.seed, 3])
            self._spots = find_spots(whole_of(self._sequence), self.classes, self.config.background_spots, rng)
        return self._spots

    def _spot(self, frame: Frame, k: int, spot: Spot) -> tuple[np.ndarray, np.ndarray] | None:
        """A false detection of a spot, or None."""
        c, rng = self.config, self._rng(frame, 1, k)
        if rng.random() >= c.spot_chance * spot.likeness(frame, c.spot_sharpness):
            return None
        box = spot.project(frame)
        if box is None:
            return None
        extent = np.tile(box[2:] - box[:2], 2)
        box = _ordered(box + 2.0 * c.box_sigma * extent * rng.standard_normal(4))
        return box, rng.beta(*c.spot_score) * self._split(rng, spot.class_id, 0.5, 0.0)

    def _chance(self, frame: Frame) -> list[tuple[np.ndarray, np.ndarray]]:
        """False detections that do not come again, anywhere in the image."""
        c, rng = self.config, self._rng(frame, 2)
        found = []
        for _ in range(rng.poisson(c.chance_rate)):
            side = np.exp(rng.uniform(*np.log(c.chance_side), size=2))
            corner = rng.uniform(0.0, 1.0, 2) * (frame.intrinsics.width, frame.intrinsics.height) - side / 2.0
            scores = rng.beta(*c.chance_score) * self._split(rng, int(rng.integers(len(self.classes))), 0.0, 0.0)
            found.append((np.concatenate([corner, corner + side]), scores))
        return found


class _Mood:
    """Two smooth random functions of the viewing direction, zero mean and unit variance: finding and naming."""

    def __init__(self, rng: np.random.Generator, config: SimulatedDetectorConfig, waves: int = 8) -> None:
        self._wave = rng.standard_normal((2, waves, 3)) / config.mood_rate
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (2, waves))

    def __call__(self, frame: Frame, position: np.ndarray) -> tuple[float, float]:
        if frame.T_world_camera is None:
            return 0.0, 0.0
        view = unit(frame.T_world_camera[:3, 3] - position)
        finding, naming = np.sqrt(2.0 / self._phase.shape[1]) * np.sin(self._wave @ view + self._phase).sum(axis=1)
        return float(finding), float(naming)


def _mean_shares(classes: tuple[str, ...], config: SimulatedDetectorConfig) -> np.ndarray:
    """(K, K) mean shares of the score; row k for an object of class k, fully visible."""
    shares = np.full((len(classes), len(classes)), config.stray_share)
    for first, second, share in config.confusions:
        if first in classes and second in classes:
            a, b = classes.index(first), classes.index(second)
            shares[a, b] = shares[b, a] = share
    np.fill_diagonal(shares, 0.0)
    left = 1.0 - shares.sum(axis=1)
    if left.min() <= 0.0:
        found = f"{1.0 - left.min():.2f} among {len(classes)} classes"
        raise UserError(
            f"detector simulated: expected wrong classes to share less than 1 of a score, found {found}; "
            "lower stray_share or the confusions"
        )
    np.fill_diagonal(shares, left)
    return shares


def _logistic(x: np.ndarray | float) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-np.asarray(x)))


def _beta(rng: np.random.Generator, mean: float, strength: float) -> float:
    """A draw of the beta distribution with this mean and sum of parameters."""
    return float(rng.beta(strength * mean, strength * (1.0 - mean)))


def _ordered(box: np.ndarray) -> np.ndarray:
    """Corners in order, at least two pixels apart."""
    low, high = np.minimum(box[:2], box[2:]), np.maximum(box[:2], box[2:])
    return np.concatenate([low, np.maximum(high, low + 2.0)])

"""A detector for synthetic sequences: it knows the truth and errs as real detectors do.

It is no mirror of the mapper's likelihoods: scores are beta distributed about a logistic response to visibility, the
split over classes is Dirichlet, boxes err with Student's t, and what is hard from one direction stays hard from the
next one, so that errors of neighbouring frames are not independent.
"""

from __future__ import annotations

import numpy as np

from ..datasets.errors import UserError
from ..datasets.frame import Frame
from ..datasets.truth import FrameTruth, HasTruth, TrueObject
from .detections import Detections, Part
from .simulated_config import SimulatedDetectorConfig
from .simulated_parts import Row, Template
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
            (thing.id, part): _Mood(np.random.default_rng([seed, 1, thing.id, part]), config)
            for thing in sequence.objects
            for part in Part
        }
        shares, parts = _mean_shares(self.classes, config), Part if config.parts else (Part.WHOLE,)
        self._templates = [Template(part, config, shares, seed) for part in parts]
        self._spots: tuple[Spot, ...] | None = None

    def __call__(self, frame: Frame, /) -> Detections:
        """What is found in a frame of the sequence: whole objects first, then, where they are on, parts.

        Raises:
            UserError: the frame is not of this detector's sequence.
        """
        truth = self._truth_of(frame)
        found = [self._detections(template, frame, truth) for template in self._templates]
        return Detections.concatenate(found).clip(frame.intrinsics.width, frame.intrinsics.height)

    def find_probability(
        self, visibility: np.ndarray | float, side: np.ndarray | float, mood: float = 0.0
    ) -> np.ndarray:
        """Chance to find a whole object, see `Template.find_probability`."""
        return self._templates[0].find_probability(visibility, side, mood)

    def mean_score(self, visibility: np.ndarray | float, side: np.ndarray | float, mood: float = 0.0) -> np.ndarray:
        """Mean score of whole objects that are found, see `Template.mean_score`."""
        return self._templates[0].mean_score(visibility, side, mood)

    def _detections(self, template: Template, frame: Frame, truth: FrameTruth) -> Detections:
        """What one template finds; not clipped."""
        rows: list[Row | None] = []
        for k, number in enumerate(truth.object_id):
            thing = self._objects[int(number)]
            mood = self._mood(frame, thing, template.part)
            rows.append(template.of_object(frame, truth, k, self.classes.index(thing.label), mood))
        if frame.T_world_camera is not None:
            rows += [template.of_spot(frame, k, spot) for k, spot in enumerate(self._known_spots())]
        rows += template.by_chance(frame)
        found = [row for row in rows if row is not None and row[1].max() >= self.config.min_score]
        if not found:
            return Detections.empty(self.classes)
        boxes, scores = (np.stack(column) for column in zip(*found, strict=True))
        return Detections(self.classes, boxes, scores, np.full(len(found), template.part))

    def _mood(self, frame: Frame, thing: TrueObject, part: Part) -> tuple[float, float]:
        """Moods of finding and naming; a half's are in part the whole's, which is of the same texture."""
        whole = self._moods[thing.id, Part.WHOLE](frame, thing.position)
        if part is Part.WHOLE:
            return whole
        own = self._moods[thing.id, part](frame, thing.position)
        common = self.config.part_common
        finding, naming = np.sqrt(common) * np.array(whole) + np.sqrt(1.0 - common) * np.array(own)
        return float(finding), float(naming)

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

    def _known_spots(self) -> tuple[Spot, ...]:
        if self._spots is None:
            rng = np.random.default_rng([self.seed, 3])
            self._spots = find_spots(whole_of(self._sequence), self.classes, self.config.background_spots, rng)
        return self._spots


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

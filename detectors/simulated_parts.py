"""The templates of the simulated detector: that of whole objects, and those of their halves.

All templates work alike; a half's is a weaker detector, and sees nothing but its half. What is assumed of halves:

    - The chance to find a half, and its score, follow from the visible share and the pixels of that half alone:
      what hides the other half does not matter (Meger et al., Explicit Occlusion, section 4.1).
    - The whole template is the best of them (figure 4 there): halves have a lower recall and lower scores, name the
      wrong class more often, and find more where nothing is.
    - Two of the four suit an object badly, those of the halves that are cut along its longer side: a bottle's left
      half is a strip of plain wall that looks like its right one, a bowl's upper half like its lower one.
    - What is hard for the whole, from one direction or in one image, is in part hard for its halves: they look at the
      same texture, so that they add little where the whole object is in sight.

There are no numbers of a real detector behind it: they are own choices, such that the order is that of figure 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from zlib import crc32

import numpy as np

from ..datasets.frame import Frame
from ..datasets.truth import FrameTruth
from .detections import Part
from .parts import part_box
from .simulated_config import SimulatedDetectorConfig
from .simulated_spots import Spot

Row = tuple[np.ndarray, np.ndarray]  # (4,) box, counted from the image's outer edges, and (K,) scores


@dataclass(frozen=True, slots=True)
class Strength:
    """A template's numbers as factors on those of the configuration; the whole template's are all 1."""

    recall: float = 1.0
    score: float = 1.0
    side: float = 1.0
    confusion: float = 1.0
    spots: float = 1.0
    chance: float = 1.0

    @classmethod
    def of_half(cls, c: SimulatedDetectorConfig) -> Strength:
        """What all four templates of halves share."""
        return cls(c.part_recall, c.part_score, c.part_side, c.part_confusion, c.part_spots, c.part_chance)


class Template:
    """One template: what it finds in a frame, true and false. Every source of detections has its own randomness.

    Args:
        part: what it shows.
        config: of the detector.
        shares: (K, K) mean shares of the score; row k for an object of class k, fully visible.
        seed: of the detector.
    """

    def __init__(self, part: Part, config: SimulatedDetectorConfig, shares: np.ndarray, seed: int) -> None:
        self.part, self.config = part, config
        self.strength = Strength() if part is Part.WHOLE else Strength.of_half(config)
        self._shares, self._seed = shares, seed

    def find_probability(
        self, visibility: np.ndarray | float, side: np.ndarray | float, mood: float = 0.0
    ) -> np.ndarray:
        """Chance to find what the template shows, by its visible share and the root of its visible area in pixels."""
        c, s = self.config, self.strength
        seen = _logistic((np.asarray(visibility) - c.half_visibility) / c.visibility_width + c.mood * mood)
        large = _logistic(np.log2(np.asarray(side) / (s.side * c.half_side)) / c.side_width)
        return s.recall * c.max_recall * seen * large

    def mean_score(self, visibility: np.ndarray | float, side: np.ndarray | float, mood: float = 0.0) -> np.ndarray:
        """Mean score of what is found; arguments as `find_probability`."""
        c, s = self.config, self.strength
        low, high = c.score_range
        seen = _logistic((np.asarray(visibility) - c.score_visibility) / c.score_visibility_width + 0.5 * c.mood * mood)
        large = _logistic(np.log2(np.asarray(side) / (s.side * c.score_side)) / c.score_side_width)
        return s.score * (low + (high - low) * seen * large)

    def of_object(
        self, frame: Frame, truth: FrameTruth, k: int, true_class: int, mood: tuple[float, float]
    ) -> Row | None:
        """Box and scores of the k-th object in the frame, or None where it is missed; moods of finding and naming."""
        visibility = float(truth.part_visibility[k, self.part])
        if visibility <= 0.0:
            return None
        rng = self._rng(frame, 0, int(truth.object_id[k]))
        finding, naming = mood
        side, suits = _visible_side(truth, k, self.part), self._suits(truth.xyxy[k])
        if self._luck(rng, frame, int(truth.object_id[k])) >= suits * self.find_probability(visibility, side, finding):
            return None
        score = _beta(rng, suits * float(self.mean_score(visibility, side, finding)), self.config.score_strength)
        shares = self._split(rng, true_class, visibility, naming)
        return self._box(rng, truth, k, visibility), score * shares

    def of_spot(self, frame: Frame, k: int, spot: Spot) -> Row | None:
        """A false detection of the scene's k-th spot, or None; a half's template sees that half of it."""
        c, s, rng = self.config, self.strength, self._rng(frame, 1, k)
        if rng.random() >= s.spots * c.spot_chance * spot.likeness(frame, c.spot_sharpness):
            return None
        whole = spot.project(frame)
        if whole is None:
            return None
        box = part_box(whole, self.part)
        extent = np.tile(box[2:] - box[:2], 2)
        box = _ordered(box + 2.0 * c.box_sigma * extent * rng.standard_normal(4))
        return box, s.score * rng.beta(*c.spot_score) * self._split(rng, spot.class_id, 0.5, 0.0)

    def by_chance(self, frame: Frame) -> list[Row]:
        """False detections that do not come again, anywhere in the image."""
        c, s, rng = self.config, self.strength, self._rng(frame, 2)
        found = []
        for _ in range(rng.poisson(s.chance * c.chance_rate)):
            side = np.exp(rng.uniform(*np.log(c.chance_side), size=2))
            corner = rng.uniform(0.0, 1.0, 2) * (frame.intrinsics.width, frame.intrinsics.height) - side / 2.0
            scores = rng.beta(*c.chance_score) * self._split(rng, int(rng.integers(len(self._shares))), 0.0, 0.0)
            found.append((part_box(np.concatenate([corner, corner + side]), self.part), s.score * scores))
        return found

    def _rng(self, frame: Frame, *key: int, part: Part | None = None) -> np.random.Generator:
        """Each source of detections has its own, so that none disturbs another; halves leave the whole's as it was."""
        part = self.part if part is None else part
        of_part = () if part is Part.WHOLE else (int(part),)
        return np.random.default_rng([self._seed, 2, crc32(frame.name.encode()), *key, *of_part])

    def _luck(self, rng: np.random.Generator, frame: Frame, number: int) -> float:
        """Uniform in [0, 1]: an object is found where it lies below the chance. A half's goes with the whole's."""
        if self.part is Part.WHOLE:
            return rng.random()
        normal, common = NormalDist(), self.config.part_common
        of_whole = normal.inv_cdf(max(self._rng(frame, 0, number, part=Part.WHOLE).random(), 1e-12))
        return normal.cdf(np.sqrt(common) * of_whole + np.sqrt(1.0 - common) * rng.standard_normal())

    def _suits(self, whole: np.ndarray) -> float:
        """Factor on recall and score by the whole box's shape: halves cut along its longer side are hard to tell."""
        if self.part is Part.WHOLE:
            return 1.0
        width, height = whole[2:] - whole[:2]
        cut_along_width = self.part in (Part.TOP, Part.BOTTOM)
        return self.config.part_strip if cut_along_width == (width > height) else 1.0

    def _split(self, rng: np.random.Generator, true_class: int, visibility: float, naming: float) -> np.ndarray:
        """(K,) shares of the score: a draw about the mean shares, which shift with occlusion and direction."""
        c = self.config
        mean = self._shares[true_class].copy()
        other = np.arange(len(mean)) != true_class
        grown = self.strength.confusion * (1.0 + (c.confusion_growth - 1.0) * (1.0 - visibility))
        mean[other] *= grown * np.exp(c.mood * naming)
        return rng.dirichlet(c.split_strength * mean / mean.sum())

    def _box(self, rng: np.random.Generator, truth: FrameTruth, k: int, visibility: float) -> np.ndarray:
        """(4,) box with noise, counted from the image's outer edges.

        The whole template's lies between the visible part and the whole object; a half's is the half itself.
        """
        c, target = self.config, part_box(truth.xyxy[k], self.part)
        visible = truth.xyxy_visible[k] if self.part is Part.WHOLE else target
        box = visible + rng.beta(*c.amodal, size=4) * (target - visible)
        extent = np.tile(np.maximum(box[2:] - box[:2], 2.0), 2)
        sigma = c.box_sigma * (1.0 + (c.box_growth - 1.0) * (1.0 - visibility))
        box = box + sigma * extent * rng.standard_t(c.box_tail, size=4) * np.sqrt((c.box_tail - 2.0) / c.box_tail)
        return _ordered(box) + 0.5  # truth has pixel centres at integers


def _visible_side(truth: FrameTruth, k: int, part: Part) -> float:
    """Pixels, root of the visible area: of the visible box, or of the half's box times its visible share.

    The half's own share, since the visible box depends on what hides the other half too.
    """
    if part is Part.WHOLE:
        box, share = truth.xyxy_visible[k], 1.0
    else:
        box, share = part_box(truth.xyxy[k], part), float(truth.part_visibility[k, part])
    return float(np.sqrt(np.maximum(box[2:] - box[:2], 1.0).prod() * share))


def _logistic(x: np.ndarray | float) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-np.asarray(x)))


def _beta(rng: np.random.Generator, mean: float, strength: float) -> float:
    """A draw of the beta distribution with this mean and sum of parameters."""
    return float(rng.beta(strength * mean, strength * (1.0 - mean)))


def _ordered(box: np.ndarray) -> np.ndarray:
    """Corners in order, at least two pixels apart."""
    low, high = np.minimum(box[:2], box[2:]), np.maximum(box[:2], box[2:])
    return np.concatenate([low, np.maximum(high, low + 2.0)])

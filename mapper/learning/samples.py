"""What was collected: for every object, frame and template whether it was found, how, and how much of it showed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...factors.score_model import TRUNCATION

TRIAL_ARRAYS = {  # of `Samples`, and what they hold
    "class_id": np.int64,
    "part": np.int64,
    "visible": np.float64,
    "side_px": np.float64,
    "scores": np.float64,
    "scene": np.int64,
    "object_id": np.int64,
}
FALSE_ARRAYS = {"false_part": np.int64, "false_scores": np.float64, "false_scene": np.int64}


@dataclass(slots=True)
class Tally:
    """What was looked at and what was left out.

    Attributes:
        scenes: names of the sequences.
        frames: frames looked at.
        skipped: reason -> names of frames that were not.
        detections: boxes that were looked at, and
        weak: boxes below the least confidence, which were not.
        duplicates: boxes on an object that another one of the template fits better; they say nothing.
        no_depth: objects, counted in each frame, that were left out because most of their depth is missing.
        strangers: label -> objects of a class that the detector does not have.
        unmeasured: label -> objects whose place or size nobody knows.
        incomplete: sequences in which not every object is known: what is found there besides is not a false detection.
    """

    scenes: list[str] = field(default_factory=list)
    frames: int = 0
    skipped: dict[str, list[str]] = field(default_factory=dict)
    detections: int = 0
    weak: int = 0
    duplicates: int = 0
    no_depth: int = 0
    strangers: Counter[str] = field(default_factory=Counter)
    unmeasured: Counter[str] = field(default_factory=Counter)
    incomplete: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """T trials (object, frame and template, the object being in the image), and F false detections.

    Attributes:
        classes: K names, of the detector.
        class_id: (T,) what the object is.
        part: (T,) template, 0..4.
        visible: (T,) share of the template's pixels that is in the image and not occluded, by the depth map.
        side_px: (T,) geometric mean of the sides of the whole object's projected box, clipped to the image.
        scores: (T, K) of the detection that found it, NaN where the class was not reported; all NaN where missed.
        scene: (T,) number of the sequence.
        object_id: (T,) of the object in its sequence.
        false_part: (F,) template,
        false_scores: (F, K), and
        false_scene: (F,) the same of detections that show no known object.
        tally: what was looked at.
    """

    classes: tuple[str, ...]
    class_id: np.ndarray
    part: np.ndarray
    visible: np.ndarray
    side_px: np.ndarray
    scores: np.ndarray
    scene: np.ndarray
    object_id: np.ndarray
    false_part: np.ndarray
    false_scores: np.ndarray
    false_scene: np.ndarray
    tally: Tally

    @property
    def occlusion(self) -> np.ndarray:
        """(T,) share of the template that is hidden, by what stands before it or by the image border."""
        return 1.0 - self.visible

    @property
    def found(self) -> np.ndarray:
        """(T,) bool."""
        return np.asarray(np.isfinite(self.scores).any(axis=1))

    @property
    def named_right(self) -> np.ndarray:
        """(T,) bool: it was found, and no class scored higher than its own."""
        return np.equal(best_class(self.scores), self.class_id)

    @property
    def own_score(self) -> np.ndarray:
        """(T,) score of the object's own class; NaN where it was missed or that class was not reported."""
        return self.scores[np.arange(len(self.scores)), self.class_id]

    def background(self) -> tuple[np.ndarray, np.ndarray]:
        """(B,) template and (B, K) scores of detections "when the category is not present, or is fully occluded".

        Those are the false ones and those on objects of which more than 0.7 is hidden (Clutter, IV and figure 4).
        """
        hidden = self.found & (self.occlusion > TRUNCATION)
        part = np.concatenate([self.false_part, self.part[hidden]])
        return part, np.concatenate([self.false_scores, self.scores[hidden]])

    def of_scenes(self, scenes: Sequence[int] | np.ndarray) -> Samples:
        """The samples of some sequences; the tally stays that of all."""
        rows, false = np.isin(self.scene, scenes), np.isin(self.false_scene, scenes)
        kept = {name: getattr(self, name)[rows] for name in TRIAL_ARRAYS}
        kept |= {name: getattr(self, name)[false] for name in FALSE_ARRAYS}
        return replace(self, **kept)


def best_class(scores: np.ndarray) -> np.ndarray:
    """(N,) index of the best class of (N, K) scores; -1 where none is reported."""
    known = np.where(np.isnan(scores), -np.inf, scores)
    if not scores.shape[1]:
        return np.full(len(scores), -1)
    return np.where(np.isfinite(known).any(axis=1), np.argmax(known, axis=1), -1)


def best_score(scores: np.ndarray) -> np.ndarray:
    """(N,) highest of (N, K) scores, each row having one that is not NaN."""
    return np.nanmax(scores, axis=1) if len(scores) else np.zeros(0)

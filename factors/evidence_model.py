"""Everything that is learned of a detector: what its scores, its misses and its false detections say.

`thingmap learn` writes it from sequences with truth. Two learned on the synthetic world are shipped, of the simulated
detector and of HOG; without any, `generic_evidence_model` has sensible numbers for detectors with sigmoid scores.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import logit

from .detection_model import LOG2_SIDE_KNOTS, VISIBLE_KNOTS, DetectionModel
from .evidence_file import EvidenceParts, read_evidence, write_evidence
from .existence import ExistenceModel
from .learned_numbers import TEMPLATES, checked_gaussian
from .score_model import BIN_CENTRES, BINS, TRUNCATION, ScoreModel
from .size_table import plain_name

SHIPPED = Path(__file__).with_name("evidence_model.json")
SHIPPED_HOG = Path(__file__).with_name("evidence_hog.json")  # of the HOG detector that comes with thingmap
KNOWN_SHARE = 0.5  # of a detector's classes, from which the shipped model is taken to speak of it
MEAN_VISIBLE = 0.52  # score of an object in full view: indoor classes score about 0.5
MEAN_OCCLUDED = 0.28  # at an occlusion of 0.7: about half; between, a line
BACKGROUND_MEAN = 0.12  # top score of false boxes
RATE = 2.0 / 3.0  # of objects in full view and large enough that are found: the mean of Beta(4, 2)
HALF_STRENGTH = 0.8  # of the whole template's scores and rate; halves are weaker (Explicit, 4.1), 0.8 is our choice


@dataclass(frozen=True, slots=True, eq=False)
class EvidenceModel:
    """The likelihoods that are learned.

    Attributes:
        scores: densities of detector scores.
        detection: P_D.
        existence: how the kinds of evidence add up.
        learned_from: the sequences and the detector, for people.
        background_size: Gaussian of the log half-axes (log metres; x, y horizontal, z vertical) of volumes that a
            detector proposes where there is no object: mean (3,), covariance (3, 3). None: the wide prior of
            `size_prior`.

    Raises:
        ValueError: the models are of different classes, or the Gaussian is not one.
    """

    scores: ScoreModel
    detection: DetectionModel
    existence: ExistenceModel
    learned_from: str
    background_size: tuple[np.ndarray, np.ndarray] | None = None

    def __post_init__(self) -> None:
        if self.scores.classes != self.detection.classes:
            raise ValueError(f"scores of {self.scores.classes} but detection of {self.detection.classes}")
        if self.background_size is not None:
            object.__setattr__(self, "background_size", checked_gaussian(*self.background_size))

    @property
    def classes(self) -> tuple[str, ...]:
        return self.scores.classes

    def bind(self, classes: Sequence[str]) -> EvidenceModel:
        """The model of a detector's classes, in its order; pooled numbers for those that were not learned."""
        return replace(self, scores=self.scores.bind(classes), detection=self.detection.bind(classes))

    def save(self, path: Path) -> None:
        """Writes the model, numbers rounded to 5 significant digits; the form is that of `evidence_file`.

        Raises:
            UserError: the file cannot be written.
        """
        parts = EvidenceParts(self.scores, self.detection, self.existence, self.learned_from, self.background_size)
        write_evidence(path, parts)


def load_evidence_model(path: Path | None = None) -> EvidenceModel:
    """Reads a model; without a path the one that is shipped.

    Raises:
        InputError: the file is missing, damaged, or holds a number out of its range; it says where.
    """
    return EvidenceModel(*read_evidence(SHIPPED if path is None else path))


def default_evidence_model(classes: Sequence[str]) -> EvidenceModel:
    """The shipped model for a detector at least half of whose classes it knows, else the generic one.

    How sure to be is a matter of the detector's habits, and those of a detector of other classes are not known: with
    the shipped model a network of COCO's 80 classes was believed what it steadily misreads.
    """
    shipped = load_evidence_model()
    known = {plain_name(name) for name in shipped.classes}
    share = sum(plain_name(name) in known for name in classes) / max(len(classes), 1)
    return shipped if share >= KNOWN_SHARE else generic_evidence_model()


def generic_evidence_model() -> EvidenceModel:
    """Numbers for a detector with sigmoid scores of which nothing is known; no classes, so that all are pooled.

    They are wide, after YOLO-family detectors of 1 to 10 M parameters on indoor scenes with a confidence threshold of
    0.08. Templates beyond the whole differ by `HALF_STRENGTH` alone.
    """
    weaker = np.array([1.0, *[HALF_STRENGTH] * (TEMPLATES - 1)])  # by template
    fall = (MEAN_VISIBLE - MEAN_OCCLUDED) / TRUNCATION
    mean = MEAN_VISIBLE - fall * np.minimum(BIN_CENTRES, TRUNCATION + 0.05)  # the bin beyond 0.7 ends the line there
    scores = ScoreModel(
        (),
        mean=weaker[None, :, None] * mean,
        sigma=np.full((1, TEMPLATES, BINS), 0.25),  # wide: two thirds of the objects in full view score 0.25 to 0.75
        background_mean=np.full((1, TEMPLATES), BACKGROUND_MEAN),
        background_sigma=np.full((1, TEMPLATES), 0.16),  # five sixths of the false boxes score below 0.3
        other_sigma=np.full(TEMPLATES, 0.05),  # sigmoid scores of foreign classes stay below 0.1
        confusion=np.full(TEMPLATES, 0.15),  # one detection in seven names another class
        platt_ab=np.tile([-10.0, 3.0], (TEMPLATES, 1)),  # line through log own / background at their two means
        linear_range=np.stack([np.full(TEMPLATES, BACKGROUND_MEAN), weaker * MEAN_VISIBLE], axis=1),
    )
    # Of P_D at its best: none up to a visible share of 0.3 (Clutter, IV) and a side of 8 px, half at 16 px (the finest
    # grid of these detectors has cells of 8 px), all from 0.8 and 32 px on.
    seen = np.clip((VISIBLE_KNOTS - (1.0 - TRUNCATION)) / 0.5, 0.0, 1.0)
    large = np.clip((LOG2_SIDE_KNOTS - 3.0) / 2.0, 0.0, 1.0)
    detection = DetectionModel(
        (),
        intercept=_logit(RATE * weaker)[None],
        visible=np.tile(_logit(RATE * seen) - _logit(RATE), (TEMPLATES, 1)),
        side=np.tile(_logit(RATE * large) - _logit(RATE), (TEMPLATES, 1)),
    )
    # Both kinds of geometry read the same pixels, and real things fit their volumes worse than rendered ones: at full
    # weight a chair of 7-Scenes redkitchen with gaps in its back, found in 29 views, counted as no object.
    existence = ExistenceModel(weight_free=0.3, weight_depth=0.3)
    return EvidenceModel(scores, detection, existence, "nothing: generic numbers for detectors with sigmoid scores")


def _logit(probability: np.ndarray | float) -> np.ndarray:
    return logit(np.maximum(probability, 0.01))  # of a detector that finds next to nothing

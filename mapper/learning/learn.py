"""Learning a model of a detector: collect, fit, try out on sequences left out.

The first of two stages: scores and P_D. How the kinds of evidence add up (`ExistenceModel`) keeps its defaults here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...datasets.errors import UserError
from ...detectors.detector import Detector
from ...factors.evidence_model import EvidenceModel
from ...factors.existence import ExistenceModel
from .calibration import Calibration, cross_validate
from .collecting import Collector
from .config import LearningConfig
from .fit_detection import fit_detection
from .fit_scores import fit_scores
from .known_scene import KnownScene
from .samples import Samples, best_class

NAMED = 3  # sequences named in `EvidenceModel.learned_from`


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """The model and what it was made of.

    Attributes:
        model: scores and P_D learned, existence at its defaults.
        samples: all of them.
        class_id: (K,) column of the samples behind each class of the model.
        votes: (K + 1, 5, 10) behind `ScoreModel.mean`.
        background: (K + 1, 5) detections behind `ScoreModel.background_mean`.
        calibration: of P_D on sequences left out, by template; empty where there was one sequence.
    """

    model: EvidenceModel
    samples: Samples
    class_id: np.ndarray
    votes: np.ndarray
    background: np.ndarray
    calibration: dict[int, Calibration]


def collect_samples(
    scenes: Sequence[tuple[KnownScene, Detector]],
    config: LearningConfig = LearningConfig(),  # noqa: B008
    on_frame: Callable[[int], None] = lambda done: None,
) -> Samples:
    """Runs each sequence's detector over it; `on_frame` hears how many frames of all sequences are done."""
    collector, before = Collector(config), 0
    for scene, detector in scenes:
        collector.add_scene(scene, detector, lambda done, before=before: on_frame(before + done))
        before += len(scene.sequence)
    return collector.samples()


def learn(samples: Samples, detector: str, config: LearningConfig = LearningConfig()) -> Learned:  # noqa: B008
    """Fits the model.

    Args:
        samples: of `collect_samples`.
        detector: what it is called, for people; written into the model.
        config: how far few samples are trusted.

    Raises:
        UserError: there is nothing to learn from; it says what is missing.
    """
    _check(samples, detector)
    named = best_class(samples.background()[1])
    classes = np.union1d(np.unique(samples.class_id), named[named >= 0])
    fitted = fit_scores(samples, classes, config)
    model = EvidenceModel(
        fitted.model, fit_detection(samples, classes, config), ExistenceModel(), _learned_from(samples, detector)
    )
    calibration = cross_validate(samples, classes, config)
    return Learned(model, samples, classes, fitted.votes, fitted.background, calibration)


def _check(samples: Samples, detector: str) -> None:
    tally = samples.tally
    if not tally.frames:
        reasons = ", ".join(f"{len(names)} with {reason}" for reason, names in tally.skipped.items())
        raise UserError(f"nothing to learn from: none of the frames can be used ({reasons or 'there is none'})")
    if not tally.detections:
        weak = f" but {tally.weak} below the least confidence" if tally.weak else ""
        raise UserError(
            f"nothing to learn from: detector {detector} found nothing in {tally.frames} frames{weak}; "
            "check that it is the detector of these sequences"
        )
    if not len(samples.part):
        labels = ", ".join(sorted(tally.strangers)) or "none"
        classes = ", ".join(samples.classes) or "none"
        raise UserError(
            "nothing to learn from: no object of a class that the detector has is in view; "
            f"objects without: {labels}; the detector's classes: {classes}"
        )
    if not (samples.named_right & (samples.part == 0)).any():
        raise UserError(
            f"nothing to learn from: none of {tally.detections} detections shows an object as a whole and names it "
            "right; check that truth, poses and detections belong to the same sequence"
        )


def _learned_from(samples: Samples, detector: str) -> str:
    names = samples.tally.scenes
    some = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
    return (
        f"{len(names)} sequence{'s' * (len(names) != 1)} ({some}), {samples.tally.frames} frames, detector {detector}"
    )

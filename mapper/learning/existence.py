"""The second stage of learning: how the kinds of evidence add up, and what a false place looks like.

The sequences are mapped with what the first stage learned, and the weights fitted to what became of their landmarks.
Better weights make other landmarks, so this is done again with the weights it gave.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...detectors.detector import Detector
from ...factors.evidence_model import EvidenceModel
from ...factors.existence import ExistenceModel
from ..config import MapperConfig
from ..evaluation.uncertainty.calibration import Reliability, bin_claims
from .existence_fit import fit_existence
from .known_scene import KnownScene
from .landmarks import LandmarkSamples, landmark_samples

ROUNDS = 2  # of mapping and fitting; a third changes the weights by less than their scatter between halves of the data
FEWEST = 50  # records of landmarks, and a fifth each of objects and false ones: fewer teach nothing
BINS = 10  # of a reliability diagram


@dataclass(frozen=True, slots=True)
class ExistenceCalibration:
    """What the weights are worth on sequences that they were not fitted to; scores, P_D and landmarks are those of all.

    Attributes:
        records: of landmarks, one at each time that they were taken down, and
        objects: those of them that stand for an object.
        existence: of all records, and
        label: of the likeliest class of those that stand for an object.
    """

    records: int
    objects: int
    existence: Reliability
    label: Reliability


@dataclass(frozen=True, slots=True, eq=False)
class LearnedExistence:
    """The whole model; `calibration` is None where there were too few records of landmarks or sequences to tell.

    `fitted` is False where the model is that of the first stage, `records` being too few.
    """

    model: EvidenceModel
    records: int
    fitted: bool
    calibration: ExistenceCalibration | None = None

    def summary(self) -> str:
        """One line for people."""
        if not self.fitted:
            return (
                f"how sure to be was not learned: {self.records} records of landmarks in sequences whose objects are "
                f"all known are too few (at least {FEWEST}, a fifth of them objects and a fifth false); the weights "
                "stay as they were"
            )
        c = self.calibration
        if c is None:
            return (
                f"how sure to be was learned from {self.records} records of landmarks, and tried on no other sequence: "
                "there are too few"
            )
        return (
            f"existence of {c.records} records of landmarks ({c.objects} of them objects) on sequences left out: "
            f"calibration error {c.existence.expected_error:.3f}, of their classes {c.label.expected_error:.3f}"
        )


def learn_existence(
    scenes: Sequence[tuple[KnownScene, Detector]],
    model: EvidenceModel,
    classes: tuple[str, ...],
    config: MapperConfig = MapperConfig(),  # noqa: B008
    on_frame: Callable[[int], None] = lambda done: None,
) -> LearnedExistence:
    """Completes a model of the first stage.

    Args:
        scenes: sequences that know all their objects; others are not looked at.
        model: of the first stage.
        classes: of the detectors; each must have all of them, in any order.
        config: of the mapper.
        on_frame: hears how many frames are mapped, of `ROUNDS` times those of the sequences that are looked at.
    """
    complete = [(scene, detector) for scene, detector in scenes if scene.complete]
    done, samples, learned = 0, None, model
    for _ in range(ROUNDS):
        mapped, worlds = [], []
        for scene, detector in complete:
            one = landmark_samples(scene, detector, learned, classes, config)
            if one is not None:
                mapped.append(one)
                worlds.append(scene.centers.tobytes())
            done += len(scene.sequence)
            on_frame(done)
        samples = _joined(mapped, worlds) if mapped else None
        if samples is None or not _enough(samples):
            return LearnedExistence(model, 0 if samples is None else len(samples), fitted=False)
        background = samples.background_size()
        samples = samples.with_size(classes, background, config)
        learned = replace(learned, existence=fit_existence(samples), background_size=background)
    assert samples is not None
    return LearnedExistence(learned, len(samples), fitted=True, calibration=_left_out(samples))


def _joined(mapped: list[LandmarkSamples], worlds: list[bytes]) -> LandmarkSamples:
    """All samples; two sequences of the same objects in the same places are one scene: left out, both are."""
    number = {world: k for k, world in enumerate(dict.fromkeys(worlds))}
    samples = LandmarkSamples.joined(mapped)
    return replace(samples, scene=np.array([number[world] for world in worlds])[samples.scene])


def _enough(samples: LandmarkSamples) -> bool:
    objects = int(np.count_nonzero(samples.label >= 0))
    return len(samples) >= FEWEST and min(objects, len(samples) - objects) >= FEWEST // 5


def _left_out(samples: LandmarkSamples) -> ExistenceCalibration | None:
    """Fitted to every other scene, judged on the rest, and the other way round; None where a half teaches nothing."""
    halves = [samples.scene % 2 == half for half in range(2)]
    if not all(_enough(samples.select(rows)) for rows in halves):
        return None
    posterior = np.empty((len(samples), samples.evidence.own.shape[1] + 1))
    for judged in halves:
        posterior[judged] = _posterior(fit_existence(samples.select(~judged)), samples.select(judged))
    existence, true = 1.0 - posterior[:, 0], samples.label >= 0
    named = posterior[true, 1:] / np.maximum(existence[true, None], 1e-12)
    return ExistenceCalibration(
        records=len(samples),
        objects=int(true.sum()),
        existence=bin_claims(existence, true, BINS),
        label=bin_claims(named.max(axis=1), named.argmax(axis=1) == samples.label[true], BINS),
    )


def _posterior(model: ExistenceModel, samples: LandmarkSamples) -> np.ndarray:
    """(N, K + 1), "not an object" first."""
    belief = model.log_belief(samples.evidence)
    e = np.exp(belief - belief.max(axis=1, keepdims=True))
    return e / e.sum(axis=1, keepdims=True)

"""Landmarks whose truth is known, with all that was said of them: what `existence_fit` learns from.

A sequence is mapped as ever, but that classes do not pull sizes: what a size says is worked out afterwards, from what
the boxes and the depth alone tell of it. Now and then on the way every landmark is taken down, as young maps must be as
well calibrated as old ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from ...datasets.errors import UserError
from ...datasets.frame import BrokenFrame
from ...datasets.ground_truth import GroundTruth
from ...detectors.detector import Detector
from ...factors.evidence_model import EvidenceModel
from ...factors.existence import Evidence
from ...factors.size_prior import load_size_priors
from ...factors.size_table import plain_name
from ..config import MapperConfig
from ..estimation.landmarks import Landmark
from ..estimation.size_site import measured_size, size_evidence
from ..evaluation.inputs.build_case import build_case
from ..evaluation.inputs.case import Case, MappedRun
from ..evaluation.things.matching import match_ranked
from ..mapper import SemanticMapper
from ..read_ahead import ReadAhead
from .known_scene import KnownScene

TAKEN_AFTER = (2, 3, 4, 6, 8, 12, 18, 26, 37, 60, 100, 160, 260)  # keyframes


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkSamples:
    """N landmarks at some time each.

    Attributes:
        evidence: what was said of them; `log_size` is zero.
        information, vector: (N, 3, 3) and (N, 3) what was measured of the log half-axes.
        log_size: (N, 3) log half-axes, upright frame.
        label: (N,) index of the class of the object that it stands for; -1 where it stands for none.
        scene: (N,) which of those that were `joined`; of a single sequence, which time.
    """

    evidence: Evidence
    information: np.ndarray
    vector: np.ndarray
    log_size: np.ndarray
    label: np.ndarray
    scene: np.ndarray

    def __len__(self) -> int:
        return len(self.label)

    def select(self, rows: np.ndarray) -> LandmarkSamples:
        """The samples of a mask (N,) or of indices."""
        evidence = Evidence(**{f.name: getattr(self.evidence, f.name)[rows] for f in fields(Evidence)})
        arrays = {f.name: getattr(self, f.name)[rows] for f in fields(self)[1:]}
        return replace(self, evidence=evidence, **arrays)

    def background_size(self) -> tuple[np.ndarray, np.ndarray]:
        """Gaussian of the log half-axes of what is no object: (3,) mean and (3, 3) covariance."""
        false = self.log_size[self.label < 0]
        return false.mean(axis=0), np.cov(false.T) + 0.05**2 * np.eye(3)

    def with_size(
        self, classes: tuple[str, ...], background: tuple[np.ndarray, np.ndarray], config: MapperConfig
    ) -> LandmarkSamples:
        """The same with what the sizes say of the classes."""
        extra = Path(config.class_sizes) if config.class_sizes else None
        priors = load_size_priors(classes, extra, background)
        outlier = config.beliefs.size_outlier
        log_size = [
            size_evidence(*measured, priors, outlier) for measured in zip(self.information, self.vector, strict=True)
        ]
        return replace(self, evidence=replace(self.evidence, log_size=np.array(log_size)))

    @classmethod
    def joined(cls, several: list[LandmarkSamples]) -> LandmarkSamples:
        """All together; `scene` counts them."""
        evidence = {f.name: np.concatenate([getattr(s.evidence, f.name) for s in several]) for f in fields(Evidence)}
        arrays = {f.name: np.concatenate([getattr(s, f.name) for s in several]) for f in fields(cls)[1:-1]}
        scene = np.concatenate([np.full(len(s), number) for number, s in enumerate(several)])
        return cls(evidence=Evidence(**evidence), scene=scene, **arrays)


def landmark_samples(
    scene: KnownScene, detector: Detector, model: EvidenceModel, classes: Sequence[str], config: MapperConfig
) -> LandmarkSamples | None:
    """Maps one sequence; None where nothing became a landmark.

    Args:
        classes: K names, the order of the samples' columns and labels, whatever that of this detector.

    Raises:
        UserError: none of its frames can be mapped, or the detector has other classes.
    """
    mapper = SemanticMapper(
        detector, replace(config, beliefs=replace(config.beliefs, size_coupling=False)), source=scene.name, model=model
    )
    taken: list[LandmarkSamples] = []
    wanted = set(TAKEN_AFTER)
    with ReadAhead(scene.sequence) as readings:
        for reading in readings:
            if isinstance(reading.result, BrokenFrame):
                continue
            try:
                mapper.process_frame(reading.result)
            except BrokenFrame:
                continue
            done = mapper.statistics()["keyframes"]
            if done in wanted:
                wanted.discard(done)
                taken += _take(mapper, scene, classes)
    if not mapper.statistics()["keyframes"]:
        raise UserError(f"{scene.name}: none of the frames can be mapped")
    return LandmarkSamples.joined(taken) if taken else None


def _take(mapper: SemanticMapper, scene: KnownScene, classes: Sequence[str]) -> list[LandmarkSamples]:
    landmarks = {f"thing-{landmark.number:04d}": landmark for landmark in mapper.landmarks(include_retired=True)}
    if not landmarks:
        return []
    case = _case(mapper, scene)
    matching = match_ranked(case)
    columns = _columns(case.run.object_map.classes, classes, scene.name)
    names = [plain_name(name) for name in classes]
    label = np.full(len(matching.things), -1)
    for thing, (_, true) in zip(matching.pairs[:, 0], matching.matched, strict=True):
        label[thing] = names.index(plain_name(true.label))
    rows = [landmarks[placed.thing.id] for placed in matching.things]
    return [_samples(rows, label, columns)] if rows else []


def _columns(found: Sequence[str], wanted: Sequence[str], scene: str) -> np.ndarray:
    """(K,) column among a detector's classes of every class that is wanted."""
    place = {plain_name(name): k for k, name in enumerate(found)}
    if set(place) != {plain_name(name) for name in wanted}:
        raise UserError(
            f"{scene}: expected a detector of the same {len(wanted)} classes for all sequences, found one of "
            f"{len(found)}; learn from the sequences of one detector, or leave out this stage with --scores-only"
        )
    return np.array([place[plain_name(name)] for name in wanted])


def _case(mapper: SemanticMapper, scene: KnownScene) -> Case:
    stamps, poses = mapper.trajectory()
    object_map = mapper.object_map(include_doubtful=True)

    def no_cloud() -> tuple[np.ndarray, np.ndarray | None]:
        return np.empty((0, 3)), None

    run = MappedRun(Path(), object_map, stamps, poses, {}, (), None, no_cloud)
    return build_case(run, _in_words_of(object_map.classes, scene))


def _in_words_of(classes: tuple[str, ...], scene: KnownScene) -> GroundTruth:
    """The truth in the detector's words, with the poses of the sequence where it has none of its own.

    Objects of other classes are left out, as in the first stage: what is found there is no object that has a name.
    """
    truth, sequence = scene.truth, scene.sequence
    said = {plain_name(name): name for name in classes}
    known = [thing for thing in truth.objects if plain_name(thing.label) in said]
    objects = tuple(replace(thing, label=said[plain_name(thing.label)]) for thing in known)
    if truth.poses is None:
        stamps = np.asarray(sequence.stamps, dtype=np.float64)
        truth = replace(truth, names=tuple(sequence.names), stamps=stamps, poses=sequence.poses)
    return replace(truth, classes=classes, objects=objects, sequence=None)


def _samples(landmarks: list[Landmark], label: np.ndarray, columns: np.ndarray) -> LandmarkSamples:
    rows = [landmark.belief.evidence for landmark in landmarks]
    evidence = Evidence(**{f.name: np.concatenate([getattr(row, f.name) for row in rows]) for f in fields(Evidence)})
    evidence = replace(evidence, own=evidence.own[:, columns], excess=evidence.excess[:, columns])
    measured = [measured_size(x.log_size, x.log_size_covariance, x.size_site) for x in landmarks]
    return LandmarkSamples(
        evidence=evidence,
        information=np.array([information for information, _ in measured]),
        vector=np.array([vector for _, vector in measured]),
        log_size=np.array([landmark.log_size for landmark in landmarks]),
        label=label,
        scene=np.zeros(len(landmarks), dtype=np.int64),
    )

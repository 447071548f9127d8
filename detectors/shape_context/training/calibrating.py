"""The validation set of the calibration: held-out objects, and proposals of the background (section III-B)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..calibration import FEATURES, Calibration, calibration_features, fit_calibration
from ..codebook import Codebook
from ..scoring import Rivals
from .config import TrainConfig
from .material import Material
from .scenes import NEITHER, scenes_of

OBJECTNESS = 0.9
"""Of the mask of a single view, where no frame shows how probable the proposals of objects are."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """S proposals of which it is known what they show.

    Attributes:
        features: (S, C, F), see `calibration_features`.
        label: (S,) int, C for background.
        from_frames: whether the background is that of frames; else other classes stand for it.
    """

    features: np.ndarray
    label: np.ndarray
    from_frames: bool

    def counts(self) -> np.ndarray:
        """(C + 1,) samples of each class, and of the background."""
        return np.bincount(self.label, minlength=self.features.shape[1] + 1)


def gather_samples(
    codebooks: Sequence[Codebook],
    rivals: Rivals,
    material: Material,
    config: TrainConfig,
    on_item: Callable[[int], None],
) -> Samples:
    """Held-out objects, and proposals of frames with the objects known there.

    Where no proposal of a frame is background, held-out objects stand for it: as they would be scored if their own
    class was not among those asked for.

    Args:
        codebooks: of the classes.
        rivals: of what is none of them.
        material: held-out views and frames.
        config: the numbers.
        on_item: hears how many frames and views are done.
    """
    classes = material.classes
    features, labels, objectness = [], [], []
    for scene in scenes_of(material.frames, classes, config, on_item):
        clear = scene.shows != NEITHER
        found = calibration_features(scene.scores(codebooks, config, rivals), scene.objectness)
        features.append(found[clear])
        labels.append(scene.shows[clear])
        objectness.append(scene.objectness[clear & (scene.shows < len(classes))])
    of_objects = np.concatenate([*objectness, np.zeros(0)])
    usual = np.array([np.median(of_objects) if len(of_objects) else OBJECTNESS])
    outlines = [(number, one) for number, label in enumerate(classes) for one in material.held_out[label]]
    of_views = np.empty((len(outlines), len(classes), len(FEATURES)))
    for k, (_, one) in enumerate(outlines):
        of_views[k] = calibration_features(one.scores(codebooks, config, rivals), usual)[0]
        on_item(len(material.frames) + k + 1)
    of_view = np.array([number for number, _ in outlines])
    features.append(of_views)
    labels.append(of_view)
    from_frames = any((shows == len(classes)).any() for shows in labels)
    if not from_frames:
        features.append(without_own(of_views, of_view))
        labels.append(np.full(len(of_view), len(classes)))
    return Samples(np.concatenate(features), np.concatenate(labels), from_frames)


def fit(samples: Samples) -> Calibration:
    """What scores are worth where all classes and the background are equally frequent.

    Bayes' rule over views (equation 2) would count any other prior once a view.
    """
    return fit_calibration(samples.features, samples.label, even_weights(samples.label))


def without_own(features: np.ndarray, label: np.ndarray) -> np.ndarray:
    """(N, C, F) features in which no sample has a hypothesis of its own class (N,)."""
    others = features.copy()
    others[np.arange(len(label)), label, : FEATURES.index("objectness")] = 0.0
    return others


def even_weights(label: np.ndarray) -> np.ndarray:
    """(N,) weights of samples that add up to N, and to the same for every label (N,) that there is."""
    counts = np.bincount(label)
    return len(label) / (np.count_nonzero(counts) * counts[label])

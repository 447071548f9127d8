"""Detections of known sequences compared with their objects, frame by frame (Meger et al., Clutter, section IV).

How much of an object is hidden is measured as the mapper will measure it: its volume, at its true place, against the
depth map. So what the model is learned with is what it will be asked with, errors of the depth camera and all.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...datasets.frame import BrokenFrame, Frame
from ...datasets.truth import TrueObject
from ...detectors.detections import Detections, Part
from ...detectors.detector import Detector
from ...factors.size_table import plain_name
from ...factors.solid import project_solids
from ...factors.visibility import measure_visibility
from ..read_ahead import ReadAhead
from .config import LearningConfig
from .known_scene import KnownScene
from .matching import match
from .samples import FALSE_ARRAYS, TRIAL_ARRAYS, Samples, Tally

NO_POSE = "no camera pose"


@dataclass(frozen=True, slots=True, eq=False)
class _Looks:
    """What should be seen of M objects in a frame: `visible`, `missing`, `in_image` (M, 5), boxes and sides in pixels.

    `whole` (M, 4) is the projected box, NaN where not in front of the camera; `seen` (M, 4) that of the visible pixels,
    NaN where unknown. Both are clipped to the image, as detections are.
    """

    visible: np.ndarray
    missing: np.ndarray
    in_image: np.ndarray
    whole: np.ndarray
    seen: np.ndarray
    side_px: np.ndarray


class Collector:
    """Takes sequences one by one and gives the samples of all.

    Args:
        config: what counts as a sample.
    """

    def __init__(self, config: LearningConfig = LearningConfig()) -> None:  # noqa: B008
        self._config = config
        self._columns: dict[str, int] = {}  # plain name of a class -> its place in `Samples.classes`
        self._classes: list[str] = []
        self._arrays: dict[str, list[np.ndarray]] = defaultdict(list)
        self.tally = Tally()

    def add_scene(
        self, scene: KnownScene, detector: Detector, on_frame: Callable[[int], None] = lambda done: None
    ) -> None:
        """Runs the detector over a sequence; `on_frame` hears how many of its frames are done."""
        strangers: dict[int, str] = {}
        with ReadAhead(scene.sequence) as readings:
            for reading in readings:
                if isinstance(reading.result, BrokenFrame):
                    self._skip(reading.result.problem.value, reading.result.name)
                elif (pose := scene.pose(reading.result)) is None:
                    self._skip(NO_POSE, reading.result.name)
                else:
                    self._add_frame(scene, reading.result, pose, detector(reading.result), strangers)
                on_frame(reading.position + 1)
        self.tally.scenes.append(scene.name)
        self.tally.unmeasured += Counter(scene.unmeasured)
        self.tally.strangers += Counter(strangers.values())
        if not scene.complete:
            self.tally.incomplete.append(scene.name)

    def samples(self) -> Samples:
        """Everything so far."""
        K = len(self._classes)
        arrays = {}
        for name, kind in (TRIAL_ARRAYS | FALSE_ARRAYS).items():
            empty = np.zeros((0, K) if name.endswith("scores") else 0, dtype=kind)
            parts = [_widened(part, K) if part.ndim == 2 else part for part in self._arrays[name]]
            arrays[name] = np.concatenate([empty, *parts]).astype(kind)
        return Samples(tuple(self._classes), **arrays, tally=self.tally)

    def _skip(self, reason: str, name: str) -> None:
        self.tally.skipped.setdefault(reason, []).append(name)

    def _add_frame(
        self, scene: KnownScene, frame: Frame, pose: np.ndarray, detections: Detections, strangers: dict[int, str]
    ) -> None:
        detections = self._used(detections.clip(frame.intrinsics.width, frame.intrinsics.height))
        names = {plain_name(name) for name in detections.classes}
        known = [k for k, thing in enumerate(scene.objects) if plain_name(thing.label) in names]
        strangers |= {thing.id: thing.label for thing in scene.objects if plain_name(thing.label) not in names}
        looks = _look(scene, frame, pose, known)
        matches = match(detections.xyxy - 0.5, detections.part, looks.whole, looks.seen, self._config.overlap)
        scores = self._in_columns(detections)
        self._add_trials([scene.objects[k] for k in known], looks, matches.detection, scores)
        if scene.complete:
            false = matches.object < 0
            self._add("false_part", detections.part[false])
            self._add("false_scores", scores[false])
            self._add("false_scene", np.full(int(false.sum()), len(self.tally.scenes)))
        self.tally.frames += 1
        self.tally.duplicates += int(matches.duplicate.sum())

    def _used(self, detections: Detections) -> Detections:
        """Those that the mapper would look at."""
        strong = detections.confidence >= self._config.min_confidence
        self.tally.detections += int(strong.sum())
        self.tally.weak += int((~strong).sum())
        return detections.select(strong)

    def _add_trials(self, things: list[TrueObject], looks: _Looks, detection: np.ndarray, scores: np.ndarray) -> None:
        """One trial for every template of every object that is in the image and whose depth was read."""
        in_view = np.isfinite(looks.whole).all(axis=1) & (looks.side_px > 0.0)
        read = looks.missing <= self._config.max_missing
        self.tally.no_depth += int((in_view & ~read[:, Part.WHOLE]).sum())
        m, part = np.nonzero(in_view[:, None] & read & (looks.in_image > 0.0))
        row = detection[m, part]
        found = np.full((len(m), scores.shape[1]), np.nan)
        found[row >= 0] = scores[row[row >= 0]]
        self._add("class_id", np.array([self._columns[plain_name(things[k].label)] for k in m], dtype=np.int64))
        self._add("part", part)
        self._add("visible", looks.visible[m, part])
        self._add("side_px", looks.side_px[m])
        self._add("scores", found)
        self._add("scene", np.full(len(m), len(self.tally.scenes)))
        self._add("object_id", np.array([things[k].id for k in m], dtype=np.int64))

    def _add(self, name: str, values: np.ndarray) -> None:
        self._arrays[name].append(values)

    def _in_columns(self, detections: Detections) -> np.ndarray:
        """(N, K) scores over all classes met so far, this frame's included."""
        for name in detections.classes:
            if plain_name(name) not in self._columns:
                self._columns[plain_name(name)] = len(self._classes)
                self._classes.append(name)
        scores = np.full((len(detections), len(self._classes)), np.nan)
        scores[:, [self._columns[plain_name(name)] for name in detections.classes]] = detections.scores
        return scores


def _look(scene: KnownScene, frame: Frame, T_world_camera: np.ndarray, chosen: list[int]) -> _Looks:
    """What should be seen of the chosen objects."""
    camera = T_world_camera, scene.R_world_upright
    centers, log_half_axes = scene.centers[chosen], scene.log_half_axes[chosen]
    visibility = measure_visibility(frame.depth, frame.intrinsics, *camera, centers, log_half_axes)
    whole, _ = project_solids(*camera, centers, log_half_axes, frame.intrinsics)
    size = np.array([frame.intrinsics.width, frame.intrinsics.height] * 2, dtype=np.float64)
    whole = np.clip(whole, -0.5, size - 0.5)
    side_px = np.sqrt(np.nan_to_num(whole[:, 2:] - whole[:, :2]).prod(axis=1))
    seen = np.full(whole.shape, np.nan)
    truth = scene.frame_truth(frame)
    if truth is not None:
        box = {int(number): xyxy for number, xyxy in zip(truth.object_id, truth.xyxy_visible, strict=True)}
        seen = np.array([box.get(scene.objects[k].id, np.full(4, np.nan)) for k in chosen]).reshape(-1, 4)
    return _Looks(visibility.visible, visibility.missing, visibility.in_image, whole, seen, side_px)


def _widened(scores: np.ndarray, columns: int) -> np.ndarray:
    """(N, columns), NaN for the classes that were not yet met."""
    return np.pad(scores, ((0, 0), (0, columns - scores.shape[1])), constant_values=np.nan)

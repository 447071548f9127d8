"""What one pass over all mined frames gives each template: first negatives, harder ones, or those of a checkpoint."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ....datasets.object_views.backgrounds import Background
from ...training.keeping import Kept
from ..pyramid import Pyramid, build_pyramid
from .config import TrainConfig
from .learner import Learner
from .mining import FrameWindows, Windows
from .negatives import Negatives, key, window_samples

MARGIN = -1.0  # score from which a negative pulls at the weights: the hinge of `fit_svm`

Frames = Kept[Background | None]
OnFrame = Callable[[int], None]


def frame_pyramid(frame: Background, config: TrainConfig) -> Pyramid:
    """The features of a frame, or of anything else that has an image."""
    return build_pyramid(frame.color, frame.depth, frame.focal, config.channels, config.pyramid)


def first_negatives(
    learners: Sequence[Learner], frames: Frames, classes: Sequence[str], config: TrainConfig, on_frame: OnFrame
) -> None:
    """Gives every learner random windows of every frame."""
    pools = [_Pool(learner, config.cache) for learner in learners]
    for number, frame, pyramid in _pyramids(frames, config, on_frame):
        looking = FrameWindows([one.template for one in learners], frame, pyramid, classes, config.ignored_overlap)
        rng = np.random.default_rng([config.seed, 5, number])
        for pool, windows in zip(pools, looking.random(config.random_windows, rng), strict=True):
            pool.add(number, pyramid, windows)
    for learner, pool in zip(learners, pools, strict=True):
        learner.negatives = pool.negatives()


def hard_negatives(
    learners: Sequence[Learner], frames: Frames, classes: Sequence[str], config: TrainConfig, on_frame: OnFrame
) -> list[Negatives]:
    """For each learner the false positives with the highest scores that it does not have yet.

    One pyramid and one scoring a frame serve all templates.
    """
    pools = [_Pool(learner, config.round_windows) for learner in learners]
    for number, frame, pyramid in _pyramids(frames, config, on_frame):
        looking = FrameWindows([one.template for one in learners], frame, pyramid, classes, config.ignored_overlap)
        for pool, windows in zip(pools, looking.hard(MARGIN), strict=True):
            pool.add(number, pyramid, windows, config.frame_windows)
    return [pool.negatives() for pool in pools]


def restore_negatives(
    learners: Sequence[Learner], places: Sequence[np.ndarray], frames: Frames, config: TrainConfig, on_frame: OnFrame
) -> None:
    """Gives every learner the negatives at its places (N, 4), read from the frames again."""
    samples = [
        np.zeros((len(place), one.positives.shape[1]), np.float16) for one, place in zip(learners, places, strict=True)
    ]
    for number, _, pyramid in _pyramids(frames, config, on_frame):
        for learner, place, rows in zip(learners, places, samples, strict=True):
            here = np.flatnonzero(place[:, 0] == number)
            if len(here):
                rows[here] = window_samples(pyramid, place[here, 1:], *learner.cells)
    for learner, place, rows in zip(learners, places, samples, strict=True):
        learner.negatives = Negatives(place, rows)


class _Pool:
    """The hardest new windows for one learner, at most `most` in the end and twice as many on the way."""

    def __init__(self, learner: Learner, most: int) -> None:
        self._learner, self._most = learner, most
        self._found = Negatives.none(learner.positives.shape[1])
        self._score = np.zeros(0, np.float32)
        self._bar = -np.inf  # what does not reach it cannot be among the hardest any more
        self._known = key(learner.negatives.place)

    def add(self, number: int, pyramid: Pyramid, windows: Windows, most: int | None = None) -> None:
        """Takes the first `most` windows of frame `number` that the learner does not have."""
        place = np.column_stack([np.full(len(windows.place), number, np.int32), windows.place])
        new = np.flatnonzero(~np.isin(key(place), self._known) & (windows.score > self._bar))[:most]
        if len(new) == 0:
            return
        samples = window_samples(pyramid, windows.place[new], *self._learner.cells)
        self._found = self._found.with_more(Negatives(place[new], samples))
        self._score = np.append(self._score, windows.score[new])
        if len(self._found) > 2 * self._most:
            self._prune()

    def negatives(self) -> Negatives:
        """What was found."""
        self._prune()
        return self._found

    def _prune(self) -> None:
        if len(self._score) > self._most:
            kept = np.sort(np.argsort(-self._score, kind="stable")[: self._most])
            self._found, self._score = self._found.select(kept), self._score[kept]
            self._bar = float(self._score.min())


def _pyramids(frames: Frames, config: TrainConfig, on_frame: OnFrame) -> Iterator[tuple[int, Background, Pyramid]]:
    """Number, frame and pyramid of every frame that can be used."""
    for number, frame in enumerate(frames):
        if frame is not None:
            yield number, frame, frame_pyramid(frame, config)
        on_frame(number + 1)

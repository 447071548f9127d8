"""Which tracks are things: the paper's rule of 60 % and the likeliest class (Georgakis et al., section IV).

The paper drops a track that is "present in less than 60% of the total number of frames in each scene": its scenes are
one table, which every frame shows. Here the share is of the views in which the track could be seen, the ones before it
began among them, so that a thing in one corner of a kitchen is not dropped for the time spent in another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.special import softmax

from ..config import MultiViewConfig
from .kept_views import NOBODY, KeptView
from .sight import Sight


class Fate(Enum):
    """What became of a track."""

    KEPT = "kept"
    BACKGROUND = "background"  # seen often enough, likeliest no object
    DROPPED = "dropped"  # seen in too few of the views that could show it
    REPEATED = "repeated"  # a surer track is in the same place; only where tracks are judged by what was learned


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """T tracks over V views, under the poses as they were when it was made.

    Attributes:
        posterior: (T, K + 1) p(C | all views), the background last; by Bayes' rule, or by a `TrackJudge`.
        per_view: (T, K + 1) the same if all views of a track counted as one: their geometric mean. What one view takes
            for something, the next often does too: after ten of them the posterior is 1 or 0 in most tracks, wrong ones
            among them, and no longer tells which are surer. Of a `TrackJudge` it is the posterior.
        centroids: (T, 3) world, metres.
        seen: (T, V) bool, whether a detection of the view is of the track.
        sight: (T, V) `Sight` of its centroid.
        fates: of each track.
    """

    posterior: np.ndarray
    per_view: np.ndarray
    centroids: np.ndarray
    seen: np.ndarray
    sight: np.ndarray
    fates: tuple[Fate, ...]

    @property
    def missed(self) -> np.ndarray:
        """(T, V) bool, views that could show a track and did not."""
        return (self.sight == Sight.VISIBLE) & ~self.seen

    @property
    def hidden(self) -> np.ndarray:
        """(T, V) bool, views in which something was before a track, or no depth."""
        return (self.sight == Sight.HIDDEN) & ~self.seen

    @property
    def shares(self) -> np.ndarray:
        """(T,) share of the views that could show a track in which it was seen; a view that did could."""
        return _shares(self.seen, self.missed)

    @property
    def objects(self) -> np.ndarray:
        """(T,) 1 - P(background)."""
        return 1.0 - self.posterior[:, -1]

    @property
    def labels(self) -> np.ndarray:
        """(T,) int64 class of the kept tracks, `NOBODY` for the others: they are background."""
        kept = np.array([fate is Fate.KEPT for fate in self.fates], dtype=np.bool_)
        best = self.posterior.argmax(axis=1) if len(kept) else np.empty(0, dtype=np.int64)
        return np.where(kept, best, NOBODY)

    def count(self, fate: Fate) -> int:
        """Tracks with this fate."""
        return sum(one is fate for one in self.fates)


def assess(
    log_posterior: np.ndarray,
    centroids: np.ndarray,
    views: Sequence[KeptView],
    sights: np.ndarray,
    config: MultiViewConfig,
) -> Assessment:
    """Decide on every track.

    Args:
        log_posterior: (T, K + 1), the background last.
        centroids: (T, 3) world, metres.
        views: V of them.
        sights: (T, V) `Sight` of the centroids in them.
        config: for the share and the least number of views.
    """
    seen = np.zeros(sights.shape, dtype=np.bool_)
    for column, view in enumerate(views):
        seen[view.track[view.track != NOBODY], column] = True
    shares = _shares(seen, (sights == Sight.VISIBLE) & ~seen)
    often = (shares >= config.min_share) & (seen.sum(axis=1) >= config.min_views)
    posterior = np.exp(log_posterior)
    background = posterior.argmax(axis=1) == posterior.shape[1] - 1 if len(posterior) else np.zeros(0, dtype=np.bool_)
    fates = [
        Fate.DROPPED if not enough else Fate.BACKGROUND if nothing else Fate.KEPT
        for enough, nothing in zip(often, background, strict=True)
    ]
    views_of_each = np.maximum(seen.sum(axis=1), 1)[:, None]
    per_view = softmax(log_posterior / views_of_each, axis=1) if len(posterior) else posterior
    return Assessment(posterior, per_view, centroids, seen, sights, tuple(fates))


def _shares(seen: np.ndarray, missed: np.ndarray) -> np.ndarray:
    could = seen.sum(axis=1) + missed.sum(axis=1)
    return seen.sum(axis=1) / np.maximum(could, 1)

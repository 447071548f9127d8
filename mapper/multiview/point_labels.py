"""Classes of the cloud's points by the masks they project into (Georgakis et al., section IV, 3D point labelling)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...datasets.truth import NO_OBJECT
from .kept_views import NOBODY, KeptView, ViewStack
from .kernels import vote_for_points


def label_points(
    points: np.ndarray,
    views: Sequence[KeptView],
    stack: ViewStack,
    labels: np.ndarray,
    classes: int,
    same_surface: float,
) -> np.ndarray:
    """Every view that sees a point votes for the final label of the track in whose mask it is, or for none.

    A view sees a point that its depth agrees with. The label with most votes wins; none wins where it has as many as
    another, and of two classes the first.

    Args:
        points: (M, 3) world, metres.
        views, stack: V of them, in the same order.
        labels: (T,) class of each track, `NOBODY` for background.
        classes: how many there are.
        same_surface: metres between a point's depth and the view's.

    Returns:
        (M,) int64 class, `NO_OBJECT` for background and what no view sees.
    """
    named = np.append(labels, NOBODY)  # the last for pixels and detections of nobody, whose -1 leads there
    votes = np.stack([named[np.append(view.track, NOBODY)][view.owner] for view in views]).astype(np.int32)
    winners = vote_for_points(
        np.ascontiguousarray(points, dtype=np.float64),
        stack.T_camera_world,
        stack.camera,
        stack.step,
        stack.depth_mm,
        votes,
        classes,
        float(same_surface),
    )
    return np.where(winners < 0, NO_OBJECT, winners)

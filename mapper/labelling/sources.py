"""From what a detector found in a frame to the log probabilities of its pixels.

Where the detector makes probability maps itself (`detect_dense`), they are taken as they are: they have boxes spread by
depth in them. Otherwise a pixel in the mask of a detection has the detection's probability of each class, and one in a
box without a mask what depth leaves of it (Lai et al., eq. 12). Where several detections cover a pixel the greatest
value counts for each class; what none covers has the least one. Background follows from the classes (eq. 5).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit

from ...datasets.frame import Frame, Intrinsics
from ...detectors.detections import Detections, Part
from ...detectors.hog.refinement import ClassBoxes, refine
from ...detectors.probability_maps import ProbabilityMaps
from .labelling_config import SourceConfig
from .pixel_evidence import PixelEvidence, pixel_grid


def evidence_of(
    frame: Frame, detections: Detections, maps: ProbabilityMaps | None, step: int, config: SourceConfig
) -> PixelEvidence:
    """What a frame says of every `step`-th of its pixels that has a depth in range.

    Args:
        frame: with depth of the colour image's size.
        detections: in it; halves of objects are not looked at, as their wholes are found too or not believed.
        maps: of it, of the same classes, where the detector makes them.
        step: pixels.
        config: numbers.
    """
    uv = pixel_grid(frame, step, config.near, config.far)
    if maps is not None:
        log_p = _logarithms(maps.probabilities, uv, config.least_maps, config.alpha, maps.background)
        return PixelEvidence(maps.classes, uv, log_p)
    p = _of_detections(frame, detections, step, config)
    return PixelEvidence(detections.classes, uv, _logarithms(p, uv // step, config.least, config.alpha))


def log_probabilities(p: np.ndarray, config: SourceConfig) -> np.ndarray:
    """(P, K + 1) float32 logarithms of (P, K) p(c | x), none below `least` or above 1 - `least`, and the background's.

    The background's probability is alpha min_c (1 - p(c | x)) (eq. 5).
    """
    column = np.stack([np.zeros(len(p), np.int32), np.arange(len(p), dtype=np.int32)], axis=1)
    return _logarithms(p.T[:, :, None], column, config.least, config.alpha)


def _logarithms(
    p: np.ndarray, uv: np.ndarray, least: float, alpha: float, background: np.ndarray | None = None
) -> np.ndarray:
    """The same of some pixels (column, row) of (K, H, W) maps; of the (H, W) background where that is given."""
    p = np.ascontiguousarray(p, dtype=np.float32)
    given = np.empty((0, 0), np.float32) if background is None else np.ascontiguousarray(background, dtype=np.float32)
    return _take(p, given, np.ascontiguousarray(uv), least, alpha)


@njit(cache=True)
def _take(p, background, uv, least, alpha) -> np.ndarray:
    classes = len(p)
    log_p = np.empty((len(uv), classes + 1), np.float32)
    log_least, log_most = np.log(least), np.log(1.0 - least)
    for i in range(len(uv)):
        u, v = uv[i, 0], uv[i, 1]
        most = 0.0
        for k in range(classes):
            value = p[k, v, u]
            most = max(most, value)
            if value <= least:  # most pixels: logarithms are what takes the time
                log_p[i, k] = log_least
            else:
                log_p[i, k] = log_most if value >= 1.0 - least else np.log(value)
        rest = background[v, u] if len(background) > 0 else alpha * (1.0 - min(max(most, least), 1.0 - least))
        log_p[i, classes] = np.log(min(max(rest, alpha * least), 1.0 - least))
    return log_p


def _of_detections(frame: Frame, detections: Detections, step: int, config: SourceConfig) -> np.ndarray:
    """(K, H / step, W / step) float32 p(c | x) of every `step`-th pixel of every `step`-th row; 0 where nothing is."""
    rows, columns = frame.depth[::step, ::step].shape
    p = np.zeros((len(detections.classes), rows, columns), dtype=np.float32)
    if len(detections) == 0:
        return p
    is_sure = detections.confidence >= config.refined_from
    found = detections.select(np.flatnonzero((detections.part == Part.WHOLE) & is_sure))
    masks = np.zeros((len(found), rows, columns), dtype=bool) if found.mask is None else found.mask[:, ::step, ::step]
    has_mask = masks.any(axis=(1, 2))
    refine(p, _every(frame, step), _boxes_of(found.select(np.flatnonzero(~has_mask)), step, config.least), config.gamma)
    _cover(p, masks, has_mask, np.nan_to_num(found.scores).astype(np.float32))
    return p


@njit(cache=True, nogil=True)
def _cover(p, masks, has_mask, scores) -> None:  # pragma: no cover
    """(K, H, W) p becomes the greatest of itself and, in each of (N, H, W) masks, of its (N, K) scores, where (N,) say
    that there is one."""
    classes, height, width = p.shape
    for n in range(len(masks)):
        if has_mask[n]:
            for v in range(height):
                for u in range(width):
                    if masks[n, v, u]:
                        for k in range(classes):
                            p[k, v, u] = max(p[k, v, u], scores[n, k])


def _every(frame: Frame, step: int) -> Frame:
    """The frame as a camera of larger pixels sees it, whose centres are those of every `step`-th one."""
    k, depth = frame.intrinsics, np.ascontiguousarray(frame.depth[::step, ::step])
    fewer = Intrinsics(depth.shape[1], depth.shape[0], k.fx / step, k.fy / step, k.cx / step, k.cy / step)
    return replace(frame, color=frame.color[::step, ::step], depth=depth, intrinsics=fewer)


def _boxes_of(found: Detections, step: int, least: float) -> ClassBoxes:
    """A box for every class of which a detection has a score above `least`, in pixels of `_every`.

    A pixel (i) of those is pixel (step i) of the image, and the box contains the one where it contains the other's
    centre; boxes count from the image's outer edge, half a pixel before the first centre.
    """
    n, class_id = np.nonzero(found.scores > least)  # not where it is NaN: unknown
    return ClassBoxes(class_id, (found.xyxy[n] - 0.5) / step + 0.5, found.scores[n, class_id])

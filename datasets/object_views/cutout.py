"""An object without its surroundings, at any size and distance."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from .object_view import ObjectView, mask_box

RIM = 2  # pixels about a cut-out, for
LENS = 0.6  # pixels, deviation of the blur of its outline: no image has outlines as hard as a mask's
FOOT = 0.05  # of the object's height, its lowest part, which stands on something


@dataclass(frozen=True, slots=True, eq=False)
class Cutout:
    """An object alone.

    Attributes:
        color: (H, W, 3) float32 RGB, multiplied by
        coverage: (H, W) float32, share of each pixel that the object covers.
        depth: (H, W) float32 metres, 0 outside the object and where there is no reading; None without.
    """

    color: np.ndarray
    coverage: np.ndarray
    depth: np.ndarray | None

    def scaled(self, scale: float, farther: float = 0.0) -> Cutout:
        """At another size, and so many metres farther away: a moved object keeps its relief."""
        height, width = self.coverage.shape
        size = (max(round(width * scale), 1), max(round(height * scale), 1))
        how = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
        color, coverage = (cv2.resize(image, size, interpolation=how) for image in (self.color, self.coverage))
        if self.depth is None:
            return Cutout(color, coverage, None)
        depth = cv2.resize(self.depth, size, interpolation=cv2.INTER_NEAREST)  # a mean would invent depths at edges
        return Cutout(color, coverage, np.where(depth > 0.0, depth + np.float32(farther), np.float32(0.0)))

    def foot(self) -> tuple[float, float, float] | None:
        """Column, row and depth of the point on which the object stands, the middle of its lowest edge.

        None where nothing of the object was measured.
        """
        if self.depth is None or not self.depth.any():
            return None
        rows, columns = np.nonzero(self.depth)
        low = rows >= rows.max() - FOOT * (rows.max() - rows.min())
        return float(columns[low].mean()), float(rows.max()), float(np.median(self.depth[rows[low], columns[low]]))


def cut(view: ObjectView) -> Cutout:
    """The object within its mask's box and a rim for the blur of its outline.

    Raises:
        ValueError: the view has no mask.
        BrokenView: its mask is empty.
    """
    if view.mask is None:
        raise ValueError(f"{view.name} has no mask, so that it cannot be cut out")
    left, top, right, bottom = mask_box(view.mask).astype(int)
    inside = np.s_[top:bottom, left:right]
    mask = _rimmed(view.mask[inside].astype(np.float32))
    color = _rimmed(view.color[inside].astype(np.float32)) * mask[..., None]
    depth = None if view.depth is None else _rimmed(view.depth[inside]) * mask
    return Cutout(cv2.GaussianBlur(color, (3, 3), LENS), cv2.GaussianBlur(mask, (3, 3), LENS), depth)


def _rimmed(image: np.ndarray) -> np.ndarray:
    return cv2.copyMakeBorder(image, RIM, RIM, RIM, RIM, cv2.BORDER_CONSTANT, value=0)

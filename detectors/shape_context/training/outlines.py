"""The edges of the object of one view: what codebooks are made of, and what votes when they are tried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....datasets.object_views.object_view import BrokenView, ObjectView
from ..codebook import Codebook
from ..config import Context
from ..described import describe
from ..edge_map import EdgeMap
from ..edges import find_edges
from ..sampling import edge_owners
from ..scoring import ImageScores, Rivals, score_proposals
from .config import TrainConfig


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """A view's object by its edges; as a proposal it is number 0.

    Attributes:
        edges: E points of the image.
        owner: (E,) int32, 0 for the object's points, -1 for others.
        labels: (H, W) int32, 0 on the object, -1 elsewhere.
        xyxy: (4,) pixels, the object's box.
        focal: pixels.
        depth: metres, z_t, the median of the object's.
    """

    edges: EdgeMap
    owner: np.ndarray
    labels: np.ndarray
    xyxy: np.ndarray
    focal: float
    depth: float

    @property
    def scale(self) -> float:
        """Metres at the object that a pixel is, z_t / f."""
        return self.depth / self.focal

    @property
    def size(self) -> np.ndarray:
        """(2,) metres, width and height of the box."""
        return (self.xyxy[2:] - self.xyxy[:2]) * self.scale

    def points(self) -> np.ndarray:
        """(P,) int64 into `edges`: those of the object that can vote, by their direction from the middle of its box."""
        own = np.flatnonzero((self.owner == 0) & (self.edges.depth > 0.0))
        x, y = self.offsets(own).T
        return own[np.argsort(np.arctan2(-y, -x), kind="stable")]

    def offsets(self, points: np.ndarray) -> np.ndarray:
        """(P, 2) metres right and down from points to the middle of the box, q z_t / f."""
        middle = (self.xyxy[:2] + self.xyxy[2:]) / 2.0 - 0.5  # boxes count from the outer edge of the first pixel
        return (middle - np.stack([self.edges.columns[points], self.edges.rows[points]], axis=1)) * self.scale

    def scores(self, codebooks: Sequence[Codebook], config: TrainConfig, rivals: Rivals | None = None) -> ImageScores:
        """What classes say of the object: its mask is the only proposal."""
        described = describe(self.edges, self.owner, self.focal, config.voting)
        return score_proposals(described, self.labels, self.xyxy[None], codebooks, config.voting, rivals)


def object_depth(view: ObjectView) -> float:
    """Metres, z_t: the median depth of the object.

    Raises:
        BrokenView: the view has no depth, no mask, or no reading inside it.
    """
    if view.depth is None:
        raise BrokenView("no depth")
    if view.mask is None:
        raise BrokenView("no mask of the object")
    readings = view.depth[view.mask]
    readings = readings[readings > 0.0]
    if len(readings) == 0:
        raise BrokenView("no depth measured on the object")
    return float(np.median(readings))


def outline(view: ObjectView, config: TrainConfig) -> Outline:
    """The object's edges, found and given to it as those of proposals are.

    Raises:
        BrokenView: as `object_depth`; or there are too few edge points.
    """
    depth = object_depth(view)
    assert view.depth is not None and view.mask is not None
    within = view.mask if config.voting.context is Context.PROPOSAL else None
    edges = find_edges(view.color, view.depth, within=within)
    labels = np.where(view.mask, np.int32(0), np.int32(-1))
    found = Outline(edges, edge_owners(edges, labels, view.depth), labels, view.xyxy, view.focal, depth)
    count = len(found.points())
    if count < config.fewest_points:
        raise BrokenView(f"{count} edge points on the object, {config.fewest_points} needed")
    return found

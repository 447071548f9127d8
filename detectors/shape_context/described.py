"""The described points of an image: shape contexts of every radius asked for, and their matches."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .codebook import Codebook
from .config import Context, VotingConfig
from .descriptor import shape_contexts
from .edge_map import EdgeMap
from .matching import best_matches
from .sampling import Samples, sample_points
from .voting import Voters


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """S points of an image that may vote.

    Attributes:
        edges: of the image.
        owner: (E,) int32, the proposal of each edge point, -1 for none.
        focal: pixels.
        samples: which points.
        voters: where they are.
        config: the numbers.
    """

    edges: EdgeMap
    owner: np.ndarray
    focal: float
    samples: Samples
    voters: Voters
    config: VotingConfig
    _contexts: dict[tuple[float, float], np.ndarray] = field(default_factory=dict, repr=False)

    def contexts(self, radius: float, scale: float) -> np.ndarray:
        """(S, LENGTH) shape contexts of r = r_t z_t / z; asked again for a radius, the same array.

        Args:
            radius: metres at the object.
            scale: z_t / f of the training images, by which r_t is r in pixels where the radius does not follow depth.
        """
        follows = self.config.scale_radius
        key = (radius, 0.0 if follows else scale)
        if key not in self._contexts:
            metres_a_pixel = self.voters.depth / self.focal if follows else np.full(len(self.voters.depth), scale)
            own = self.owner if self.config.context is Context.PROPOSAL else None
            pixels = (radius / metres_a_pixel).astype(np.float32)
            turn = self.voters.turn
            self._contexts[key] = shape_contexts(self.edges, self.samples.points, pixels, own, turn)
        return self._contexts[key]

    def matches(self, descriptors: np.ndarray, codebook: Codebook, k: int) -> tuple[np.ndarray, np.ndarray]:
        """(S, k) int32 nearest of (M, LENGTH) descriptors of a codebook's radius, and (S, k) chi-square distances.

        A point without an edge around it looks like nothing: its distances are infinite.
        """
        contexts = self.contexts(codebook.radius, codebook.depth)
        index, distance = best_matches(contexts, descriptors, k)
        distance[~contexts.any(axis=1)] = np.inf
        return index, distance

    def lengths(self, count: int) -> np.ndarray:
        """(count,) metres, the length of each proposal's contours: a point of an edge is as long as its pixel."""
        usable = (self.owner >= 0) & (self.edges.depth > 0.0)
        return np.bincount(self.owner[usable], self.edges.depth[usable] / self.focal, count)


def describe(
    edges: EdgeMap, owner: np.ndarray, focal: float, config: VotingConfig, turn: np.ndarray | None = None
) -> Described:
    """Samples the points.

    Args:
        edges: E points.
        owner: (E,) int32, the proposal of each, -1 for none.
        focal: pixels.
        config: the numbers.
        turn: (E,) radians, as `local_turn` gives; None for a camera held upright.
    """
    samples = sample_points(edges, owner, config.samples, config.proposal_samples)
    points = samples.points
    voters = Voters(
        np.stack([edges.columns[points], edges.rows[points]], axis=1).astype(np.float64),
        edges.depth[points].astype(np.float64),
        samples.owner,
        samples.weight,
        np.zeros(len(points)) if turn is None else turn[points],
    )
    return Described(edges, owner, focal, samples, voters, config)

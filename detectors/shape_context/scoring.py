"""One image: described edge points vote, votes are pruned, hypotheses are verified (Georgakis et al., III-A)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...datasets.frame import Frame
from ..proposals.proposals import Proposals
from .codebook import Codebook
from .config import Context, VotingConfig
from .descriptor import shape_contexts
from .edge_map import EdgeMap
from .edges import find_edges
from .hypotheses import Hypotheses, find_hypotheses
from .matching import best_matches
from .sampling import Samples, edge_owners, sample_points
from .verification import class_scores
from .voting import Voters, Votes, cast_votes, valid_votes


@dataclass(frozen=True, slots=True, eq=False)
class ImageScores:
    """What C classes say of the N proposals of an image.

    Attributes:
        normalised: (N, C) scores (s - mu) / sigma, NaN where a class has no hypothesis for a proposal.
        boxes: (N, C, 4) pixels, boxes of those hypotheses, NaN likewise.
        hypotheses: of each class, before verification.
        votes: of each class, to which the voters of its hypotheses count.
    """

    normalised: np.ndarray
    boxes: np.ndarray
    hypotheses: tuple[Hypotheses, ...]
    votes: tuple[Votes, ...]


def score_frame(
    frame: Frame, found: Proposals, looked_at: np.ndarray, codebooks: Sequence[Codebook], config: VotingConfig
) -> ImageScores:
    """Scores of a frame's proposals.

    Args:
        frame: the image.
        found: its proposals.
        looked_at: (N,) bool; of the others no points are taken, and nothing is found.
        codebooks: of the classes.
        config: the numbers.
    """
    labels = np.where(np.append(looked_at, False)[found.labels], found.labels, np.int32(-1))
    within = labels >= 0 if config.context is Context.PROPOSAL else None
    edges = find_edges(frame.color, frame.depth, within=within)
    owner = edge_owners(edges, labels, frame.depth)
    return score_proposals(edges, owner, labels, found.xyxy, frame.intrinsics.fx, codebooks, config)


def score_proposals(
    edges: EdgeMap,
    owner: np.ndarray,
    labels: np.ndarray,
    xyxy: np.ndarray,
    focal: float,
    codebooks: Sequence[Codebook],
    config: VotingConfig,
) -> ImageScores:
    """The same from an image's edges; what training and validation call on a view of one object.

    Args:
        edges: E points.
        owner: (E,) int32, the proposal of each, -1 for none.
        labels: (H, W) int32, the proposal of each pixel, -1 for none.
        xyxy: (N, 4) pixels, boxes of the proposals.
        focal: pixels.
        codebooks: of the classes.
        config: the numbers.
    """
    samples = sample_points(edges, owner, config.samples, config.proposal_samples)
    voters = Voters(
        np.stack([edges.columns[samples.points], edges.rows[samples.points]], axis=1).astype(np.float64),
        edges.depth[samples.points].astype(np.float64),
        samples.owner,
        samples.weight,
    )
    sides = np.sqrt((xyxy[:, 2:] - xyxy[:, :2]).prod(axis=1))
    described: dict[float, np.ndarray] = {}
    hypotheses, valid = [], []
    for book in codebooks:
        if book.radius not in described:
            described[book.radius] = _describe(edges, owner, samples, voters, focal, book, config)
        contexts = described[book.radius]
        index, distance = best_matches(contexts, book.descriptors, config.matches)
        distance[~contexts.any(axis=1)] = np.inf  # with no edge around it, a point looks like nothing
        votes = cast_votes(voters, index, distance, book, focal, config.bandwidth)
        valid.append(votes.select(valid_votes(votes, labels, config.prune)))
        hypotheses.append(_hypotheses(valid[-1], sides, config))
    normalised, boxes = class_scores(hypotheses, codebooks, xyxy, config.min_iou)
    return ImageScores(normalised, boxes, tuple(hypotheses), tuple(valid))


def _hypotheses(votes: Votes, sides: np.ndarray, config: VotingConfig) -> Hypotheses:
    """Of every proposal by itself; without pruning of the image as a whole, smoothed by the votes' usual size."""
    if config.prune or not len(votes):
        return find_hypotheses(votes, sides, config)
    together = replace(votes, group=np.zeros_like(votes.group))
    return find_hypotheses(together, np.sqrt(np.median(votes.size.prod(axis=1), keepdims=True)), config)


def _describe(
    edges: EdgeMap,
    owner: np.ndarray,
    samples: Samples,
    voters: Voters,
    focal: float,
    codebook: Codebook,
    config: VotingConfig,
) -> np.ndarray:
    """(S, LENGTH) shape contexts of the radius of a codebook, r = r_t z_t / z."""
    depth = voters.depth / focal if config.scale_radius else np.full(len(voters.depth), codebook.depth)
    radius = (codebook.radius / depth).astype(np.float32)
    return shape_contexts(edges, samples.points, radius, owner if config.context is Context.PROPOSAL else None)

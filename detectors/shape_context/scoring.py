"""One image: described edge points vote, votes are pruned, hypotheses are verified (Georgakis et al., III-A)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...datasets.frame import Frame
from ..proposals.proposals import Proposals
from .codebook import Codebook
from .config import Context, VotingConfig
from .contour import contour_evidence
from .described import Described, describe
from .edges import find_edges
from .hypotheses import Hypotheses, find_hypotheses
from .local_turn import local_turn
from .sampling import edge_owners
from .verification import class_scores
from .voting import Votes, cast_votes, valid_votes

Rivals = Mapping[float, np.ndarray]
"""Radius -> (B, LENGTH) descriptors of things that are none of the classes, for each radius of the codebooks."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageScores:
    """What C classes say of the N proposals of an image.

    Attributes:
        normalised: (N, C) scores (s - mu) / sigma, NaN where a class has no verified hypothesis for a proposal.
        strength: (N, C) s / mu, the same scores from 0 on; 0 where there is none.
        agreement: (N, C) s over the edge points that the proposal has itself, counted at the scale of the training
            images; 0 where there is no hypothesis.
        contour: (N, C) see `contour_evidence`; 0 without rivals.
        boxes: (N, C, 4) pixels, boxes of the hypotheses, NaN where there is none.
        hypotheses: of each class, before verification.
        votes: of each class, to which the voters of its hypotheses count.
    """

    normalised: np.ndarray
    strength: np.ndarray
    agreement: np.ndarray
    contour: np.ndarray
    boxes: np.ndarray
    hypotheses: tuple[Hypotheses, ...]
    votes: tuple[Votes, ...]


def score_frame(
    frame: Frame,
    found: Proposals,
    looked_at: np.ndarray,
    codebooks: Sequence[Codebook],
    config: VotingConfig,
    rivals: Rivals | None = None,
) -> ImageScores:
    """Scores of a frame's proposals.

    Args:
        frame: the image.
        found: its proposals.
        looked_at: (N,) bool; of the others no points are taken, and nothing is found.
        codebooks: of the classes.
        config: the numbers.
        rivals: what is none of the classes, where that is known.
    """
    described, labels = describe_frame(frame, found, looked_at, config)
    return score_proposals(described, labels, found.xyxy, codebooks, config, rivals)


def describe_frame(
    frame: Frame, found: Proposals, looked_at: np.ndarray, config: VotingConfig
) -> tuple[Described, np.ndarray]:
    """The described points of the proposals that are looked at, and (H, W) int32 the proposals of pixels without the
    others; arguments as for `score_frame`."""
    labels = np.where(np.append(looked_at, False)[found.labels], found.labels, np.int32(-1))
    within = labels >= 0 if config.context is Context.PROPOSAL else None
    edges = find_edges(frame.color, frame.depth, within=within)
    owner = edge_owners(edges, labels, frame.depth)
    turn = local_turn(edges, frame.intrinsics, found.planes.up) if config.upright else None
    return describe(edges, owner, frame.intrinsics.fx, config, turn), labels


def score_proposals(
    described: Described,
    labels: np.ndarray,
    xyxy: np.ndarray,
    codebooks: Sequence[Codebook],
    config: VotingConfig,
    rivals: Rivals | None = None,
) -> ImageScores:
    """The same from an image's described points; what training and validation call on a view of one object.

    Args:
        described: points of the image.
        labels: (H, W) int32, the proposal of each pixel, -1 for none.
        xyxy: (N, 4) pixels, boxes of the proposals.
        codebooks: C of them, of the classes.
        config: the numbers.
        rivals: as for `score_frame`.
    """
    voters, count = described.voters, len(xyxy)
    sides = np.sqrt((xyxy[:, 2:] - xyxy[:, :2]).prod(axis=1))
    hypotheses, valid = [], []
    contour, away = np.zeros((count, len(codebooks))), {}
    for number, book in enumerate(codebooks):
        index, distance = described.matches(book.descriptors, book, config.matches)
        votes = cast_votes(voters, index, distance, book, described.focal, config.bandwidth)
        valid.append(votes.select(valid_votes(votes, labels, config.prune)))
        hypotheses.append(_hypotheses(valid[-1], sides, config))
        if rivals:
            if book.radius not in away:
                _, away[book.radius] = described.matches(rivals[book.radius], book, config.matches)
            contour[:, number] = contour_evidence(distance, away[book.radius], voters.owner, count, config.bandwidth)
    normalised, boxes = class_scores(hypotheses, codebooks, xyxy, config.min_iou)
    mean = np.array([book.edge_mean for book in codebooks])
    strength = np.nan_to_num(1.0 + normalised * np.array([book.edge_std for book in codebooks]) / mean)
    own = described.lengths(count)[:, None] / np.array([book.depth for book in codebooks])
    agreement = strength * mean / np.maximum(own, 1.0)
    return ImageScores(normalised, strength, agreement, contour, boxes, tuple(hypotheses), tuple(valid))


def _hypotheses(votes: Votes, sides: np.ndarray, config: VotingConfig) -> Hypotheses:
    """Of every proposal by itself; without pruning of the image as a whole, smoothed by the votes' usual size."""
    if config.prune or not len(votes):
        return find_hypotheses(votes, sides, config)
    together = replace(votes, group=np.zeros_like(votes.group))
    return find_hypotheses(together, np.sqrt(np.median(votes.size.prod(axis=1), keepdims=True)), config)

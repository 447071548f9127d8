"""Votes for the middles of objects: every match of a described point with a codebook casts one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .codebook import Codebook


@dataclass(frozen=True, slots=True, eq=False)
class Voters:
    """S described points that may vote.

    Attributes:
        xy: (S, 2) pixels, pixel centres at integers.
        depth: (S,) metres.
        owner: (S,) int32, proposal.
        weight: (S,) edge points that each stands for.
        turn: (S,) radians from x towards y, how far what is upright there is turned in the image.
    """

    xy: np.ndarray
    depth: np.ndarray
    owner: np.ndarray
    weight: np.ndarray
    turn: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Votes:
    """V votes of one class.

    Attributes:
        xy: (V, 2) pixels, where the middle of the object's box should be.
        size: (V, 2) pixels, width and height that the box should have.
        weight: (V,) edge points at the scale of the training images, see `cast_votes`.
        group: (V,) int32, the proposal that the vote came from.
        voter: (V,) int32, the point that cast it.
    """

    xy: np.ndarray
    size: np.ndarray
    weight: np.ndarray
    group: np.ndarray
    voter: np.ndarray

    def __len__(self) -> int:
        return len(self.xy)

    def select(self, keep: np.ndarray) -> Votes:
        """The votes that a (V,) bool mask names."""
        return Votes(self.xy[keep], self.size[keep], self.weight[keep], self.group[keep], self.voter[keep])


def cast_votes(
    voters: Voters, index: np.ndarray, distance: np.ndarray, codebook: Codebook, focal: float, bandwidth: float
) -> Votes:
    """The votes of all matches, at l_i + q_i z_t / z_l (section III-A), where q_i turns with the camera.

    A vote weighs exp(-chi^2 / bandwidth) / K, times the edge points that its voter stands for, times z_l / z_t of the
    same focal length: contours are longer in pixels the nearer they are, so the votes for one object add up to the
    number of its edge points that agree, counted at the scale of the training images.

    Args:
        voters: S points.
        index: (S, K) entries of the codebook.
        distance: (S, K) chi-square distances to them.
        codebook: of the class.
        focal: pixels, of the image.
        bandwidth: see above.
    """
    count, k = index.shape
    pixels = focal / voters.depth  # a metre at the voter
    voter = np.repeat(np.arange(count, dtype=np.int32), k)
    flat = index.ravel()
    scale = pixels[voter, None]
    agreement = np.exp(-distance / bandwidth) / max(k, 1)
    at_training = voters.weight / (pixels * codebook.depth)
    right, down = codebook.offsets[flat].T
    c, s = np.cos(voters.turn)[voter], np.sin(voters.turn)[voter]
    return Votes(
        xy=voters.xy[voter] + np.stack([c * right - s * down, s * right + c * down], axis=1) * scale,
        size=codebook.sizes[flat] * scale,
        weight=(agreement * at_training[:, None]).ravel(),
        group=voters.owner[voter],
        voter=voter,
    )


def valid_votes(votes: Votes, labels: np.ndarray, prune: bool) -> np.ndarray:
    """(V,) bool, equation (1): whether a vote ends on the mask of the proposal that it began on.

    Args:
        votes: any number.
        labels: (H, W) int32, the proposal of each pixel.
        prune: without, whether it ends in the image.
    """
    height, width = labels.shape
    pixel = np.floor(votes.xy + 0.5)
    x, y = pixel[:, 0], pixel[:, 1]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    if not prune:
        return inside
    column, row = np.where(inside, x, 0).astype(np.int64), np.where(inside, y, 0).astype(np.int64)
    return inside & (labels[row, column] == votes.group)

"""From an image to the scores of its proposals: cards of two shapes before a wall."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from thingmap.detectors.shape_context.codebook import Codebook
from thingmap.detectors.shape_context.config import Context, VotingConfig
from thingmap.detectors.shape_context.described import describe
from thingmap.detectors.shape_context.descriptor import shape_contexts
from thingmap.detectors.shape_context.edges import find_edges
from thingmap.detectors.shape_context.sampling import edge_owners
from thingmap.detectors.shape_context.scoring import ImageScores, score_proposals

FOCAL, WALL = 300.0, 3.0
SIDE = 0.2  # metres, of a card
SHAPES = ("disc", "cross")
RADIUS = 0.08  # metres, of descriptors


def card(shape: str, side: int) -> np.ndarray:
    stamp = np.zeros((side, side), np.uint8)
    if shape == "disc":
        cv2.circle(stamp, (side // 2, side // 2), side // 2 - 1, 1, -1)
    else:
        third = side // 3
        stamp[third:-third] = stamp[:, third:-third] = 1
    return stamp.astype(bool)


class Picture:
    """Cards (shape, column, row, metres away) with a label image, each its own proposal."""

    def __init__(self, *cards: tuple[str, int, int, float], shape: tuple[int, int] = (240, 320)) -> None:
        self.color = np.full((*shape, 3), 90, np.uint8)
        self.depth = np.full(shape, WALL, np.float32)
        self.labels = np.full(shape, -1, np.int32)
        boxes = []
        for number, (kind, x, y, z) in enumerate(cards):
            side = round(SIDE * FOCAL / z)
            there = np.s_[y : y + side, x : x + side]
            on = card(kind, side)
            self.depth[there][on], self.labels[there][on] = z, number
            boxes.append([x, y, x + side, y + side])
        self.xyxy = np.array(boxes, dtype=np.float64).reshape(-1, 4)

    def edges(self):
        edges = find_edges(self.color, self.depth)
        return edges, edge_owners(edges, self.labels, self.depth)

    def scores(self, books, config: VotingConfig, rivals=None) -> ImageScores:
        described = describe(*self.edges(), FOCAL, config)
        return score_proposals(described, self.labels, self.xyxy, books, config, rivals)


@pytest.fixture(scope="module")
def books() -> list[Codebook]:
    """Of each shape, learned from one picture at 1 m."""
    found = []
    for shape in SHAPES:
        edges, owner = Picture((shape, 100, 80, 1.0)).edges()
        points = np.flatnonzero(owner == 0)
        radius = np.full(len(points), RADIUS * FOCAL, np.float32)
        xy = np.stack([edges.columns, edges.rows], axis=1)[points]
        middle = np.array([100, 80]) + SIDE * FOCAL / 2 - 0.5
        size = np.full((len(points), 2), SIDE)
        bins = shape_contexts(edges, points, radius, owner)
        found.append(Codebook(bins, (middle - xy) / FOCAL, size, RADIUS, len(points), len(points) / 10, 1.0 / FOCAL))
    return found


CONFIG = VotingConfig(bandwidth=0.2, samples=400, proposal_samples=100)


@pytest.mark.parametrize("depth", [0.8, 1.0, 1.6])
def test_shapes_are_told_apart_at_every_distance(books, depth):
    picture = Picture(("disc", 20, 20, depth), ("cross", 200, 120, depth))
    scores = picture.scores(books, CONFIG)
    own, other = np.diag(scores.normalised), np.diag(scores.normalised[:, ::-1])
    assert np.isfinite(own).all()
    assert (own > np.nan_to_num(other, nan=-99.0) + 1.0).all()
    for k in range(2):
        np.testing.assert_allclose(scores.boxes[k, k], picture.xyxy[k], atol=0.15 * SIDE * FOCAL / depth)


def test_the_learned_picture_itself_scores_what_its_contour_is_long(books):
    """All edge points agree: s is mu, so the normalised score is near 0 (mu is sigma times 10 here)."""
    scores = Picture(("disc", 60, 60, 1.0)).scores(books[:1], replace(CONFIG, matches=1))
    assert -3.0 < scores.normalised[0, 0] <= 0.5


def test_the_score_does_not_follow_the_size_in_the_image(books):
    near, far = (Picture(("disc", 60, 60, z)).scores(books[:1], CONFIG).normalised[0, 0] for z in (0.9, 1.5))
    assert abs(near - far) < 2.5  # of 10: the contour itself is 1.7 times as long


def test_without_scaling_the_radius_a_far_thing_is_matched_worse(books):
    far = Picture(("cross", 60, 60, 1.8))
    scaled, fixed = (far.scores(books, replace(CONFIG, scale_radius=scale)).normalised[0, 1] for scale in (True, False))
    assert np.isfinite(scaled) and not fixed >= scaled


def test_pruning_keeps_the_votes_of_one_thing_off_its_neighbour(books):
    """Unpruned, some votes for the middle of a card come from its neighbour; pruned, none does."""
    picture = Picture(("disc", 20, 60, 1.0), ("cross", 84, 60, 1.0))
    astray = {}
    for prune in (True, False):
        scores = picture.scores(books, replace(CONFIG, prune=prune))
        astray[prune] = 0
        for found, votes in zip(scores.hypotheses, scores.votes, strict=True):
            for middle, voters in zip(np.round(found.xy).astype(int), found.voters, strict=True):
                astray[prune] += int((votes.group[voters] != picture.labels[middle[1], middle[0]]).sum())
    assert astray[True] == 0 < astray[False]


def test_contexts_of_the_whole_image_count_the_neighbours_edges(books):
    alone, crowded = Picture(("disc", 60, 60, 1.0)), Picture(("disc", 60, 60, 1.0), ("cross", 122, 60, 1.0))
    loss = {}
    for context in Context:
        config = replace(CONFIG, context=context)
        loss[context] = alone.scores(books, config).normalised[0, 0] - crowded.scores(books, config).normalised[0, 0]
    assert loss[Context.PROPOSAL] < 0.5 * loss[Context.IMAGE]


def test_strength_is_the_normalised_score_from_zero_on(books):
    scores = Picture(("disc", 20, 20, 1.0), ("cross", 200, 120, 1.0)).scores(books, CONFIG)
    for k, book in enumerate(books):
        s = scores.strength[:, k] * book.edge_mean
        known = np.isfinite(scores.normalised[:, k])
        np.testing.assert_allclose(scores.normalised[known, k], ((s - book.edge_mean) / book.edge_std)[known])
        assert (scores.strength[~known, k] == 0.0).all() and (scores.agreement[~known, k] == 0.0).all()
    assert (scores.agreement >= 0.0).all() and (scores.agreement <= 1.0).all()


def test_rivals_that_look_the_same_take_the_contour_s_evidence_away(books):
    picture = Picture(("disc", 20, 20, 1.0), ("cross", 200, 120, 1.0))
    crosses = {RADIUS: books[1].descriptors}
    against_crosses = picture.scores(books, CONFIG, crosses).contour
    assert against_crosses[0, 0] > 0.1  # a disc is no cross
    assert against_crosses[1, 0] < -0.1  # and a cross no disc
    np.testing.assert_allclose(against_crosses[:, 1], 0.0, atol=1e-6)  # crosses are as near to themselves
    assert (picture.scores(books, CONFIG).contour == 0.0).all()


def test_nothing_to_see(books):
    scores = Picture().scores(books, CONFIG)
    assert scores.normalised.shape == scores.contour.shape == (0, 2) and scores.boxes.shape == (0, 2, 4)


def test_the_same_picture_gives_the_same_scores(books):
    picture = Picture(("disc", 20, 20, 1.2), ("cross", 200, 120, 1.1))
    first, again = picture.scores(books, CONFIG), picture.scores(books, CONFIG)
    np.testing.assert_array_equal(first.normalised, again.normalised)

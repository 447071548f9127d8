from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.object_views.object_view import BrokenView
from thingmap.detectors.shape_context.codebook import Codebook
from thingmap.detectors.shape_context.config import Context
from thingmap.detectors.shape_context.training.codebooks import build_codebook
from thingmap.detectors.shape_context.training.outlines import object_depth, outline

CARD = 0.16


@pytest.fixture(scope="module")
def disc(make_view, small):
    return outline(make_view("disc", 2), small)


def test_only_the_objects_own_edges_are_taken(disc, make_view):
    mask = make_view("disc", 2).mask
    points = disc.points()
    assert len(points) > 60 and (disc.owner[points] == 0).all()
    rows, columns = np.nonzero(mask)
    x, y = disc.edges.columns[points], disc.edges.rows[points]
    near = np.hypot(columns[:, None] - x, rows[:, None] - y).min(axis=0)
    assert near.max() <= np.hypot(2, 2)


def test_lengths_are_metres_at_the_object(disc):
    assert disc.depth == pytest.approx(1.0, abs=0.01) and disc.scale == pytest.approx(1.0 / 300.0, rel=0.01)
    assert disc.size == pytest.approx([CARD, CARD], abs=0.01)
    away = np.linalg.norm(disc.offsets(disc.points()), axis=1)
    assert away == pytest.approx(np.full(len(away), CARD / 2), abs=0.02)  # a disc's edge is its rim


def test_offsets_lead_to_the_middle_of_the_box(disc):
    points = disc.points()
    at = np.stack([disc.edges.columns[points], disc.edges.rows[points]], axis=1) + 0.5
    middle = at + disc.offsets(points) / disc.scale
    np.testing.assert_allclose(middle, np.broadcast_to((disc.xyxy[:2] + disc.xyxy[2:]) / 2, middle.shape), atol=1e-9)


def test_points_go_around_the_middle(disc):
    right, down = -disc.offsets(disc.points()).T
    angle = np.arctan2(down, right)
    assert (np.diff(angle) >= 0).all() and angle[0] < -3.0 and angle[-1] > 3.0


def test_twice_as_far_gives_the_same_metres(make_view, small):
    near, far = (outline(make_view("cross", number), small) for number in (0, 4))
    assert near.depth < 0.85 and far.depth > 1.15
    np.testing.assert_allclose(near.size, far.size, atol=0.01)


def test_with_the_image_as_context_the_surroundings_are_kept(make_view, small, disc):
    image = replace(small, voting=replace(small.voting, context=Context.IMAGE))
    view = make_view("disc", 2)
    view.color[:4, ::8] = 0  # something else in the corner of the picture
    view.color[:40, 3:9] = 0
    wide = outline(view, image)
    assert len(wide.edges) > len(wide.points()) and (wide.owner == -1).any()


@pytest.mark.parametrize(("lacking", "reason"), [("depth", "no depth"), ("mask", "no mask of the object")])
def test_what_a_view_lacks_is_said(make_view, lacking, reason):
    with pytest.raises(BrokenView, match=reason):
        object_depth(make_view("disc", 0, **{lacking: False}))


def test_an_object_that_was_not_measured_or_has_no_edge(make_view, small):
    view = make_view("disc", 0)
    with pytest.raises(BrokenView, match="no depth measured on the object"):
        outline(replace(view, depth=np.where(view.mask, np.float32(0), view.depth)), small)
    with pytest.raises(BrokenView, match=r"\d+ edge points on the object, 5000 needed"):
        outline(view, replace(small, fewest_points=5000))


def test_a_shape_scores_highest_by_its_own_codebook(make_view, small):
    books = [
        build_codebook([outline(make_view(label, k), small) for k in (0, 2, 4)], 0.1, small)
        for label in ("disc", "cross")
    ]
    assert all(isinstance(book, Codebook) for book in books)
    for own, label in enumerate(("disc", "cross")):
        scores = outline(make_view(label, 3), small).scores(books, small).normalised
        assert scores.shape == (1, 2) and np.nanargmax(scores[0]) == own

"""Tags: in the picture, not on each other, near what they name, and counted where there is no room."""

from __future__ import annotations

import numpy as np
from drawing.pen import Pen
from drawing.scene import Scene, choose_view
from drawing.tags import overlap, place_tags, write_tags
from hypothesis import given
from hypothesis import strategies as st


@given(st.lists(st.tuples(st.integers(0, 640), st.integers(0, 320), st.integers(20, 90)), min_size=1, max_size=25))
def test_tags_lie_in_the_picture_and_never_overlap(tags: list[tuple[int, int, int]]) -> None:
    anchors = np.array([(u, v) for u, v, _ in tags], dtype=float)
    sizes = np.array([(width, 14) for _, _, width in tags], dtype=float)
    boxes = np.concatenate([anchors - 10, anchors + 10], axis=1)
    places = place_tags(anchors, sizes, boxes, (640, 320))
    found = places[np.isfinite(places[:, 0])]
    assert len(found) >= min(len(tags), 8)
    assert np.all(found[:, :2] >= 0.0) and np.all(found[:, 2:] <= [640, 320])
    for i, (x0, y0, x1, y1) in enumerate(found):
        for a0, b0, a1, b1 in found[:i]:
            assert x1 <= a0 or a1 <= x0 or y1 <= b0 or b1 <= y0


def test_a_tag_keeps_its_size_and_rather_covers_nothing() -> None:
    anchor, size = np.array([[320.0, 160.0]]), np.array([[80.0, 16.0]])
    box = np.array([[280.0, 140.0, 360.0, 220.0]])
    place = place_tags(anchor, size, box, (640, 320))
    assert np.allclose(place[:, 2:] - place[:, :2], size)
    assert overlap(place, box[0]) == 0.0 and place[0, 3] <= 140.0 and place[0, 3] > 110.0


def test_tags_without_room_have_no_place() -> None:
    anchors, sizes = np.full((6, 2), [50.0, 20.0]), np.full((6, 2), [60.0, 12.0])
    places = place_tags(anchors, sizes, np.hstack([anchors, anchors]), (100, 40))
    assert 1 <= np.isfinite(places[:, 0]).sum() <= 3


def test_a_tag_is_a_dot_of_its_colour_and_a_white_text_above_the_box(scene: Scene) -> None:
    view = choose_view(scene, 800)
    pen = Pen(view, np.full((400, 800, 3), 90, dtype=np.uint8), np.full((400, 800), np.inf, dtype=np.float32))
    box = view.project(scene.things[0].corners(scene.R_world_upright))
    assert write_tags(pen, ["cup 0.50"], [(255, 0, 0)], box[None]) == 0
    red, white = np.argwhere(np.all(pen.image == (255, 0, 0), axis=-1)), np.argwhere(pen.image.min(axis=-1) > 200)
    assert len(red) > 8 and len(white) > 20
    assert white[:, 0].max() < box[:, 1].min()  # the text is above the box
    assert red[:, 1].min() < white[:, 1].min()  # and begins with the dot


def test_a_text_that_is_too_long_is_not_written_but_counted(scene: Scene) -> None:
    view = choose_view(scene, 320)
    pen = Pen(view, np.zeros((160, 320, 3), dtype=np.uint8), np.full((160, 320), np.inf, dtype=np.float32))
    box = view.project(scene.things[0].corners(scene.R_world_upright))
    assert write_tags(pen, ["cup " * 100], [(255, 0, 0)], box[None]) == 1
    assert not pen.image.any()

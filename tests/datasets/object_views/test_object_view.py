"""Collections of views, and the margin about an object."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.object_views.class_names import class_name
from thingmap.datasets.object_views.object_view import (
    BrokenView,
    ObjectView,
    ObjectViews,
    ViewEntry,
    cut_out,
    margin_window,
    mask_box,
)


def _entry(view: ObjectView, label: str, name: str, broken: bool = False) -> ViewEntry:
    def read() -> ObjectView:
        if broken:
            raise BrokenView("torn")
        return view

    return ViewEntry(label, f"{label} 1", name, read)


def test_iterating_skips_what_cannot_be_read_and_names_it(view: ObjectView) -> None:
    views = ObjectViews([_entry(view, "mug", "a"), _entry(view, "bowl", "b", True), _entry(view, "mug", "c")])
    assert len(views) == 3 and views.labels == ("bowl", "mug") and views.skipped == {}
    assert len(list(views)) == 2
    assert views.skipped == {"b": "torn"}
    list(views)
    assert len(views.skipped) == 1  # a second pass counts nothing twice


def test_select_and_join_keep_the_order_given(view: ObjectView) -> None:
    views = ObjectViews([_entry(view, "mug", name) for name in "abcd"], {"e": "lost"})
    both = ObjectViews.joined([views.select([3, 1]), ObjectViews([_entry(view, "cap", "f")], {"g": "gone"})])
    assert [entry.name for entry in both.entries] == ["d", "b", "f"]
    assert both.skipped == {"e": "lost", "g": "gone"}


def test_mask_box_counts_from_the_outer_edges() -> None:
    mask = np.zeros((10, 20), bool)
    mask[4, 7] = True
    assert mask_box(mask).tolist() == [7, 4, 8, 5]
    with pytest.raises(BrokenView, match="no pixel"):
        mask_box(np.zeros((3, 3), bool))


@given(st.tuples(*[st.floats(0, 1)] * 4))
def test_the_margin_holds_the_box_and_stays_in_the_image(corners: tuple[float, float, float, float]) -> None:
    x, y = sorted(corners[:2]), sorted(corners[2:])
    box = np.array([x[0] * 200, y[0] * 100, x[1] * 200, y[1] * 100])
    rows, columns = margin_window(box, 200, 100)
    assert 0 <= columns.start <= box[0] and box[2] <= columns.stop <= 200
    assert 0 <= rows.start <= box[1] and box[3] <= rows.stop <= 100


def test_cut_out_shows_the_same_object(view: ObjectView) -> None:
    wide = np.pad(view.color, ((200, 200), (300, 300), (0, 0)))
    mask = np.pad(view.mask, ((200, 200), (300, 300)))
    box = view.xyxy + np.array([300, 200, 300, 200])
    cut = cut_out(ObjectView("board", "1", "n", wide, None, mask, box, view.focal))
    assert cut.color.shape == (120, 100, 3)  # half of 60 pixels on each side of 60 x 40
    assert cut.mask is not None and mask_box(cut.mask).tolist() == cut.xyxy.tolist()
    assert np.array_equal(cut.color, view.color) and not np.shares_memory(cut.color, wide)


@pytest.mark.parametrize("text", ["coffee_mug", "Coffee Mug", "mug", "coffee__cup"])
def test_one_class_has_one_name(text: str) -> None:
    assert class_name(text) == "coffee mug"


def test_a_collection_is_iterable_any_number_of_times(view: ObjectView) -> None:
    reads: list[str] = []

    def entry(name: str) -> ViewEntry:
        def read() -> ObjectView:
            reads.append(name)
            return view

        return ViewEntry("board", "board 1", name, read)

    views = ObjectViews([entry("x"), entry("y")])
    assert not reads  # nothing is read before it is asked for
    assert len(list(views)) == len(list(views)) == 2
    assert reads == ["x", "y", "x", "y"]

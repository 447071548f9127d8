"""Objects put into other images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.object_views.backgrounds import Background
from thingmap.datasets.object_views.composing import composed
from thingmap.datasets.object_views.cutout import cut
from thingmap.datasets.object_views.object_view import BrokenView, ObjectView, mask_box
from thingmap.datasets.object_views.places import DEFAULT_PLACES, level_places

Room = Callable[..., Background]


def _several(view: ObjectView, background: Background, count: int = 20) -> list[ObjectView]:
    found = [composed(view, background, np.random.default_rng(seed)) for seed in range(count)]
    return [one for one in found if one is not None]


def test_objects_stand_on_the_floor_at_its_distance(view: ObjectView, room: Room) -> None:
    several = _several(view, room())
    assert len(several) > 15
    for there in several:
        assert there.mask is not None and there.depth is not None
        assert (there.label, there.instance, there.focal) == ("board", "board 1", 525.0)
        assert mask_box(there.mask).tolist() == there.xyxy.tolist()
        distance = float(np.median(there.depth[there.mask]))
        left, _, right, foot = there.xyxy.astype(int)
        floor = there.depth[min(foot, len(there.depth) - 1), left:right]
        assert np.median(floor) == pytest.approx(distance, rel=0.05)
        # 40 x 60 pixels at 1 m
        assert right - left == pytest.approx(40 / distance, abs=1.5)
        assert there.xyxy[3] - there.xyxy[1] == pytest.approx(60 / distance, abs=1.5)
        behind = there.depth[there.depth > 0]
        assert (there.depth[there.mask] <= behind.max()).all()


def test_the_colour_is_the_objects_inside_and_the_rooms_outside(view: ObjectView, room: Room) -> None:
    for there in _several(view, room(), 5):
        assert there.mask is not None
        x0, y0, x1, y1 = there.xyxy.astype(int)
        inside = there.color[y0 + 2 : y1 - 2, x0 + 2 : x1 - 2].reshape(-1, 3)
        assert np.ptp(inside, axis=0).max() <= 2  # of one colour, whatever the light
        assert inside[0, 0] > 5 * inside[0, 2]
        outside = np.ones(there.mask.shape, bool)
        outside[max(y0 - 3, 0) : y1 + 3, max(x0 - 3, 0) : x1 + 3] = False
        assert (there.color[outside] == [20, 20, 180]).all()  # nothing of the grey wall it was taken from


def test_nothing_is_measured_where_the_object_hides_the_projector(view: ObjectView, room: Room) -> None:
    for there in _several(view, room(), 10):
        assert there.depth is not None and there.mask is not None
        row = int(there.xyxy[1]) + 3
        left = int(there.xyxy[0])
        object_depth, wall = there.depth[row, left + 3], there.depth[row].max()
        shadow = 525.0 * 0.075 * (1.0 / object_depth - 1.0 / wall)
        assert (there.depth[row, max(left - int(shadow) + 2, 0) : left - 1] == 0).all()
        assert there.depth[row, int(there.xyxy[2]) + 2] > 0  # the projector stands to the right


def test_no_place_on_a_wall(view: ObjectView, room: Room) -> None:
    assert _several(view, room(floor=None)) == []


def test_no_place_that_changes_the_size_too_much(view: ObjectView, room: Room) -> None:
    far = replace(view, depth=view.depth * 8.0) if view.depth is not None else view
    assert _several(far, room(floor=0.3, wall=1.5)) == []


def test_no_place_where_something_stands_before_it(view: ObjectView, room: Room) -> None:
    background = room()
    assert background.depth is not None
    barred = background.depth.copy()
    barred[:, ::8] = 0.45  # bars close to the camera
    assert _several(view, replace(background, depth=barred)) == []


def test_level_places_are_on_the_floor_only(room: Room) -> None:
    places = level_places(room(floor=0.5, wall=3.0).depth, 525.0, DEFAULT_PLACES)  # type: ignore[arg-type]
    horizon = 239.5 + 525.0 * 0.5 / 3.0
    assert len(places) > 100 and places[:, 1].min() > horizon - 2
    np.testing.assert_allclose(places[:, 2], 525.0 * 0.5 / (places[:, 1] - 239.5), rtol=1e-3)


def test_without_depth_an_object_goes_anywhere(view: ObjectView, room: Room) -> None:
    background = replace(room(), depth=None)
    several = _several(replace(view, depth=None), background)
    assert len(several) == 20 and all(there.depth is None for there in several)
    assert len({tuple(there.xyxy - there.xyxy[[0, 1, 0, 1]]) for there in several}) > 10  # of many sizes
    for there in _several(view, background):
        assert there.mask is not None and mask_box(there.mask).tolist() == there.xyxy.tolist()


def test_the_same_chance_gives_the_same_view(view: ObjectView, room: Room) -> None:
    one, other = (composed(view, room(), np.random.default_rng(3)) for _ in range(2))
    assert one is not None and other is not None
    assert np.array_equal(one.color, other.color) and np.array_equal(one.xyxy, other.xyxy)


def test_the_sources_stay_as_they_were(view: ObjectView, room: Room) -> None:
    background = room()
    before = view.color.copy(), background.color.copy(), background.depth
    composed(view, background, np.random.default_rng(0))
    assert np.array_equal(view.color, before[0]) and np.array_equal(background.color, before[1])
    assert background.depth is before[2] and np.array_equal(background.depth, room().depth)  # type: ignore[arg-type]


def test_an_object_larger_than_the_image_has_no_place(view: ObjectView, room: Room) -> None:
    small = replace(room(), color=np.zeros((20, 20, 3), np.uint8), depth=None)
    assert composed(view, small, np.random.default_rng(0)) is None


def test_what_cannot_be_cut_out(view: ObjectView, room: Room) -> None:
    with pytest.raises(ValueError, match="no mask"):
        composed(replace(view, mask=None), room(), np.random.default_rng(0))
    with pytest.raises(BrokenView):
        cut(replace(view, mask=np.zeros((120, 100), bool)))
    unmeasured = replace(view, depth=np.zeros((120, 100), np.float32))
    assert composed(unmeasured, room(), np.random.default_rng(0)) is None

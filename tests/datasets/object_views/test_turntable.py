"""Models on the virtual turntable."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.object_views.object_view import mask_box
from thingmap.datasets.object_views.turntable import Turntable, turntable_views
from thingmap.datasets.synthetic.mesh import box
from thingmap.datasets.synthetic.things.models import build_model
from thingmap.datasets.synthetic.things.objects import Model, Part, standing

SMALL = Turntable(azimuths=2, elevations=(30.0,), distances=(0.8, 1.6))
STEADY = Turntable(azimuths=1, elevations=(30.0,), distances=(1.0,), jitter=(0.0, 0.0, 0.0))


def _block(side: float, color: tuple[int, int, int] = (200, 40, 40)) -> Model:
    texture = np.full((4, 4, 3), color, np.uint8)
    return standing("block", [Part(box((side, side, side)), texture)])


def test_every_model_is_seen_from_every_place() -> None:
    models = [_block(0.1), build_model("bowl", np.random.default_rng(1)), _block(0.2)]
    views = turntable_views(models, turntable=SMALL)
    assert len(views) == 3 * 2 * 2 == len(list(views)) and not views.skipped
    assert [entry.instance for entry in views.entries[::4]] == ["block 1", "bowl 1", "block 2"]
    assert len({entry.name for entry in views.entries}) == len(views)


def test_mask_box_depth_and_colour_agree() -> None:
    (view,) = turntable_views([_block(0.1)], turntable=STEADY)
    assert view.mask is not None and view.depth is not None
    assert view.color.shape[:2] == view.depth.shape == view.mask.shape
    assert mask_box(view.mask).tolist() == view.xyxy.tolist()
    margin = np.concatenate([view.xyxy[:2], np.array(view.mask.shape)[::-1] - view.xyxy[2:]])
    assert margin.min() >= 24
    # Azimuth 0 shows one upright side and the top of the cube, both 0.1 m wide, 1 m from its middle.
    assert view.xyxy[2] - view.xyxy[0] == pytest.approx(525 * 0.1 / 0.93, abs=3)
    readings = view.depth[view.mask & (view.depth > 0)]
    assert readings.min() > 0.9 and np.median(readings) == pytest.approx(0.95, abs=0.04)
    assert readings.max() < view.depth[0].max()  # behind it the table goes on
    red, green, blue = view.color[view.mask].mean(axis=0)
    assert red > 1.5 * green and red > 1.5 * blue


def test_distance_halves_the_size() -> None:
    near, _, far, _ = turntable_views([_block(0.1)], turntable=SMALL)
    height = [view.xyxy[3] - view.xyxy[1] for view in (near, far)]
    assert height[0] / height[1] == pytest.approx(2.0, rel=0.2)


def test_views_depend_on_their_own_place_and_the_seed_only() -> None:
    models = [_block(0.1), _block(0.15)]
    all_views = list(turntable_views(models, turntable=SMALL))
    views = turntable_views(models, turntable=SMALL)
    (again,) = views.select([6])
    assert np.array_equal(again.color, all_views[6].color)
    assert again.depth is not None and np.array_equal(again.depth, all_views[6].depth)
    other = Turntable(azimuths=2, elevations=(30.0,), distances=(0.8, 1.6), seed=1)
    (differs,) = turntable_views(models, turntable=other).select([6])
    assert differs.color.shape != again.color.shape or not np.array_equal(differs.color, again.color)


def test_a_thing_too_large_for_the_image_is_skipped_and_named() -> None:
    views = turntable_views([_block(0.9)], turntable=STEADY)
    assert list(views) == [] and "too large" in next(iter(views.skipped.values()))


@pytest.mark.parametrize("wrong", [{"azimuths": 0}, {"elevations": (90.0,)}, {"distances": (0.1,)}, {"distances": ()}])
def test_impossible_turntables_are_refused(wrong: dict) -> None:
    with pytest.raises(UserError):
        Turntable(**wrong)

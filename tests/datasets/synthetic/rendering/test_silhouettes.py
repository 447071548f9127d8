"""What can be seen of the halves of a thing, against hand-made scenes."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.mesh import Mesh, box, merged
from thingmap.datasets.synthetic.motion.orbit import look_at
from thingmap.datasets.synthetic.rendering import silhouettes
from thingmap.datasets.synthetic.rendering.render import Renderer
from thingmap.datasets.synthetic.rendering.silhouettes import Silhouettes
from thingmap.datasets.synthetic.rendering.surfaces import assemble
from thingmap.datasets.synthetic.things.objects import Part
from thingmap.datasets.truth import PARTS, FrameTruth, TrueObject

CAMERA = Intrinsics(160, 120, 100.0, 100.0, 79.5, 59.5)  # at 1 m a pixel is a centimetre wide
GREY = np.full((4, 4, 3), 180, np.uint8)
ALONG_Y = look_at(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]), np.zeros(1))[0]  # image right is +x, up is +z


def plate(left: float, right: float, bottom: float, top: float, y: float) -> Mesh:
    """A thin upright plate across the view, in pixels from the optical axis, `y` metres away."""
    s = y / 100.0
    size = (s * (right - left), 1e-6, s * (top - bottom))
    return box(size).moved((s * (left + right) / 2, y, s * bottom))


def measured(things: list[Mesh], intrinsics: Intrinsics = CAMERA) -> FrameTruth:
    """Truth of a scene of some meshes, numbered in order, seen from the origin."""
    surfaces = assemble([(Part(mesh, GREY), k) for k, mesh in enumerate(things)])
    objects = tuple(TrueObject(k, "thing", np.zeros(3), np.ones(3), 0.0) for k in range(len(things)))
    cast = Renderer(surfaces).cast(intrinsics, ALONG_Y)
    return Silhouettes(objects, surfaces).measure(intrinsics, ALONG_Y, cast)


def parts(truth: FrameTruth, row: int = 0) -> dict[str, float]:
    return dict(zip(PARTS, truth.part_visibility[row].tolist(), strict=True))


THING = plate(-20, 20, -10, 10, 2.0)  # 40 x 20 pixels


def test_alone_all_parts_are_seen():
    assert parts(measured([THING])) == dict.fromkeys(PARTS, 1.0)


@pytest.mark.parametrize(
    ("cover", "expected"),
    [
        (plate(0, 50, -50, 50, 1.0), {"whole": 0.5, "top": 0.5, "bottom": 0.5, "left": 1.0, "right": 0.0}),
        (plate(-50, 50, 0, 50, 1.0), {"whole": 0.5, "top": 0.0, "bottom": 1.0, "left": 0.5, "right": 0.5}),
        (plate(-50, -10, -50, 50, 1.0), {"whole": 0.75, "top": 0.75, "bottom": 0.75, "left": 0.5, "right": 1.0}),
        (plate(-50, 0, -50, 0, 1.0), {"whole": 0.75, "top": 1.0, "bottom": 0.5, "left": 0.5, "right": 1.0}),
        (plate(-50, 50, -50, 50, 1.0), dict.fromkeys(PARTS, 0.0)),
    ],
)
def test_a_cover_takes_its_share_of_every_half(cover: Mesh, expected: dict[str, float]):
    truth = measured([THING, cover])
    assert parts(truth) == expected
    np.testing.assert_array_equal(truth.visibility, truth.part_visibility[:, 0])


def test_halves_are_those_of_the_whole_box_where_the_image_cuts_it():
    border = 80  # pixels from the axis to the right border
    truth = measured([plate(border - 30, border + 10, -10, 10, 2.0)])
    np.testing.assert_allclose(truth.xyxy[0], [129.5, 49.5, 169.5, 69.5], atol=1e-3)
    assert parts(truth) == {"whole": 0.75, "top": 0.75, "bottom": 0.75, "left": 1.0, "right": 0.5}


def test_a_half_without_pixels_has_the_visibility_of_the_whole():
    one_pixel_wide = plate(-0.8, 0.3, -10, 10, 2.0)  # between columns 78.7 and 79.8: column 79, left of the middle
    lower_half_hidden = plate(-50, 50, -50, 0, 1.0)
    truth = measured([one_pixel_wide, lower_half_hidden])
    assert parts(truth) == {"whole": 0.5, "top": 1.0, "bottom": 0.0, "left": 0.5, "right": 0.5}


def test_own_shape_counts_not_the_box():
    """An L of a column on the left and a foot: the foot's right end is most of the right half."""
    shape = merged([plate(-20, -10, -10, 10, 2.0), plate(-10, 20, -10, -5, 2.0)])
    truth = measured([shape, plate(5, 50, -50, 50, 1.0)])
    whole, right, left = 10 * 20 + 30 * 5, 20 * 5, 10 * 20 + 10 * 5
    assert parts(truth) == pytest.approx(
        {"whole": 1 - 75 / whole, "top": 1.0, "bottom": 1 - 75 / (100 + 150), "left": 1.0, "right": 1 - 75 / right}
    )
    assert whole == left + right


def test_a_thing_that_reaches_far_outside_is_counted_in_strips(monkeypatch: pytest.MonkeyPatch):
    things = [plate(-300, 300, -200, 200, 0.2), plate(-30, 0, -30, 30, 0.1)]
    at_once = measured(things)
    monkeypatch.setattr(silhouettes, "STRIP", 5000)
    in_strips = measured(things)
    np.testing.assert_array_equal(in_strips.part_visibility, at_once.part_visibility)
    assert at_once.visibility[0] == (160 * 120 - 30 * 60) / (600 * 400)
    np.testing.assert_allclose(at_once.part_visibility[0, 3:] * 300 * 400, [80 * 120 - 30 * 60, 80 * 120])

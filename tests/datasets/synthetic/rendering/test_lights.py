"""Lamps of several rooms."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.config import Preset
from thingmap.datasets.synthetic.mesh import box, face
from thingmap.datasets.synthetic.motion.orbit import look_at
from thingmap.datasets.synthetic.rendering import kernels
from thingmap.datasets.synthetic.rendering.render import Lights, Renderer
from thingmap.datasets.synthetic.rendering.surfaces import Surfaces, assemble
from thingmap.datasets.synthetic.rooms.layouts import build_layout
from thingmap.datasets.synthetic.things.objects import Part

CAMERA = Intrinsics(160, 120, 131.25, 131.25, 79.5, 59.5)
GREY = np.full((4, 4, 3), 180, np.uint8)
ALBEDO = (180 / 255) ** 2
CENTRES = ((-1.5, 0.0, 2.0), (-2.0, 0.5, 2.2), (1.5, 0.0, 2.0), (2.0, 0.5, 2.2))
POWERS = ((4.0, 4.0, 4.0), (2.0, 2.0, 2.0)) * 2
TWO_ROOMS = Lights(CENTRES, POWERS, sky=(0.1, 0.1, 0.1), walls=(0.0,))
DARK = ((0.0, 0.0, 0.0),) * 2


def floor_and(*others: Part) -> Surfaces:
    return assemble([(part, -1) for part in (Part(face((8.0, 8.0, 0.0), "+z"), GREY), *others)])


def from_above(surfaces: Surfaces, lights: Lights) -> np.ndarray:
    """(H, W, 3) radiance seen by a camera that looks at the origin's surroundings from a height; x runs right."""
    T = look_at(np.array([[0.0, -0.5, 3.0]]), np.array([[0.0, 0.0, 0.0]]), np.zeros(1))[0]
    renderer = Renderer(surfaces, lights)
    return renderer.render(CAMERA, T, renderer.cast(CAMERA, T)).radiance


def test_each_room_is_lit_by_its_own_lamps_only():
    both = from_above(floor_and(), TWO_ROOMS)
    left_only = from_above(floor_and(), replace(TWO_ROOMS, powers=(*POWERS[:2], *DARK)))
    right_only = from_above(floor_and(), replace(TWO_ROOMS, powers=(*DARK, *POWERS[2:])))
    np.testing.assert_array_equal(left_only[:, :78], both[:, :78])
    np.testing.assert_array_equal(right_only[:, 82:], both[:, 82:])
    np.testing.assert_allclose(left_only[:, 82:], 0.1 * ALBEDO, rtol=1e-4)
    np.testing.assert_allclose(right_only[:, :78], 0.1 * ALBEDO, rtol=1e-4)


def test_mirrored_lamps_leave_no_seam():
    row = from_above(floor_and(), TWO_ROOMS)[60, :, 0]
    np.testing.assert_allclose(row, row[::-1], rtol=1e-3)
    assert row[80] == pytest.approx(row[79], rel=1e-3), "the wall's plane lies between these two"
    lopsided = from_above(floor_and(), replace(TWO_ROOMS, centres=(*CENTRES[:2], (0.9, 0.0, 2.0), CENTRES[3])))[
        60, :, 0
    ]
    assert lopsided[80] > 1.2 * lopsided[79]


def test_light_is_that_of_a_downward_disc():
    """Power times both cosines over the squared distance, added to the ambient light."""
    row = from_above(floor_and(), TWO_ROOMS)[60, 79]
    at = np.array([-0.5 / 131.25 * np.hypot(3.0, 0.5), 0.0, 0.0])  # half a pixel left of the image's middle
    expected = 0.1
    for centre, power in zip(CENTRES[:2], POWERS[:2], strict=True):
        to_lamp = np.array(centre) - at
        distance = np.linalg.norm(to_lamp)
        expected += power[0] * (to_lamp[2] / distance) ** 2 / distance**2
    np.testing.assert_allclose(row, ALBEDO * expected, rtol=0.04)


def test_shadows_come_from_the_lamps_of_the_room():
    """A plate under the right room's lamps darkens the floor there, and nothing in the left room."""
    lights = replace(TWO_ROOMS, centres=(*CENTRES[:2], (0.6, 0.0, 2.0), (0.6, 0.0, 2.1)))
    plate = Part(box((0.3, 0.3, 0.01)).moved((0.6, 0.0, 1.7)), GREY)
    without, shaded = from_above(floor_and(), lights), from_above(floor_and(plate), lights)
    k = 79.5 + 131.25 * 0.9 / np.hypot(3.0, 0.5)  # x = 0.9: beside the plate in the image, in its shadow on the floor
    assert shaded[60, int(k)].mean() == pytest.approx(0.1 * ALBEDO, rel=0.05)
    assert without[60, int(k)].mean() > 3 * shaded[60, int(k)].mean()
    np.testing.assert_array_equal(shaded[:, :70], without[:, :70])


def test_one_room_is_as_before_whatever_lies_beyond_its_walls():
    """A wall farther away than everything changes no bit."""
    surfaces = floor_and(Part(box((0.4, 0.3, 0.5)), GREY, 0.4))
    one = Lights()
    two = replace(one, centres=one.centres + one.centres, powers=(*one.powers, *DARK), walls=(50.0,))
    np.testing.assert_array_equal(from_above(surfaces, one), from_above(surfaces, two))


@pytest.mark.parametrize("bounce", [0.0, 0.45, 1.0])
def test_a_ceiling_gets_the_light_that_comes_back_from_below(bounce):
    ceiling = assemble([(Part(face((9.0, 9.0, 0.0), "-z").moved((0.0, 0.0, 2.5)), GREY), -1)])
    lights = Lights(sky=(0.2, 0.2, 0.2), bounce=bounce)
    T = look_at(np.array([[0.0, -0.1, 1.0]]), np.array([[0.0, 0.1, 2.5]]), np.zeros(1))[0]
    renderer = Renderer(ceiling, lights)
    light = renderer.render(CAMERA, T, renderer.cast(CAMERA, T)).radiance
    np.testing.assert_allclose(light, ALBEDO * 0.2 * bounce, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"walls": (0.0, 1.0)}, "2 walls need 6 lamps, but got 4 centres and 4 powers"),
        ({"powers": POWERS[:2]}, "1 walls need 4 lamps, but got 4 centres and 2 powers"),
        ({"centres": CENTRES + CENTRES[:2], "powers": POWERS + POWERS[:2], "walls": (1.0, 0.0)}, "must ascend"),
    ],
)
def test_lamps_and_walls_must_fit(changes, said):
    with pytest.raises(ValueError, match=said):
        replace(TWO_ROOMS, **changes)


def test_threads_render_the_same():
    layout = build_layout(Preset.KITCHEN, np.random.default_rng(1))
    renderer = Renderer(assemble([(part, -1) for part in layout.parts]), layout.lights)
    eyes = np.array([[-1.0, 0.4, 1.5], [1.0, 0.4, 1.5], [-3.0, 0.5, 1.4], [3.0, 0.5, 1.4]])
    poses = look_at(eyes, np.tile([0.0, 0.3, 0.9], (4, 1)), np.zeros(4))

    def radiance(T: np.ndarray) -> np.ndarray:
        return renderer.render(CAMERA, T, renderer.cast(CAMERA, T)).radiance

    alone = [radiance(T) for T in poses]
    with ThreadPoolExecutor(2) as pool:
        for image, other in zip(alone, pool.map(radiance, poses), strict=True):
            np.testing.assert_array_equal(image, other)


def test_kernels_release_the_interpreter():
    for kernel in (kernels.resolve_hits, kernels.shadow_rays, kernels.light_pixels):
        assert kernel.targetoptions["nogil"]

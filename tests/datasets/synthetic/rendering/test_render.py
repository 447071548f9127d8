"""Ray casting, shading and silhouettes against hand-made scenes."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.mesh import Mesh, box, face, rotation_z
from thingmap.datasets.synthetic.motion.orbit import look_at
from thingmap.datasets.synthetic.rendering.camera import ColorCamera, develop
from thingmap.datasets.synthetic.rendering.casting import MISS, pixel_rays
from thingmap.datasets.synthetic.rendering.render import Lights, Renderer
from thingmap.datasets.synthetic.rendering.silhouettes import Silhouettes
from thingmap.datasets.synthetic.rendering.surfaces import assemble
from thingmap.datasets.synthetic.things.objects import Part
from thingmap.datasets.truth import FrameTruth, TrueObject

CAMERA = Intrinsics(160, 120, 131.25, 131.25, 79.5, 59.5)
GREY = np.full((4, 4, 3), 180, np.uint8)


def camera_at(eye, target, roll=0.0) -> np.ndarray:
    return look_at(np.array([eye], float), np.array([target], float), np.array([roll]))[0]


def seen_along_y() -> np.ndarray:
    """A camera at the origin that looks along world y, with z up."""
    return camera_at((0, 0, 0), (0, 1, 0))


def measured(things: list[Mesh], T_world_camera: np.ndarray, intrinsics: Intrinsics = CAMERA) -> FrameTruth:
    """Truth of a scene of some meshes, numbered in order."""
    surfaces = assemble([(Part(mesh, GREY), k) for k, mesh in enumerate(things)])
    objects = tuple(TrueObject(k, "thing", np.zeros(3), np.ones(3), 0.0) for k in range(len(things)))
    cast = Renderer(surfaces).cast(intrinsics, T_world_camera)
    return Silhouettes(objects, surfaces).measure(intrinsics, T_world_camera, cast)


@pytest.mark.parametrize("roll", [0.0, 0.4])
def test_depth_of_the_ground_is_that_of_ray_and_plane(roll):
    renderer = Renderer(assemble([(Part(face((20.0, 20.0, 0.0), "+z"), GREY), -1)]))
    T = camera_at((0.3, -1.0, 1.2), (0.1, 0.6, 0.0), roll)
    cast = renderer.cast(CAMERA, T)
    rendering = renderer.render(CAMERA, T, cast)
    u, v = np.meshgrid(np.arange(160), np.arange(120))
    rays = CAMERA.back_project(np.stack([u.ravel(), v.ravel()], axis=1), np.ones(u.size)) @ T[:3, :3].T
    expected = -T[2, 3] / rays[:, 2]
    hit = cast.triangle != MISS
    assert hit.mean() > 0.9
    np.testing.assert_allclose(rendering.depth.ravel()[hit], expected[hit], rtol=2e-6)
    cosine = np.abs(rays[:, 2]) / np.linalg.norm(rays, axis=1)
    np.testing.assert_allclose(rendering.incidence.ravel()[hit], cosine[hit], rtol=1e-4)
    assert not rendering.depth.ravel()[~hit].any()


def test_rays_of_a_pixel_do_not_depend_on_the_rectangle():
    T = camera_at((1.0, 2.0, 1.5), (0.0, 0.1, 0.7), 0.1)
    _, whole = pixel_rays(CAMERA, T, (-20, -10), (200, 150))
    _, part = pixel_rays(CAMERA, T, (37, 44), (11, 7))
    np.testing.assert_array_equal(whole.reshape(150, 200, 3)[54:61, 57:68], part.reshape(7, 11, 3))


def test_texture_is_upright_and_not_mirrored():
    """Quarters of a picture on a wall appear in the same order in the image."""
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[:32, :32, 0] = picture[:32, 32:, 1] = picture[32:, :32, 2] = 200
    picture[32:, 32:] = 200
    wall = face((1.0, 0.0, 1.0), "-y").moved((0.0, 1.0, -0.5))
    renderer = Renderer(assemble([(Part(wall, picture), -1)]), Lights(sky=(1.0, 1.0, 1.0), powers=((0, 0, 0),) * 2))
    T = seen_along_y()
    light = renderer.render(CAMERA, T, renderer.cast(CAMERA, T)).radiance
    corners = [light[v, u].argmax() if light[v, u].min() < 0.01 else 3 for v in (30, 90) for u in (50, 110)]
    assert corners == [0, 1, 2, 3]


def test_a_thing_under_the_lamp_casts_a_shadow():
    ground = Part(face((6.0, 6.0, 0.0), "+z"), GREY)
    roof = Part(box((0.5, 0.5, 0.05)).moved((0.0, 0.0, 0.5)), GREY)
    lights = Lights(centres=((0.0, 0.0, 2.5), (0.1, 0.0, 2.5)), sky=(0.1, 0.1, 0.1))
    T = camera_at((0.0, -1.5, 0.4), (0.0, 0.0, 0.0))
    images = []
    for parts in ([ground], [ground, roof]):
        renderer = Renderer(assemble([(part, -1) for part in parts]), lights)
        images.append(renderer.render(CAMERA, T, renderer.cast(CAMERA, T)).radiance)
    lit, shaded = (image[60, 80].mean() for image in images)
    beside = images[1][100, 5].mean() / images[0][100, 5].mean()
    albedo = (180 / 255) ** 2
    assert shaded == pytest.approx(albedo * 0.1, rel=0.02), "only ambient light arrives under the roof"
    assert lit > 3 * shaded and beside == pytest.approx(1.0, rel=0.02)


def test_visibility_falls_by_the_share_an_occluder_covers():
    plate = box((0.4, 0.001, 0.4)).moved((0.0, 2.0, -0.2))
    alone = measured([plate], seen_along_y())
    screen = box((0.5, 0.001, 1.0)).moved((0.25, 1.0, -0.5))  # hides what lies right of the axis
    hidden = measured([plate, screen], seen_along_y())
    assert alone.visibility[0] == 1.0
    assert hidden.visibility[0] == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(hidden.xyxy[0], alone.xyxy[0])
    assert hidden.xyxy_visible[0][2] < 80.5 < hidden.xyxy[0][2]


def test_the_image_border_takes_visibility_too():
    centre_at_right_border = 2.0 * (159.5 - CAMERA.cx) / CAMERA.fx
    truth = measured([box((0.4, 0.001, 0.4)).moved((centre_at_right_border, 2.0, -0.2))], seen_along_y())
    assert truth.visibility[0] == pytest.approx(0.5, abs=0.02)
    assert truth.xyxy[0][2] > 165 and truth.xyxy_visible[0][2] == 159.5


def test_box_of_the_silhouette_is_that_of_the_projected_corners():
    T = camera_at((0.2, -0.4, 0.9), (0.0, 2.0, 0.1), 0.2)
    thing = box((0.3, 0.5, 0.4)).turned(rotation_z(0.6)).moved((0.1, 2.0, 0.0))
    points = (thing.vertices - T[:3, 3]) @ T[:3, :3]
    uv = CAMERA.project(points)
    truth = measured([thing], T)
    np.testing.assert_allclose(truth.xyxy[0], [*uv.min(axis=0), *uv.max(axis=0)], atol=1e-3)
    assert np.abs(truth.xyxy_visible[0] - truth.xyxy[0]).max() <= 1.0


def test_hidden_things_are_listed_without_a_visible_box_and_those_outside_are_not_listed():
    plate = box((0.2, 0.001, 0.2)).moved((0.0, 2.0, -0.1))
    wall = box((3.0, 0.001, 3.0)).moved((0.0, 1.0, -1.5))
    aside = box((0.2, 0.2, 0.2)).moved((5.0, 2.0, 0.0))
    behind = box((0.2, 0.2, 0.2)).moved((0.0, -2.0, 0.0))
    truth = measured([plate, wall, aside, behind], seen_along_y())
    assert truth.object_id.tolist() == [0, 1]
    assert truth.visibility[0] == 0.0 and np.isnan(truth.xyxy_visible[0]).all()


def test_image_noise_and_exposure():
    camera = ColorCamera(gain=1.0, blur=0.0, noise=3.0, chroma_noise=0.0)
    light = np.full((200, 200, 3), 0.25, np.float32)
    image = develop(light, 1.0, camera, np.random.default_rng(0)).astype(float)
    assert image.mean() == pytest.approx(127.5, abs=0.2) and image.std() == pytest.approx(3.0, rel=0.05)
    brighter = develop(light, 1.44, camera, np.random.default_rng(0)).astype(float)
    assert brighter.mean() == pytest.approx(127.5 * 1.2, abs=0.2)
    quiet = develop(light, 1.0, ColorCamera(gain=1.0, noise=0.0, chroma_noise=0.0), np.random.default_rng(0))
    assert np.unique(quiet).tolist() == [128]

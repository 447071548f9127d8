"""Shapes: closed forms of their sizes, areas and normals."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.synthetic.mesh import Mesh, box, lathe, rotation_z, tube
from thingmap.datasets.synthetic.things.clutter import CLUTTER
from thingmap.datasets.synthetic.things.objects import BUILDERS


def area_and_outward_volume(mesh: Mesh) -> tuple[float, float]:
    """Surface area, and the volume enclosed by triangles that look outwards (divergence theorem)."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    return float(np.linalg.norm(cross, axis=1).sum() / 2), float(np.sum(a * np.cross(b, c)) / 6)


def test_box_has_its_area_and_volume_and_stands_on_the_ground():
    mesh = box((0.2, 0.3, 0.5))
    area, volume = area_and_outward_volume(mesh)
    assert area == pytest.approx(2 * (0.2 * 0.3 + 0.2 * 0.5 + 0.3 * 0.5))
    assert volume == pytest.approx(0.2 * 0.3 * 0.5)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [-0.1, -0.15, 0.0])
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.1, 0.15, 0.5])


def test_lathe_of_a_rectangle_is_a_cylinder():
    r, h = 0.03, 0.12
    mesh = lathe([(0.0, 0.0), (r, 0.0), (r, h), (0.0, h)], segments=200)
    area, volume = area_and_outward_volume(mesh)
    assert area == pytest.approx(2 * np.pi * r * (r + h), rel=1e-3)
    assert volume == pytest.approx(np.pi * r * r * h, rel=1e-3)


def test_lathe_keeps_creases_and_smooths_gentle_bends():
    creased = lathe([(0.03, 0.0), (0.03, 0.1), (0.0, 0.1)])
    assert np.unique(np.round(np.abs(creased.normals[:, 2]), 6)).tolist() == [0.0, 1.0]
    gentle = lathe([(0.03, 0.0), (0.03, 0.1), (0.025, 0.2)])
    at_bend = np.isclose(gentle.vertices[:, 2], 0.1)
    half_angle = np.arctan2(0.005, 0.1) / 2
    np.testing.assert_allclose(gentle.normals[at_bend, 2], np.sin(half_angle), atol=1e-9)


def test_tube_normals_point_away_from_its_path():
    angle = np.linspace(-1.5, 1.5, 20)
    path = np.stack([0.03 * np.cos(angle), 0.03 * np.sin(angle)], axis=1)
    mesh = tube(path, 0.005)
    on_path = mesh.vertices - 0.005 * mesh.normals
    distance = np.linalg.norm(on_path[:, None, [0, 2]] - path, axis=2).min(axis=1)
    assert distance.max() < 1e-9 and np.abs(on_path[:, 1]).max() < 1e-9
    corners = mesh.vertices[mesh.triangles]
    wound = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(np.sum(wound * mesh.normals[mesh.triangles].mean(axis=1), axis=1) > 0.0)


@pytest.mark.parametrize("label", [*BUILDERS, *CLUTTER])
def test_things_are_centred_stand_on_the_ground_and_have_household_sizes(label):
    builder = {**BUILDERS, **CLUTTER}[label]
    for seed in range(3):
        model = builder(np.random.default_rng(seed))
        points = np.concatenate([part.mesh.vertices for part in model.parts])
        np.testing.assert_allclose(points.max(axis=0) - points.min(axis=0), model.size)
        np.testing.assert_allclose((points.max(axis=0) + points.min(axis=0))[:2], 0.0, atol=1e-12)
        assert points[:, 2].min() == pytest.approx(0.0, abs=1e-12)
        assert model.size.min() > 0.03 and model.size.max() < 0.35
        for part in model.parts:
            np.testing.assert_allclose(np.linalg.norm(part.mesh.normals, axis=1), 1.0, atol=1e-6)
            sides = np.array(part.texture.shape[:2])
            assert part.texture.dtype == np.uint8 and np.all(sides & (sides - 1) == 0), "sides are powers of two"


def test_a_turned_box_keeps_its_normals_on_its_faces():
    mesh = box((0.1, 0.2, 0.3)).turned(rotation_z(0.7)).moved((1.0, 2.0, 3.0))
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    cross /= np.linalg.norm(cross, axis=1, keepdims=True)
    np.testing.assert_allclose(cross, mesh.normals[mesh.triangles[:, 0]], atol=1e-12)

"""The whole scene: exact truth, objects that do not depend on the clutter, occlusion that grows with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.mesh import rotation_z
from thingmap.datasets.synthetic.motion.camera_paths import camera_path
from thingmap.datasets.synthetic.placement import clutter_count
from thingmap.datasets.synthetic.rendering.render import Renderer
from thingmap.datasets.synthetic.rendering.silhouettes import Silhouettes
from thingmap.datasets.synthetic.rooms.layouts import build_layout
from thingmap.datasets.synthetic.scene import Scene, build_scene
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.datasets.truth import NO_OBJECT, TrueObject

SMALL = Intrinsics(160, 120, 131.25, 131.25, 79.5, 59.5)
KITCHEN = SyntheticConfig(preset=Preset.KITCHEN, seed=2)


def in_own_axes(scene: Scene, thing: TrueObject) -> np.ndarray:
    """(N, 3) corners of all triangles of a thing from its centre, before its yaw."""
    corners = scene.surfaces.corners[scene.surfaces.owner == thing.id].reshape(-1, 3)
    return (corners - thing.position) @ rotation_z(thing.yaw)


def test_boxes_are_those_of_the_meshes():
    scene = build_scene(KITCHEN)
    for thing in (*scene.objects, *scene.clutter):
        points = in_own_axes(scene, thing)
        np.testing.assert_allclose(points.max(axis=0), thing.size / 2.0, atol=2e-6)
        np.testing.assert_allclose(points.min(axis=0), -thing.size / 2.0, atol=2e-6)


def test_ids_count_through_objects_and_clutter():
    scene = build_scene(KITCHEN)
    assert [thing.id for thing in scene.objects] == list(range(24))
    assert [thing.id for thing in scene.clutter] == list(range(24, 24 + clutter_count(24, KITCHEN.clutter)))
    assert set(np.unique(scene.surfaces.owner)) == {NO_OBJECT, *range(24 + len(scene.clutter))}
    assert scene.classes == CLASSES
    assert {thing.label for thing in scene.objects} == set(CLASSES)
    assert not {thing.label for thing in scene.clutter} & set(CLASSES)


def test_things_rest_on_supports_of_the_layout():
    scene = build_scene(KITCHEN)
    heights = {support.height for support in build_layout(Preset.KITCHEN, np.random.default_rng(0)).supports}
    bottoms = {round(float(thing.position[2] - thing.size[2] / 2.0), 6) for thing in scene.objects}
    assert bottoms <= {round(height, 6) for height in heights} and len(bottoms) > 2


def test_the_clutter_level_changes_places_but_never_the_objects():
    low, high = (build_scene(replace(KITCHEN, clutter=level)) for level in (ClutterLevel.LOW, ClutterLevel.HIGH))
    assert [thing.label for thing in low.objects] == [thing.label for thing in high.objects]
    for a, b in zip(low.objects, high.objects, strict=True):
        np.testing.assert_array_equal(a.size, b.size)
    assert len(high.clutter) > len(low.clutter)
    room = [scene.surfaces.corners[scene.surfaces.owner == NO_OBJECT] for scene in (low, high)]
    np.testing.assert_array_equal(*room)


def test_more_objects_come_after_the_same_ones():
    few, more = (build_scene(SyntheticConfig(objects=count, clutter=ClutterLevel.LOW)) for count in (9, 16))
    for a, b in zip(few.objects, more.objects[:9], strict=True):
        assert a.label == b.label
        np.testing.assert_array_equal(a.size, b.size)


def test_scenes_follow_their_seed():
    one, other = (build_scene(SyntheticConfig(seed=seed)) for seed in (1, 2))
    again = build_scene(SyntheticConfig(seed=3)) and build_scene(SyntheticConfig(seed=1))
    assert again is not one, "it was built anew"
    np.testing.assert_array_equal(one.surfaces.corners, again.surfaces.corners)
    np.testing.assert_array_equal(one.surfaces.texels, again.surfaces.texels)
    assert not np.array_equal(one.objects[0].position, other.objects[0].position)


def test_a_scene_does_not_depend_on_how_it_is_filmed():
    config = SyntheticConfig(seed=1)
    assert build_scene(config) is build_scene(replace(config, frames=7, width=160, blur=2, pace=3.0))


def write_ball(folder, name: str, radius: float) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    (folder / f"{name}.glb").write_bytes(mesh.export(file_type="glb"))


def test_scans_come_first_and_bring_their_classes(tmp_path):
    write_ball(tmp_path, "book", 0.05)
    write_ball(tmp_path, "mug", 0.04)
    scene = build_scene(SyntheticConfig(objects=9, clutter=ClutterLevel.HIGH, meshes=tmp_path))
    assert scene.classes == (*CLASSES, "book")
    assert [thing.label for thing in scene.objects[:2]] == ["book", "coffee mug"]
    np.testing.assert_allclose(scene.objects[0].size, 0.1, atol=2e-3)
    assert len(scene.objects) == 9
    assert "book" not in {thing.label for thing in scene.clutter}, "what is a class is no clutter"
    points = in_own_axes(scene, scene.objects[0])
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.05, atol=1e-5)


def test_more_scans_than_objects_are_refused(tmp_path):
    for number in range(3):
        write_ball(tmp_path, f"ball{'abc'[number]}", 0.05)
    with pytest.raises(UserError, match="found 3 scans for 2 objects"):
        build_scene(SyntheticConfig(objects=2, meshes=tmp_path))


def test_too_many_things_are_refused():
    with pytest.raises(UserError, match="expected room for 160 things"):
        build_scene(SyntheticConfig(objects=50, clutter=ClutterLevel.HIGH))


def test_objects_are_seen_ever_less_as_the_clutter_grows():
    """Over views from all along the path; the survey's arc is the shortest to cast."""
    seen = []
    for level in ClutterLevel:
        shares = []
        for seed in (0, 1):
            scene = build_scene(SyntheticConfig(preset=Preset.SURVEY, seed=seed, clutter=level))
            renderer, silhouettes = Renderer(scene.surfaces), Silhouettes(scene.objects, scene.surfaces)
            poses = camera_path(Preset.SURVEY, 37, seed)[1][::9]
            shares += [silhouettes.measure(SMALL, T, renderer.cast(SMALL, T)).visibility for T in poses]
        seen.append(np.concatenate(shares).mean())
    assert seen[0] > seen[1] + 0.04 and seen[1] > seen[2] + 0.04, seen

"""What is read of a run, and the view: from behind and above, with everything in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawing.scene import Scene, choose_view, read_scene

from thingmap.datasets.errors import InputError
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Thing

WIDTH = 400


def test_doubtful_things_are_read_only_when_asked_for(
    write_out: Callable[..., Path], make_thing: Callable[..., Thing]
) -> None:
    out = write_out(make_thing(1, "cup"), make_thing(2, "bowl", existence=0.3))
    assert [thing.label for thing in read_scene(out).things] == ["cup"]
    assert {thing.label for thing in read_scene(out, 0.2).things} == {"cup", "bowl"}


def test_a_map_without_such_things_is_an_error_that_names_the_option(
    write_out: Callable[..., Path], make_thing: Callable[..., Thing]
) -> None:
    with pytest.raises(InputError, match=r"map\.json: expected things .* 0\.5, found none; lower --min-existence"):
        read_scene(write_out(make_thing(1, "cup", existence=0.4)))


def test_a_cloud_without_points_is_an_error(write_out: Callable[..., Path], make_thing: Callable[..., Thing]) -> None:
    out = write_out(make_thing(1, "cup"))
    OutputFolder.open(out).write_cloud(np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8))
    with pytest.raises(InputError, match=r"cloud\.ply: expected points, found none"):
        read_scene(out)


def test_every_label_has_its_colour(scene: Scene) -> None:
    assert list(scene.palette) == ["bowl", "cup"] and len(set(scene.palette.values())) == 2


def test_the_view_looks_from_behind_and_above(scene: Scene) -> None:
    up = np.array([0.0, -1.0, 0.0])
    view = choose_view(scene, WIDTH, elevation=30.0)
    forward = view.T_world_view[:3, 2]
    assert np.degrees(np.arcsin(-forward @ up)) == pytest.approx(30.0)
    assert forward[2] == pytest.approx(np.cos(np.radians(30.0)))  # the camera looked along z
    assert view.T_world_view[:3, 1] @ up < 0.0


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 30.0), (75.0, 10.0), (-160.0, 90.0)])
def test_the_view_shows_everything_and_is_near(
    scene: Scene, pixels: Callable[..., np.ndarray], azimuth: float, elevation: float
) -> None:
    view = choose_view(scene, WIDTH, azimuth, elevation)
    uv = pixels(view, scene.extent)
    assert np.all(view.to_view(scene.extent)[:, 2] > 0.0)
    assert np.all(uv > 0.0) and np.all(uv < [WIDTH, WIDTH / 2])
    assert np.ptp(uv, axis=0).max() > 0.4 * WIDTH / 2


def test_azimuth_turns_the_viewer_counterclockwise(scene: Scene) -> None:
    eye = choose_view(scene, WIDTH, azimuth=90.0).T_world_view[:3, 3]
    assert eye[0] > 0.5  # from behind, which is -z, to the right, which is +x


def test_a_camera_that_looked_straight_down_still_gives_a_view(scene: Scene) -> None:
    poses = scene.poses.copy()
    poses[:, :3, :3] = np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # z of the camera is down
    view = choose_view(replace(scene, poses=poses), WIDTH)
    rotation = view.T_world_view[:3, :3]
    assert np.allclose(rotation.T @ rotation, np.eye(3)) and np.linalg.det(rotation) == pytest.approx(1.0)


def test_an_enlarged_view_has_the_same_picture(scene: Scene) -> None:
    view = choose_view(scene, WIDTH)
    small, large = view.project(scene.extent), view.enlarged(3).project(scene.extent)
    assert np.allclose((large + 0.5) / 3.0, small + 0.5)  # pixel centres are whole numbers

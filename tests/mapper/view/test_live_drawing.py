"""What is drawn, piece by piece, before rerun has it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rerun_reading import CaughtRecording, numbers

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.mapper.config import CloudConfig
from thingmap.mapper.view import rerun_cloud, rerun_series
from thingmap.mapper.view.moved_poses import SHIFT, MovedPoses
from thingmap.mapper.view.rerun_cloud import GrowingCloud
from thingmap.mapper.view.rerun_frame import FrameDrawer
from thingmap.mapper.view.rerun_path import PIECE, PathDrawer
from thingmap.mapper.view.rerun_series import SeriesDrawer
from thingmap.mapper.view.rerun_things import ThingDrawer
from thingmap.mapper.view.shown_things import QUANTILE_95, Seen, ShownThings, shown_map

pytest.importorskip("rerun", reason="the live view needs the extra `view`")


def poses(count: int) -> np.ndarray:
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, 0, 3] = 0.1 * np.arange(count)
    return T


def shown(*existence: float, first: int = 1) -> ShownThings:
    n = len(existence)
    return ShownThings(
        ids=tuple(f"thing-{first + i:04d}" for i in range(n)),
        classes=("cup", "bowl"),
        posterior=np.tile([0.97, 0.03], (n, 1)),
        existence=np.array(existence),
        position=np.tile([0.0, 0.0, 2.0], (n, 1)),
        covariance=np.tile(np.diag([1e-4, 4e-4, 9e-4]), (n, 1, 1)),
        size=np.full((n, 3), 0.2),
        R_world_box=np.tile(np.eye(3), (n, 1, 1)),
        seen=np.full(n, Seen.SUPPORTED),
    )


def entities(recording: CaughtRecording) -> list[str]:
    return [entity for entity, _, _ in recording.take()]


def is_clear(logged) -> bool:
    return type(logged[1][0]).__name__ == "Clear"


def test_poses_count_as_moved_once():
    watch, T = MovedPoses(), poses(3)
    assert watch.moved(T).tolist() == [True, True, True]
    assert watch.moved(T).tolist() == [False, False, False]
    later = poses(4)
    later[1, 1, 3] += 2.0 * SHIFT
    assert watch.moved(later).tolist() == [False, True, False, True]
    assert not watch.moved(later).any()


def test_small_steps_add_up_to_a_move():
    watch, T = MovedPoses(), poses(2)
    watch.moved(T)
    told = []
    for _ in range(4):
        T = T.copy()
        T[1, 2, 3] += 0.4 * SHIFT
        told.append(watch.moved(T)[1])
    assert told == [False, False, True, False]


def test_things_that_vanish_are_cleared():
    recording = CaughtRecording()
    drawer = ThingDrawer(recording)
    drawer.draw(shown(0.9, 0.2))
    assert entities(recording) == ["world/things", "world/positions", "world/doubtful"]
    drawer.draw(shown(0.9))
    logged = recording.take()
    assert [(entity, is_clear((entity, shapes))) for entity, shapes, _ in logged] == [
        ("world/things", False),
        ("world/positions", False),
        ("world/doubtful", True),
    ]
    drawer.draw(shown())
    assert [entity for entity, *rest in recording.take() if is_clear((entity, *rest))] == [
        "world/things",
        "world/positions",
    ]
    drawer.draw(shown())
    assert recording.take() == []


@given(st.lists(st.floats(1e-4, 0.3), min_size=3, max_size=3), st.lists(st.floats(-1, 1), min_size=9, max_size=9))
def test_ellipsoids_are_those_of_the_covariance(sigmas, entries):
    R = np.linalg.qr(np.array(entries).reshape(3, 3) + 2.0 * np.eye(3))[0]
    things = shown(0.9)
    covariance = R @ np.diag(np.square(sigmas)) @ R.T
    object.__setattr__(things, "covariance", covariance[None])
    (half_axes,), (axes,) = things.ellipsoids()
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert np.allclose(axes @ np.diag(half_axes**2) @ axes.T, QUANTILE_95**2 * covariance, atol=1e-9)


def test_a_long_path_is_drawn_in_pieces_without_gaps():
    recording = CaughtRecording()
    drawer, none = PathDrawer(recording), np.empty((0, 2), dtype=np.int64)
    T = poses(2 * PIECE + 1)
    drawer.draw(np.ones(len(T), dtype=bool), T, none)
    strips = [numbers(shapes[0], "strips")[0] for _, shapes, _ in recording.take()]
    assert [len(strip) for strip in strips] == [PIECE, PIECE + 1, 2]
    assert np.allclose(strips[0][-1], strips[1][0]) and np.allclose(strips[1][-1], strips[2][0])
    last = np.arange(len(T)) == len(T) - 1
    drawer.draw(last, T, none)
    assert entities(recording) == ["world/path/0002"]


def test_loops_are_lines_between_their_keyframes_and_follow_them():
    recording = CaughtRecording()
    drawer, T, loops = PathDrawer(recording), poses(5), np.array([[0, 4]])
    still, moved = np.zeros(5, dtype=bool), np.arange(5) == 4
    drawer.draw(still, T, loops)
    ((entity, (lines,), _),) = recording.take()
    assert entity == "world/loops" and np.allclose(numbers(lines, "strips"), [[[0, 0, 0], [0.4, 0, 0]]])
    drawer.draw(still, T, loops)
    assert entities(recording) == []
    drawer.draw(moved, T, loops)
    assert "world/loops" in entities(recording)
    drawer.draw(still, T, loops[:0])
    ((entity, shapes, _),) = recording.take()
    assert entity == "world/loops" and is_clear((entity, shapes))


def wall(width: int = 64, height: int = 48, distance: float = 1.0) -> Frame:
    k = Intrinsics(width, height, 60.0, 60.0, width / 2, height / 2)
    color, depth = np.full((height, width, 3), 9, dtype=np.uint8), np.full((height, width), distance, dtype=np.float32)
    return Frame(0, "frame-0", 0.0, color, depth, k)


def test_the_cloud_grows_by_what_is_new_and_moves_without_sending_points():
    recording = CaughtRecording()
    cloud = GrowingCloud(recording, CloudConfig(voxel_size=0.05, pixel_step=1))
    T = poses(3)
    T[2, 0, 3] = 5.0
    cloud.add(wall(), 0, T[0])
    first = len(cloud)
    cloud.add(wall(), 1, T[0])  # the same place again
    assert len(cloud) == first > 100
    cloud.add(wall(), 2, T[2])
    assert len(cloud) == pytest.approx(2 * first, rel=0.1)
    assert entities(recording) == ["world/cloud/k000000", "world/cloud/k000002"]
    cloud.follow(np.ones(3, dtype=bool), T)
    assert [(e, [type(s).__name__ for s in shapes]) for e, shapes, _ in recording.take()] == [
        ("world/cloud/k000000", ["Transform3D"]),
        ("world/cloud/k000002", ["Transform3D"]),
    ]


def test_the_cloud_is_bounded(monkeypatch):
    monkeypatch.setattr(rerun_cloud, "MAX_POINTS", 300)
    recording = CaughtRecording()
    cloud = GrowingCloud(recording, CloudConfig(voxel_size=0.01, pixel_step=1))
    for keyframe in range(3):
        T = np.eye(4)
        T[0, 3] = 5.0 * keyframe
        cloud.add(wall(), keyframe, T)
    assert len(cloud) == 300
    assert sum(len(numbers(shapes[1], "positions")) for _, shapes, _ in recording.take()) == 300


def test_only_so_many_things_have_series_and_one_that_vanishes_makes_room(monkeypatch):
    monkeypatch.setattr(rerun_series, "MAX_THINGS", 2)
    recording = CaughtRecording()
    drawer = SeriesDrawer(recording)
    drawer.draw_things(shown(0.9, 0.3, 0.8, 0.7))
    drawn = {entity.rsplit("/", 1)[1] for entity in entities(recording)}
    assert drawn == {"thing-0001", "thing-0003"}
    drawer.draw_things(shown(0.3, 0.8, 0.7, first=2))
    logged = recording.take()
    assert {e for e, shapes, _ in logged if is_clear((e, shapes))} == {
        "series/existence/thing-0001",
        "series/classes/thing-0001",
    }
    assert "series/existence/thing-0004" in [entity for entity, _, _ in logged]


def test_unlikely_classes_get_no_line():
    recording = CaughtRecording()
    SeriesDrawer(recording).draw_things(shown(0.9))
    values = {e: shapes[0] for e, shapes, static in recording.take() if not static}
    assert numbers(values["series/classes/thing-0001"], "scalars").tolist() == [pytest.approx(0.97)]


def test_a_wide_image_is_sent_smaller_with_boxes_and_camera_to_match():
    recording, frame = CaughtRecording(), wall(1280, 960)
    drawer = FrameDrawer(recording)
    drawer.start(frame.intrinsics)
    (_, (camera,), static), _ = recording.take()
    assert static and numbers(camera, "resolution").tolist() == [[640.0, 480.0]]
    drawer.draw_things(shown(0.9), frame, np.eye(4))
    ((_, (boxes,), _),) = recording.take()
    # 60 px focal length, front face at 1.9 m: the box of +-0.1 m spans about 6 px of the camera, 3 of the picture
    assert numbers(boxes, "centers")[0] == pytest.approx([(640 + 0.5) / 2, (480 + 0.5) / 2], abs=0.1)
    assert numbers(boxes, "half_sizes")[0, 0] == pytest.approx(0.1 / 1.95 * 60 / 2, rel=0.15)


def test_what_is_behind_the_camera_has_no_outline():
    recording, frame, T = CaughtRecording(), wall(), np.eye(4)
    T[2, 3] = 5.0
    drawer = FrameDrawer(recording)
    drawer.start(frame.intrinsics)
    recording.take()
    drawer.draw_things(shown(0.9), frame, T)
    assert recording.take() == []


def test_labels_unknown_to_a_map_are_shown(make_map, make_thing):
    things = shown_map(make_map(make_thing(1, "lamp", 0.8), make_thing(2), classes=("cup", "bowl")))
    assert things.labels == ["lamp", "cup"] and things.captions[0] == "lamp 1: 0.76"


def test_an_empty_map_has_nothing_to_show(make_map):
    nothing = shown_map(make_map().__class__((), ("cup",), "x", make_map().frame, make_map().up))
    assert len(nothing) == 0 and nothing.names == [] and nothing.ellipsoids()[0].shape == (0, 3)

"""From where to look next."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.estimation.view_log import Verdict, ViewNote
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.views_file import ThingViews
from thingmap.mapper.queries.viewpoints import CLEARANCE, looking_at, visited_poses

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
CLASSES = ("cup", "bowl", "book")
UP = np.array([0.0, -1.0, 0.0])
THERE = np.array([0.0, 0.0, 1.2])
DOUBT = {"cup": 0.6, "bowl": 0.4}


def around(angle: float, distance: float = 1.2) -> np.ndarray:
    """(4, 4) a level view of `THERE`; at 0 it is the identity."""
    eye = THERE + distance * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    return looking_at(eye, THERE, UP)


def note(stamp: float, verdict: Verdict = Verdict.SUPPORTED, weight: float = 1.0) -> ViewNote:
    return ViewNote(int(stamp), stamp, f"frame-{stamp}", np.ones(5), 0.6, 0, 0, np.zeros(3), weight, verdict)


@pytest.fixture
def doubtful(make_thing, make_map):
    """`doubtful(*notes, **changes)`: a map of one cup that may be a bowl."""

    def make(*notes: ViewNote, **changes) -> ObjectMap:
        values = {
            "position": THERE,
            "position_covariance": 1e-6 * np.eye(3),
            "size": [0.1, 0.1, 0.1],
            "yaw": 0.0,
            "class_posterior": DOUBT,
            "existence": 0.8,
            "views": ThingViews(CLASSES, notes, {}) if notes else None,
            **changes,
        }
        probability = values["class_posterior"]["cup"]
        return make_map(make_thing(1, "cup", probability, **values), camera=CAMERA)

    return make


def saved(object_map: ObjectMap, folder: Path, poses: np.ndarray, points: np.ndarray | None = None) -> ObjectMap:
    """As a run would have left it, and read again."""
    out = OutputFolder(folder)
    out.write_trajectory(np.arange(float(len(poses))), poses)
    if points is not None:
        out.write_cloud(points, np.full(points.shape, 100, dtype=np.uint8))
    out.write_map(object_map, include_doubtful=True)
    return ObjectMap.load(folder)


def test_the_side_not_seen_tells_more_than_the_side_seen(doubtful, tmp_path: Path) -> None:
    object_map = saved(doubtful(note(0.0)), tmp_path, around(0.0)[None])
    views = np.array([around(0.0), around(0.02), around(np.pi / 2)])
    seen, nearly, new = (object_map.where_to_look("thing-0001", 1, candidates=view[None]) for view in views)
    assert new[0].gain_bits > 0.02
    assert not seen or seen[0].gain_bits < 0.2 * new[0].gain_bits
    assert not nearly or nearly[0].gain_bits < 0.2 * new[0].gain_bits
    (best,) = object_map.where_to_look("thing-0001", 1, candidates=views)
    np.testing.assert_array_equal(best.T_world_camera, views[2])


def test_a_view_that_said_nothing_is_still_new(doubtful, tmp_path: Path) -> None:
    object_map = saved(doubtful(note(0.0, Verdict.OCCLUDED, weight=0.0)), tmp_path, around(0.0)[None])
    told = [object_map.where_to_look("thing-0001", 1, candidates=around(a)[None])[0].gain_bits for a in (0.0, 2.0)]
    assert told[0] == pytest.approx(told[1], rel=1e-6)


def test_what_hides_takes_from_the_gain(doubtful, make_thing) -> None:
    open_view = doubtful().where_to_look("thing-0001", 1, candidates=around(0.0)[None])[0]
    gains = [open_view.gain_bits]
    for offset in (0.055, 0.04, 0.0):
        place = {"position": [offset, 0.0, 0.8], "position_covariance": 1e-6 * np.eye(3), "yaw": 0.0}
        screen = make_thing(2, "book", 1.0, class_posterior={"book": 1.0}, size=[0.07, 0.02, 0.3], **place)
        hidden = replace(doubtful(), things=(*doubtful().things, screen))
        found = hidden.where_to_look("thing-0001", 1, candidates=around(0.0)[None])
        gains.append(found[0].gain_bits if found else 0.0)
    assert gains == sorted(gains, reverse=True)
    assert gains[0] > 1.05 * gains[2] > gains[3]


def test_gains_fall_along_the_list_and_views_differ(doubtful) -> None:
    found = doubtful().where_to_look("thing-0001", 6)
    gains = [view.gain_bits for view in found]
    assert len(found) == 6
    assert gains == sorted(gains, reverse=True)
    directions = np.array([(v.T_world_camera[:3, 3] - THERE) for v in found])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosines = (directions @ directions.T)[np.triu_indices(6, 1)]
    assert np.all(cosines < np.cos(0.1))
    assert [v.gain_bits for v in doubtful().where_to_look("thing-0001", 6)] == gains


def test_the_lazy_search_finds_what_a_full_search_finds(doubtful) -> None:
    object_map = doubtful()
    views = np.array([around(a, d) for a in np.linspace(0.0, 5.0, 9) for d in (0.7, 1.5, 4.0)])
    alone = [object_map.where_to_look("thing-0001", 1, candidates=view[None]) for view in views]
    gains = [found[0].gain_bits if found else 0.0 for found in alone]
    (best,) = object_map.where_to_look("thing-0001", 1, candidates=views)
    assert best.gain_bits == pytest.approx(max(gains), rel=1e-9)


def test_rings_are_level_see_the_thing_and_keep_clear(doubtful, tmp_path: Path) -> None:
    grid = np.meshgrid(np.arange(-1.0, 1.0, 0.02), np.arange(-1.0, 1.0, 0.02))
    points = np.stack([grid[0].ravel(), grid[1].ravel(), np.full(grid[0].size, 1.7)], axis=1)  # a wall behind it
    poses = np.array([around(a) for a in (-0.3, 0.3)])
    poses[:, 1, 3] -= 0.5
    object_map = saved(doubtful(), tmp_path, poses, points)
    found = object_map.where_to_look("thing-0001", 8)
    assert {view.visited for view in found} <= {True, False}
    for view in found:
        assert view.things == ("thing-0001",)
        assert 0.3 <= view.visible[0] <= 1.0
        assert object_map.visible_from(view.T_world_camera)[0].thing.id == "thing-0001"
        if not view.visited:
            eye = view.T_world_camera[:3, 3]
            assert eye[1] == pytest.approx(np.median(poses[:, 1, 3]), abs=1e-9)
            assert np.min(np.linalg.norm(points - eye, axis=1)) > CLEARANCE
            assert view.T_world_camera[1, 0] == pytest.approx(0.0, abs=1e-9)
            assert eye[2] < 1.7 or eye[2] > 1.7 + CLEARANCE


def test_poses_of_the_trajectory_are_candidates(doubtful, tmp_path: Path) -> None:
    poses = np.array([around(a, 0.9) for a in (0.0, 0.01, 1.0)])
    assert len(visited_poses(poses)) == 2
    found = saved(doubtful(), tmp_path, poses).where_to_look("thing-0001", 5)
    visited = [view.T_world_camera for view in found if view.visited]
    assert any(np.allclose(T, poses[0], atol=1e-5) for T in visited) or any(
        np.allclose(T, poses[2], atol=1e-5) for T in visited
    )


def test_a_label_sums_over_the_things_in_view(doubtful, make_thing) -> None:
    other = {"position": [0.3, 0.0, 1.2], "position_covariance": 1e-6 * np.eye(3), "yaw": 0.0, "size": [0.1, 0.1, 0.1]}
    one = doubtful()
    two = replace(one, things=(*one.things, make_thing(2, "cup", 0.6, class_posterior=DOUBT, existence=0.8, **other)))
    alone, both = (m.where_to_look("cup", 1, candidates=around(0.0)[None])[0] for m in (one, two))
    assert set(both.things) == {"thing-0001", "thing-0002"}
    assert both.gain_bits == pytest.approx(2.0 * alone.gain_bits, rel=0.1)
    assert one.where_to_look("CUP", 1)[0].gain_bits == pytest.approx(one.where_to_look("cup", 1)[0].gain_bits)


def test_what_is_sure_needs_no_look(doubtful) -> None:
    sure = doubtful(class_posterior={"cup": 1.0}, existence=1.0)
    assert sure.where_to_look("thing-0001") == []
    assert sure.where_to_look("cup") == []


def test_what_cannot_be_asked_is_refused(doubtful, make_map) -> None:
    with pytest.raises(UserError, match="unicorn"):
        doubtful().where_to_look("unicorn")
    with pytest.raises(UserError, match="camera"):
        make_map().where_to_look("cup")
    with pytest.raises(ValueError, match="count"):
        doubtful().where_to_look("cup", 0)
    with pytest.raises(ValueError, match="T_world_camera"):
        doubtful().where_to_look("cup", candidates=2.0 * np.eye(4)[None])


def test_nobody_else_is_asked_where_there_is_nothing_to_ask(doubtful) -> None:
    assert replace(doubtful(), things=()).where_to_look("cup") == []
    assert doubtful().where_to_look("cup", candidates=np.empty((0, 4, 4))) == []

"""Which keyframes are remembered as places, how far they are, and which look alike."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.mapper.config import LoopConfig, PlaceConfig
from thingmap.mapper.trajectory.loops.places import Place, Places
from thingmap.mapper.trajectory.loops.scan_matching import Scan

from .box_room import features, lap, pose, retracted, tangent

SPACING = LoopConfig().place_spacing
NOTHING = Scan(np.empty((0, 3), dtype=np.float32))


def place(keyframe: int, T: np.ndarray | None = None) -> Place:
    return Place(keyframe, features(pose() if T is None else T), NOTHING)


def remembered(path: list[np.ndarray], loops: LoopConfig | None = None) -> Places:
    """A camera goes a path and offers every keyframe."""
    places = Places(loops or LoopConfig(), PlaceConfig())
    for number, T in enumerate(path):
        kept = places.offer(place(number, T), np.stack(path[: number + 1]))
        assert kept == (number in places.keyframes)
    return places


def there_and_back(swings: int) -> list[np.ndarray]:
    ways = np.concatenate([np.linspace(0.0, 0.6, 21), np.linspace(0.6, 0.0, 21)[1:-1]])
    return [pose(x) for x in np.tile(ways, swings)]


def test_a_stretch_is_remembered_once_however_often_it_is_gone():
    once, often = remembered(there_and_back(1)), remembered(there_and_back(5))
    np.testing.assert_array_equal(once.keyframes, often.keyframes)
    assert len(once) == len(once.keyframes) == 6  # 0.03 m a step: one in four
    np.testing.assert_array_equal(once.keyframes, [0, 4, 8, 12, 16, 20])


def test_a_keyframe_is_new_when_it_is_far_or_turned():
    base = there_and_back(1)[:5]
    for T, new in (
        (pose(0.0, 0.0, 0.99 * SPACING[1]), False),
        (pose(0.0, 0.0, 1.01 * SPACING[1]), True),
        (pose(turn=0.99 * SPACING[0]), False),
        (pose(turn=1.01 * SPACING[0]), True),
        (pose(0.0, 0.7 * SPACING[1], 0.0, 0.7 * SPACING[0]), False),
    ):
        places = remembered([pose()])
        assert places.offer(place(1, T), np.stack([base[0], T])) is new
        np.testing.assert_array_equal(places.keyframes, [0, 1] if new else [0])


def test_it_is_the_present_estimate_that_counts():
    """Drift that was taken back: what seemed far is near, and not remembered again."""
    poses = np.stack([pose(), pose(1.0)])
    places = Places(LoopConfig(), PlaceConfig())
    assert places.offer(place(0), poses[:1]) and places.offer(place(1), poses)
    poses = np.stack([pose(), pose(0.3), pose(0.31)])
    assert not places.offer(place(2), poses)
    assert places.offer(place(2), np.stack([pose(), pose(0.3), pose(1.0)]))


def test_distances_are_those_of_the_relative_poses():
    rng = np.random.default_rng(0)
    path = [retracted(pose(), rng.normal(0.0, 0.6, 6)) for _ in range(12)]
    places = remembered(path)
    assert len(places) > 8
    now = np.stack([retracted(T, rng.normal(0.0, 0.1, 6)) for T in path])  # the graph has moved them since
    turned, moved = places.distances(now, 5)
    for number, angle, metres in zip(places.keyframes, turned, moved, strict=True):
        twist = tangent(now[5], now[number])
        assert angle == pytest.approx(np.linalg.norm(twist[:3]), abs=1e-6)
        assert metres == pytest.approx(np.linalg.norm(now[5][:3, 3] - now[number][:3, 3]), abs=1e-9)


def test_before_there_is_any_place_nothing_is_near_or_alike():
    places = Places(LoopConfig(), PlaceConfig())
    turned, moved = places.distances(np.eye(4)[None], 0)
    assert len(places) == 0 and turned.shape == moved.shape == (0,)
    assert places.alike(features(pose()), 3, 100) == []


def test_places_that_look_alike_are_found_among_those_old_enough():
    path = lap(36)
    places = remembered(path)
    assert len(places) == 35
    again = features(retracted(path[10], np.array([0.0, 0.01, 0.0, 0.01, 0.0, 0.01])))
    best = places.alike(again, 3, 34)
    assert best[0].keyframe in (9, 10, 11) and best[0] is places[best[0].keyframe]
    assert len(best) <= 3 and len(places.alike(again, 1, 34)) == 1
    assert all(p.keyframe <= 8 for p in places.alike(again, 3, 8))
    assert places.alike(again, 3, -1) == []


def test_without_appearance_nothing_looks_alike():
    path = lap(12)
    places = remembered(path, LoopConfig(appearance=False))
    assert len(places) == 11 and places.alike(features(path[5]), 3, 10) == []

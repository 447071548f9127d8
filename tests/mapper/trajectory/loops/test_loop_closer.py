"""Links between keyframes that are not neighbours: which are looked for, when they enter, and which are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.synthetic.sample import open_sample
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.mapper.config import LoopConfig, MapperConfig
from thingmap.mapper.estimation.records import DropLoop, Loop, Motion, ScanMatch
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.trajectory.constellation.candidates import LoopCandidate

from .box_room import SHORT, SURE, VAGUE, Walk, assert_same, features, lap, pose, retracted, rocking, tangent

DRIFT = np.array([0.0, 0.003, 0.0, 0.005, 0.0, 0.003])  # rad, m, of every step
BY_DEPTH = replace(SHORT, appearance=False)
BY_LOOKS = replace(SHORT, known=(1e-6, 1e-6))  # it is never known well enough how keyframes lie


def rocked(loops: LoopConfig = BY_DEPTH, keyframes: int = 30) -> Walk:
    walk, rng = Walk(loops), np.random.default_rng(1)
    for T in rocking(keyframes):
        walk.step(T, rng.normal(0.0, np.repeat([0.001, 0.002], 3)))
    return walk


def went_round(loops: LoopConfig = BY_LOOKS, keyframes: int = 46) -> Walk:
    walk = Walk(loops)
    for T in lap(keyframes):
        walk.step(T, DRIFT, VAGUE)
    return walk


@pytest.fixture(scope="module")
def rocked_walk() -> Walk:
    """Treat as read-only."""
    return rocked()


# -- local links


def test_a_keyframe_is_tied_to_the_nearest_place_of_each_age(rocked_walk):
    walk, bins = rocked_walk, [(0, 4), (4, 12), (12, 10**9)]
    numbers = walk.closer._places.keyframes
    full = 0
    for b in range(SHORT.skip, walk.last - SHORT.lag + 1):
        expected = {}
        for youngest, oldest in bins:
            near = [
                (np.hypot(*(np.linalg.norm(part) / 0.5 for part in (d[:3], d[3:]))), int(a))
                for a in numbers
                if youngest < b - a <= oldest and b - a >= SHORT.skip
                for d in [tangent(walk.truth[a], walk.truth[b])]
            ]
            if near and min(near)[0] < 0.95:
                expected[youngest] = near
        found = [m.a for m in walk.records(ScanMatch) if m.b == b]
        assert len(found) == len(set(found)) <= 3
        for youngest, oldest in bins:
            of_age = [a for a in found if youngest < b - a <= oldest]
            assert len(of_age) == (youngest in expected)  # one, not more
            for a in of_age:  # estimates err by millimetres: of two that are as near either is right
                assert {n: d for d, n in expected[youngest]}[a] < min(expected[youngest])[0] + 0.03
        full += len(found) == 3
    assert full >= 6
    assert not walk.records(Loop) and not walk.closed


def test_local_links_hold_the_path_better_than_its_steps(rocked_walk):
    walk = rocked_walk
    alone = rocked(replace(BY_DEPTH, reach=(1e-6, 1e-6)))
    assert not alone.records(ScanMatch)
    linked, steps = (
        np.sqrt(np.mean([np.sum(w.error(k)[3:] ** 2) for k in range(1, w.last + 1)])) for w in (walk, alone)
    )
    assert linked < 0.004 and linked < 0.6 * steps


def test_results_enter_exactly_so_many_keyframes_later(rocked_walk):
    keyframes, checked = 1, 0
    for record in rocked_walk.smoother.ledger:
        keyframes += isinstance(record, Motion)
        if isinstance(record, ScanMatch):
            assert keyframes == record.b + SHORT.lag  # before the keyframe of that number is added
            checked += 1
    assert checked > 30
    assert rocked_walk.closer._jobs.pending == SHORT.lag


def test_another_process_changes_nothing(rocked_walk):
    there = rocked(replace(BY_DEPTH, process=True))
    assert there.closer._jobs.statistics.done_there > 20
    assert_same(there.smoother.ledger, rocked_walk.smoother.ledger)
    np.testing.assert_array_equal(there.smoother.poses(), rocked_walk.smoother.poses())
    assert there.closer.statistics() == rocked_walk.closer.statistics()


def test_a_link_beyond_the_gate_is_refused_and_counted():
    walk, path = Walk(), rocking(20)
    for n, T in enumerate(path, start=1):
        walk.step(T, shift=np.array([0.0, 0.0, 0.07]) if n == 14 else None)
    matches = walk.records(ScanMatch)
    refused = walk.closer.outcomes["near, refused"]
    assert refused >= 2
    assert [m for m in matches if m.b == 13] and not [m for m in matches if m.b == 14]
    assert walk.closer.statistics()["near, refused"] == refused and walk.closer.statistics()["near"] == len(matches)
    assert max(np.linalg.norm(walk.error(k)[3:]) for k in range(20)) < 0.008


# -- loops


def test_what_looks_alike_takes_drift_out():
    walk = went_round()
    loops = walk.records(Loop)
    assert walk.closer.outcomes["alike"] == len(loops) >= 1 and not walk.records(ScanMatch)
    assert walk.closed and walk.closed[0] == min(loop.b for loop in loops) + SHORT.lag
    drift = Walk(replace(BY_LOOKS, appearance=False))
    for T in lap(46):
        drift.step(T, DRIFT, VAGUE)
    assert not drift.closed and np.linalg.norm(drift.error(37)[:3]) > 0.1
    for loop in loops:
        gap = tangent(loop.T_a_b, np.linalg.inv(walk.truth[loop.a]) @ walk.truth[loop.b])
        assert loop.b - loop.a >= SHORT.min_age
        assert np.linalg.norm(gap[:3]) < 0.005  # how far along a lone wall is open, and said to be
        assert gap @ np.linalg.solve(loop.covariance, gap) < SHORT.gate
        assert np.linalg.norm(walk.error(loop.b)[:3]) < 0.01


def test_a_camera_that_was_lately_tied_to_an_old_place_looks_for_no_other():
    walk = went_round()
    loops = sorted({loop.b for loop in walk.records(Loop)})
    wait = SHORT.ages[0] + SHORT.lag
    assert walk.closer.has_old_links(loops[-1]) and walk.closer.has_old_links(loops[-1] + wait)
    assert not walk.closer.has_old_links(loops[-1] + wait + 1)
    # jobs that were under way when the first loop was closed come in as well; then there is a pause
    first = loops[0]
    assert all(b <= first + SHORT.lag or b > first + wait for b in loops)


def test_only_who_is_adrift_looks_for_young_places():
    loops = replace(BY_LOOKS, min_age=1000)
    path = rocking(16)
    for adrift in (False, True):
        walk = Walk(loops)
        for n, T in enumerate(path):
            walk.step(T, covariance=VAGUE, adrift=adrift and n == 10)
        assert {loop.b for loop in walk.records(Loop)} == ({11} if adrift else set())


def test_things_that_lie_alike_tie_the_places_nearest_to_them():
    walk = Walk(replace(BY_LOOKS, appearance=False, place_spacing=(0.1, 0.1)))
    old, recent = 1, 37  # both too near to another to be remembered
    path = [pose(0.03, 0.0, 0.0, 0.05), *lap(36), pose(0.03, 0.0, 0.0, 0.03 - np.radians(10.0)), *lap(5)]
    for n, T in enumerate(path, start=1):
        walk.step(T, DRIFT, VAGUE)
        if n == recent:
            guess = retracted(np.linalg.inv(walk.truth[old]) @ walk.truth[recent], np.array([0, 0.03, 0, 0.06, 0, 0.0]))
            places = set(walk.closer._places.keyframes)
            walk.closer.propose(n, [LoopCandidate(old, recent, guess, 3), LoopCandidate(1, 1, np.eye(4), 3)])
    (loop,) = walk.records(Loop)
    assert walk.closer.outcomes["same things"] == 1 and walk.closed == [37 + SHORT.lag]
    assert (loop.a, loop.b) == (0, max(places)) and not {old, recent} & places
    gap = tangent(loop.T_a_b, np.linalg.inv(walk.truth[loop.a]) @ walk.truth[loop.b])
    assert np.linalg.norm(gap[:3]) < 0.005 and gap @ np.linalg.solve(loop.covariance, gap) < SHORT.gate


def test_gnc_takes_a_wrong_loop_out():
    walk = Walk(BY_LOOKS)
    for T in lap(46):
        walk.step(T)
    right = set(walk.smoother.loops())
    wrong_motion = retracted(np.linalg.inv(walk.truth[3]) @ walk.truth[20], np.array([0.0, 1.0, 0.0, 0.8, 0.0, 0.0]))
    wrong = walk.smoother.add(Loop(3, 20, wrong_motion, SURE))
    walk.smoother.update()
    assert right and np.linalg.norm(walk.error(20)[:3]) > 0.015
    for T in lap(64)[45:]:
        walk.step(T)
    assert wrong not in walk.smoother.loops() and right <= walk.smoother.loops().keys()
    assert [record.record for record in walk.records(DropLoop)] == [wrong]
    assert walk.closer.statistics()["loops found wrong"] == 1
    assert np.linalg.norm(walk.error(20)[:3]) < 0.005


# -- the end


@pytest.mark.parametrize("keyframes", [38, 39, 40, 41])
def test_finish_brings_all_in_and_a_second_time_changes_nothing(keyframes):
    """With as many last keyframes as there are between checks, so that one falls on a check."""
    walk = Walk(replace(BY_LOOKS, lag=8))
    for T in lap(keyframes):
        walk.step(T, DRIFT, VAGUE)
    assert not walk.closed and walk.closer._jobs.pending
    assert walk.closer.finish(walk.last)
    walk.smoother.update()
    assert walk.records(Loop) and np.linalg.norm(walk.error(walk.last)[:3]) < 0.02
    assert walk.closer._jobs.pending == walk.closer._checks.pending == 0
    records, poses, statistics = len(walk.smoother.ledger), walk.smoother.poses(), walk.closer.statistics()
    assert not walk.closer.finish(walk.last)
    assert not walk.smoother.is_pending and len(walk.smoother.ledger) == records
    np.testing.assert_array_equal(walk.smoother.poses(), poses)
    assert walk.closer.statistics() == statistics


def test_the_same_walk_gives_the_same_graph():
    one, other = went_round(keyframes=42), went_round(keyframes=42)
    assert one.records(Loop)
    assert_same(one.smoother.ledger, other.smoother.ledger)
    np.testing.assert_array_equal(one.smoother.poses(), other.smoother.poses())


def test_two_maps_do_not_meet():
    """Keyframes have the same numbers in both, and prepared scans are kept in one place."""
    one, other = Walk(), Walk(start=pose(turn=np.pi))
    for T in rocking(12):
        one.step(T)
        other.step(pose(turn=np.pi) @ T)
    assert len(one.records(ScanMatch)) > 5 and len(other.records(ScanMatch)) > 5
    for walk in (one, other):
        assert not walk.closer.outcomes["near, refused"]
        assert max(np.linalg.norm(walk.error(k)[3:]) for k in range(12)) < 0.005


def test_without_depth_or_features_nothing_is_linked():
    walk = Walk()
    nothing = features(pose(10.0, 10.0, 10.0))
    for _ in range(SHORT.lag + SHORT.skip):
        walk.closer.collect(walk.smoother.keyframes)
        walk.smoother.add_keyframe(np.eye(4), SURE)
        walk.smoother.update()
        walk.closer.add_keyframe(walk.last, nothing, np.empty((0, 3)))
    walk.closer.finish(walk.last)
    assert len(nothing) == 0 and not walk.records(ScanMatch) and not walk.records(Loop)


# -- the whole mapper


def test_a_map_does_not_depend_on_the_other_process():
    sequence = open_sample("tabletop?frames=60&width=320")
    frames = list(sequence)
    detector = SimulatedDetector(sequence)
    found = [detector(frame) for frame in frames]
    runs = []
    for process in (False, True):
        mapper = SemanticMapper(config=replace(MapperConfig(), loops=LoopConfig(process=process, ages=(3, 8), lag=2)))
        for frame, detections in zip(frames, found, strict=True):
            mapper.process_frame(frame, detections)
        runs.append(mapper)
    here, there = runs
    things = [mapper.object_map(include_doubtful=True).things for mapper in runs]
    assert here.statistics()["links"]["near"] > 5
    assert here.statistics()["links"] == there.statistics()["links"]
    assert here.statistics()["outcomes"] == there.statistics()["outcomes"]
    assert_same(here._camera.smoother.ledger, there._camera.smoother.ledger)
    for one, other in zip(here.trajectory(), there.trajectory(), strict=True):
        np.testing.assert_array_equal(one, other)
    for one, other in zip(here.keyframes(), there.keyframes(), strict=True):
        np.testing.assert_array_equal(one, other)
    for one, other in zip(*things, strict=True):
        assert (one.id, one.label, one.existence, one.probability) == (
            other.id, other.label, other.existence, other.probability
        )  # fmt: skip
        for name in ("position", "position_covariance", "size", "size_std"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for one, other in zip(here.cloud(), there.cloud(), strict=True):
        np.testing.assert_array_equal(one, other)

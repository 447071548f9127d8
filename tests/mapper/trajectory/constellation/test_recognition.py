"""From landmarks to a closed loop: a camera goes round a room twice, drifts, and maps the same things again."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from thingmap.mapper.config import ConstellationConfig
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.records import Loop
from thingmap.mapper.trajectory.constellation.candidates import LoopCandidate
from thingmap.mapper.trajectory.constellation.recognition import same_places
from thingmap.mapper.trajectory.loops.link_jobs import LinkKind

from ..loops.box_room import CAMERA, HIGH, LOW, SHORT, Walk, lap, retracted, tangent

LAP, KEYFRAMES = 36, 56  # keyframes of a lap, and of the walk: the second lap is half done
TURN, SHIFT = 0.003, np.array([0.006, 0.0, 0.004])  # rad, m in the world, of every step: 6 degrees and 26 cm a lap
STATED = np.diag(np.repeat([0.015**2, 0.03**2], 3))  # of a step, rad^2 and m^2
SMALL = ConstellationConfig(recent_keyframes=18, old_keyframes=18, again_keyframes=10)
BY_THINGS = replace(SHORT, known=(1e-6, 1e-6), appearance=False)  # neither by depth alone nor by the image
CLASSES = 5


def things(seed: int = 0, count: int = 22) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N, 3) places near the walls, world; (N,) classes; (N, 3) log half-axes."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(LOW + 0.1, HIGH - 0.1, (count, 3))
    wall, far = 2 * rng.integers(0, 2, count), rng.random(count) < 0.5
    places[np.arange(count), wall] = np.where(far, HIGH[wall] - 0.15, LOW[wall] + 0.15)
    classes = rng.integers(0, CLASSES, count)
    return places, classes, np.log(0.05 + 0.03 * classes)[:, None] + np.zeros(3)


def mapped(walk: Walk, room: tuple[np.ndarray, ...], keyframes: range, first_number: int) -> list[Landmark]:
    """What is mapped of a room's things in these keyframes, each where the first keyframe that sees it believes it."""
    landmarks, rng = [], np.random.default_rng(first_number)
    size = np.array([CAMERA.width, CAMERA.height])
    for number, (place, kind, log_size) in enumerate(zip(*room, strict=True), first_number):
        seen = []
        for k in keyframes:
            x = (place - walk.truth[k][:3, 3]) @ walk.truth[k][:3, :3]
            if x[2] > 0.3 and (abs(CAMERA.project(x[None])[0] - size / 2) < size / 2).all():
                seen.append(k)
        if not seen:
            continue
        k = seen[len(seen) // 2]
        believed = (walk.smoother.pose(k) @ np.linalg.inv(walk.truth[k]) @ [*place, 1.0])[:3]
        posterior = np.full(CLASSES, 0.1 / CLASSES) + 0.9 * np.eye(CLASSES)[kind]
        belief = SimpleNamespace(existence=0.95, class_posterior=lambda posterior=posterior: posterior)
        where = believed + 0.01 * rng.normal(size=3)
        one = Landmark(number, belief, where, log_size + 0.1 * rng.normal(size=3), 0.0, 1.0, supporting=set(seen))  # type: ignore[arg-type]
        one.covariance = (0.01 + 1e-3 * k) * np.eye(3)  # drift, which neighbours share
        landmarks.append(one)
    return landmarks


def drifted() -> Walk:
    walk = Walk(BY_THINGS)
    go_on(walk, KEYFRAMES)
    return walk


def go_on(walk: Walk, keyframes: int) -> None:
    for T in lap(keyframes)[walk.last :]:
        walk.step(T, np.r_[0.0, TURN, 0.0, T[:3, :3].T @ SHIFT], STATED)


def seen_twice(walk: Walk, again: tuple[np.ndarray, ...] | None = None) -> list[Landmark]:
    """The things of the first lap, and those of the second as others, in a room that may be another one."""
    first = mapped(walk, things(), range(LAP - 4), 0)
    return first + mapped(walk, again or things(), range(LAP + 2, walk.last + 1), 100)


def proposals(walk: Walk, landmarks: list[Landmark]) -> list[LoopCandidate]:
    return same_places(landmarks, walk.last, walk.smoother, SMALL)


def truth(walk: Walk, a: int, b: int) -> np.ndarray:
    return np.linalg.inv(walk.truth[a]) @ walk.truth[b]


def off(T: np.ndarray, walk: Walk, a: int, b: int) -> tuple[float, float]:
    """Rad and m between a `T_a_b` and the truth."""
    error = tangent(T, truth(walk, a, b))
    return float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))


@pytest.fixture(scope="module")
def walk() -> Walk:
    """Treat as read-only."""
    return drifted()


def test_things_mapped_again_tell_where_the_camera_is(walk):
    assert off(np.linalg.inv(walk.smoother.pose(0)) @ walk.smoother.pose(LAP), walk, 0, LAP)[1] > 0.15  # it drifted
    candidates = proposals(walk, seen_twice(walk))
    assert 1 <= len(candidates) <= SMALL.max_candidates
    for one in candidates:
        assert one.old <= walk.last - SMALL.old_keyframes < one.recent <= walk.last
        turned, moved = off(one.T_old_recent, walk, one.old, one.recent)
        assert turned < 0.05 and moved < 0.06


def test_what_is_proposed_in_the_frames_of_other_keyframes_is_the_same(walk, monkeypatch):
    """Keyframes that are no places are stood for by places: the guess must be carried over to them."""
    jobs = []
    monkeypatch.setattr(walk.closer._jobs, "submit", lambda turn, job: jobs.append((turn, job)))
    monkeypatch.setattr(walk.closer._places, "_keyframes", np.array([0, 5, 11, 39, 43, 47]))
    exact = [LoopCandidate(a, b, truth(walk, a, b), 3) for a, b in [(3, 41), (9, 45), (0, 39)]]
    walk.closer.propose(walk.last, exact)
    found = [(turn, job.candidates[0].place.keyframe, job.place.keyframe) for turn, job in jobs]
    assert len(found) == 3 and found[2] == (walk.last, 0, 39)
    assert [(a, b) for _, a, b in found[:2]] != [(3, 41), (9, 45)]
    for _, job in jobs:
        one = job.candidates[0]
        assert one.kind is LinkKind.SAME_THINGS
        a, b = one.place.keyframe, job.place.keyframe
        # wrong by no more than what was drifted between neighbours; by 20 cm and more with a frame mixed up
        turned, moved = off(one.T_guess, walk, a, b)
        assert turned < 0.02 and moved < 0.04


def test_a_place_across_a_jump_does_not_stand_for_a_keyframe():
    """After a jump the camera believes itself where it was long ago: the places there are near, and say nothing."""
    walk = Walk(BY_THINGS)
    for n, T in enumerate(lap(20)):
        walk.step(T)
        if n == 9:  # back to the start, as the odometry has it
            jump = np.linalg.inv(walk.smoother.pose(walk.last)) @ walk.smoother.pose(0)
            walk.step(T, tangent(np.eye(4), jump), np.diag(np.repeat([0.3**2, 0.3**2], 3)))
    recent = 14  # with the jump behind it
    poses = walk.smoother.poses()
    turned, moved = walk.closer._places.distances(poses, recent)
    assert (np.hypot(turned, moved)[walk.closer._places.keyframes < 10] < 0.12).any()
    assert walk.closer._nearest_place(recent, poses) >= 11


def test_a_loop_is_closed_by_things():
    walk = drifted()
    walk.closer.propose(walk.last, proposals(walk, seen_twice(walk)))
    before = np.array([np.linalg.norm(walk.error(k)[3:]) for k in range(walk.last + 1)])
    last = walk.last
    go_on(walk, KEYFRAMES + SHORT.lag + 1)
    loops = walk.records(Loop)
    assert loops and walk.closed == [last + SHORT.lag]
    for loop in loops:
        turned, moved = off(loop.T_a_b, walk, loop.a, loop.b)
        assert turned < 0.006 and moved < 0.02  # of a box with four thousand readings
    walk.smoother.update()
    after = np.array([np.linalg.norm(walk.error(k)[3:]) for k in range(last + 1)])
    print(f"ends {1e3 * before[-1]:.0f} mm off, {1e3 * after[-1]:.0f} mm with the loop")
    assert after[LAP:].max() < 0.4 * before[LAP:].max()


@pytest.mark.parametrize("seed", range(1, 9))
def test_another_room_is_not_taken_for_this_one(walk, seed):
    assert proposals(walk, seen_twice(walk, things(seed))) == []


@pytest.mark.parametrize("twist", [(0.8, 0.3, 0.0), (-0.8, 0.0, -0.4), (0.0, 0.8, 0.8), (1.5, 0.0, 0.0)])
def test_a_guess_that_depth_does_not_confirm_closes_nothing(twist):
    turn, x, z = twist
    walk = drifted()
    wrong = retracted(truth(walk, 4, 40), np.array([0.0, turn, 0.0, x, 0.0, z]))
    walk.closer.propose(walk.last, [LoopCandidate(4, 40, wrong, 3)])
    walk.closer.finish(walk.last)
    assert not walk.records(Loop)


def test_a_guess_that_depth_confirms_and_drift_forbids_closes_nothing():
    """A box turned by half a turn about its middle looks the same, and so might things in it."""
    walk = drifted()
    about = np.diag([-1.0, 1.0, -1.0, 1.0])
    about[:3, 3] = (LOW + HIGH) * [1.0, 0.0, 1.0]
    twin = np.linalg.inv(walk.truth[22]) @ about @ walk.truth[40]
    walk.closer.propose(walk.last, [LoopCandidate(22, 40, twin, 3)])
    walk.closer.finish(walk.last)
    assert walk.closer.outcomes["same things, refused"] == 1
    assert not walk.records(Loop)


def test_few_or_doubtful_things_say_nothing(walk):
    landmarks = seen_twice(walk)
    again = [one for one in landmarks if one.number >= 100]
    assert proposals(walk, landmarks[:20] + again[:2]) == []
    for one in again:
        one.belief.existence = 0.5
    assert proposals(walk, landmarks) == []
    assert proposals(walk, []) == []


def test_things_known_again_propose_what_the_poses_say(walk):
    """They tie both laps together loosely: depth is told to look from there."""
    landmarks = [one for one in seen_twice(walk) if one.number < 100]
    poses = walk.smoother.poses()
    most = max(range(5, 16), key=lambda k: sum(k in one.supporting for one in landmarks))
    known, now = [one for one in landmarks if most in one.supporting], most + LAP
    for one in known:
        one.supporting |= {now}
    candidates = same_places(landmarks, now + 9, walk.smoother, SMALL)
    assert candidates and candidates[0].seen >= SMALL.min_matches
    for one in candidates:
        assert one.old <= now + 9 - SMALL.old_keyframes and one.recent == now
        np.testing.assert_allclose(one.T_old_recent, np.linalg.inv(poses[one.old]) @ poses[now], atol=1e-9)
    few = [one for one in landmarks if one not in known[2:]]
    assert same_places(few, now + 9, walk.smoother, SMALL) == []
    assert same_places(landmarks, now + 10, walk.smoother, SMALL) == []  # too long ago: it has been proposed then


def test_drift_that_is_known_to_be_small_is_not_undone(walk, monkeypatch):
    """A room that looks like the first, 6 m away by an odometry that errs by millimetres, is another room."""
    sure = np.tile(np.diag(np.repeat([0.002**2, 0.005**2], 3)), (walk.last + 1, 1, 1))
    twin = things()
    landmarks = mapped(walk, twin, range(LAP - 4), 0)
    again = mapped(walk, twin, range(LAP + 2, walk.last + 1), 100)
    for one in again:
        one.position = one.position + np.array([2.0, 0.0, 0.0])
    assert proposals(walk, landmarks + again) == []
    monkeypatch.setattr(walk.smoother, "path_covariances", lambda b: sure)
    assert proposals(walk, seen_twice(walk)) == []  # 20 cm are 40 deviations

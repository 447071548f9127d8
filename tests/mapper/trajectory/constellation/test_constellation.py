"""Constellations: made-up rooms seen twice, places that look like themselves, and keyframes to close a loop between."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import process_time
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.mapper.config import ConstellationConfig
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.trajectory.constellation.candidates import constellation_of, loop_candidates, recent_and_old
from thingmap.mapper.trajectory.constellation.fit import Drift
from thingmap.mapper.trajectory.constellation.matching import ConstellationMatch, match_constellations
from thingmap.mapper.trajectory.constellation.pairs import Constellation

CONFIG = ConstellationConfig()
UP = np.array([0.0, 0.0, 1.0])
CLASSES, USED = 8, 6
HALF_AXES = np.array(
    [[4, 4, 6], [12, 10, 2], [25, 25, 45], [20, 5, 15], [15, 15, 20], [4, 4, 10], [30, 20, 12], [6, 6, 3]]
)  # cm, by class


def things(
    places: np.ndarray, classes: np.ndarray, noise: float, rng: np.random.Generator, lost_share: float = 0.05
) -> Constellation:
    """What is mapped of things: noisy centres and sizes, and a detector that is lost on every twentieth."""
    count = len(places)
    posteriors = np.full((count, CLASSES), 0.1 / CLASSES)
    posteriors[np.arange(count), classes] += 0.9
    lost = rng.random(count) < lost_share
    posteriors[lost] = rng.dirichlet(np.ones(CLASSES), int(lost.sum()))
    return Constellation(
        np.arange(count),
        places + noise * rng.normal(size=(count, 3)),
        np.tile(noise**2 * np.eye(3), (count, 1, 1)),
        posteriors,
        np.log(0.01 * HALF_AXES[classes]) + 0.15 * rng.normal(size=(count, 3)),
        rng.uniform(0.75, 1.0, count),
    )


def moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ T[:3, :3].T + T[:3, 3]


def about_up(yaw: float, shift: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """(4, 4) turn by yaw about a point, then a shift."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("z", yaw).as_matrix()
    T[:3, 3] = middle + shift - T[:3, :3] @ middle
    return T


def scattered(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.c_[rng.uniform(0.0, 4.0, (count, 2)), rng.uniform(0.1, 1.4, count)]


def on_tables(rng: np.random.Generator, count: int) -> np.ndarray:
    """Everything at one height, on three tables of 1 m by 0.7 m."""
    tables = rng.uniform(0.0, 4.0, (3, 2))[rng.integers(3, size=count)]
    return np.c_[tables + rng.uniform(-0.5, 0.5, (count, 2)) * [1.0, 0.7], np.full(count, 0.8)]


@dataclass(frozen=True)
class World:
    recent: Constellation
    old: Constellation
    T_old_recent: np.ndarray
    partner: dict[int, int]  # recent thing -> the old one that it is


def room(seed: int, arrange=scattered, revisited: bool = True) -> World:
    """A room of 12-25 things, part of it mapped again after a drift of up to 1 m and 60 degrees, and clutter."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(12, 26))
    places, classes = arrange(rng, count), rng.integers(0, USED, count)
    noise = rng.uniform(0.01, 0.03)
    direction = rng.normal(size=3) * [1.0, 1.0, 0.2]
    shift = rng.uniform(0.0, 1.0) * direction / np.linalg.norm(direction)
    T = about_up(rng.uniform(-np.pi / 3, np.pi / 3), shift, np.array([2.0, 2.0, 0.7]))
    T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec([*(0.01 * rng.normal(size=2)), 0.0]).as_matrix()
    again = np.argsort(np.linalg.norm(places - places[0], axis=1))[: rng.integers(max(4, count // 3), count + 1)]
    again = again[rng.random(len(again)) < 0.85] if revisited else again[:0]
    new = int(rng.integers(0, 5)) if revisited else int(rng.integers(6, 20))
    recent_places = np.r_[places[again], arrange(rng, new)]
    recent_classes = np.r_[classes[again], rng.integers(0, USED, new)]
    gone = int(rng.integers(0, 5))
    old_places, old_classes = np.r_[places, arrange(rng, gone)], np.r_[classes, rng.integers(0, USED, gone)]
    return World(
        things(moved(np.linalg.inv(T), recent_places), recent_classes, noise, rng),
        things(old_places, old_classes, noise, rng),
        T,
        {i: int(j) for i, j in enumerate(again)},
    )


def match(world: World, **known) -> list[ConstellationMatch]:
    return match_constellations(world.recent, world.old, UP, CONFIG, **known)


def believed(matches: list[ConstellationMatch]) -> bool:
    return bool(matches) and matches[0].log_odds >= CONFIG.min_log_odds


def is_right(found: ConstellationMatch, world: World) -> bool:
    """Most pairs are one thing, and the things land within 15 cm of where they are."""
    same = np.mean([world.partner.get(i) == j for i, j in found.pairs])
    apart = moved(found.T_old_recent, world.recent.positions) - moved(world.T_old_recent, world.recent.positions)
    return bool(same > 0.6 and np.linalg.norm(apart.mean(axis=0)) < 0.15)


@pytest.mark.parametrize(("arrange", "of_many", "of_all"), [(scattered, 0.97, 0.88), (on_tables, 0.87, 0.77)])
def test_rooms_seen_again_are_recognised(arrange, of_many, of_all):
    worlds = [room(seed, arrange) for seed in range(200)]
    results = [match(world) for world in worlds]
    accepted = np.array([believed(result) for result in results])
    right = np.array([bool(r) and is_right(r[0], w) for r, w in zip(results, worlds, strict=True)])
    enough = np.array([len(world.partner) >= 6 for world in worlds])
    precision, recall = right[accepted].mean(), (accepted & right)[enough].mean()
    print(f"{arrange.__name__}: precision {precision:.3f}, recall {recall:.3f} of {enough.sum()} with 6 shared or more")
    print(f"all {len(worlds)}: recall {(accepted & right).mean():.3f}, best is right {right.mean():.3f}")
    assert precision >= 0.97
    assert recall >= of_many
    assert (accepted & right).mean() >= of_all


@pytest.mark.parametrize("arrange", [scattered, on_tables])
def test_other_rooms_are_not(arrange):
    accepted = [believed(match(room(seed, arrange, revisited=False))) for seed in range(200)]
    assert sum(accepted) <= 1


def test_covariance_is_honest():
    scores = []
    for seed in range(100):
        world = room(seed)
        for found in match(world)[:1]:
            if not is_right(found, world) or not believed([found]):
                continue
            error = np.linalg.inv(found.T_old_recent) @ world.T_old_recent
            tangent = np.r_[Rotation.from_matrix(error[:3, :3]).as_rotvec(), error[:3, 3]]
            scores.append(tangent @ np.linalg.solve(found.covariance, tangent) / 6.0)
    print(f"NEES per degree of freedom {np.mean(scores):.2f} of {len(scores)}")
    assert 0.1 < np.mean(scores) < 1.5  # below 1: the floors of centre noise and tilt are wider than in these worlds


def row(count: int, spacing: float, x: float = 0.0) -> np.ndarray:
    return np.c_[x + spacing * np.arange(count), np.zeros(count), np.full(count, 0.8)]


def clean(places: np.ndarray, classes: list[int] | np.ndarray, seed: int = 0) -> Constellation:
    """Well-known things, 3 mm off."""
    group = things(places, np.asarray(classes), 0.003, np.random.default_rng(seed), lost_share=0.0)
    return replace(group, existence=np.ones(len(places)))


def test_a_part_of_a_row_of_cans_is_anywhere_in_it():
    old, recent = clean(row(8, 0.15), [5] * 8), clean(row(4, 0.15, 3.0), [5] * 4, seed=1)
    found = match_constellations(recent, old, UP, CONFIG)
    assert len(found) >= 5
    assert found[0].log_odds < 0.0
    assert found[1].evidence > found[0].evidence - 2.0


def test_a_whole_row_of_cans_has_two_ends():
    cans = [5] * 6
    found = match_constellations(clean(row(6, 0.15, 2.0), cans, seed=1), clean(row(6, 0.15), cans), UP, CONFIG)
    assert [len(one.pairs) for one in found[:2]] == [6, 6]
    assert abs(found[0].evidence - found[1].evidence) < 2.0
    assert not believed(found)


def test_something_beside_the_row_tells_its_ends_apart():
    places = np.r_[row(6, 0.15), [[0.1, 0.5, 0.8], [0.6, -0.4, 0.8]]]
    classes = [5, 5, 5, 5, 5, 5, 1, 3]
    T = about_up(0.6, np.array([0.5, 0.2, 0.1]), places.mean(axis=0))
    recent = clean(moved(np.linalg.inv(T), places), classes, seed=1)
    found = match_constellations(recent, clean(places, classes), UP, CONFIG)
    assert believed(found)
    assert found[0].pairs == tuple((i, i) for i in range(8))
    np.testing.assert_allclose(moved(found[0].T_old_recent, recent.positions), places, atol=0.03)


def square_table() -> np.ndarray:
    return np.array([[0.4, 0.4, 0.8], [-0.4, 0.4, 0.8], [-0.4, -0.4, 0.8], [0.4, -0.4, 0.8], [0.0, 0.0, 0.8]])


def test_a_symmetric_table_has_four_corrections_and_the_drift_may_decide():
    classes, T = [0, 0, 0, 0, 1], about_up(0.2, np.array([0.1, 0.05, 0.0]), np.zeros(3))
    recent, old = clean(moved(np.linalg.inv(T), square_table()), classes, seed=1), clean(square_table(), classes)
    undecided = match_constellations(recent, old, UP, CONFIG)
    assert np.ptp([one.evidence for one in undecided[:4]]) < 2.0
    assert len(undecided) >= 4
    assert not believed(undecided)
    decided = match_constellations(recent, old, UP, CONFIG, drift=Drift(0.2, 0.3))
    assert believed(decided)
    assert decided[0].pairs == tuple((i, i) for i in range(5))


def test_old_things_that_should_have_been_seen_again_speak_against():
    world = room(3)
    aside = world.old.positions + np.array([0.12, 0.12, 0.0])
    crowd = np.concatenate([world.old.positions, aside])
    twice = np.tile(np.arange(len(world.old)), 2)
    crowded = Constellation(
        np.arange(len(crowd)),
        crowd,
        world.old.covariances[twice],
        np.roll(world.old.class_posteriors, 1, axis=1)[twice],
        world.old.log_sizes[twice],
        world.old.existence[twice],
    )
    crowded.class_posteriors[: len(world.old)] = world.old.class_posteriors
    alone, among = match(world)[0], match_constellations(world.recent, crowded, UP, CONFIG)[0]
    assert is_right(alone, world)
    assert among.missed > alone.missed
    assert among.evidence < alone.evidence
    unseen = match_constellations(world.recent, crowded, UP, CONFIG, visible=lambda x: np.zeros(len(x), dtype=bool))[0]
    assert unseen.missed == 0
    assert unseen.evidence > among.evidence


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_things_say_nothing(count):
    world = room(1)
    few = Constellation(*(getattr(world.recent, name)[:count] for name in Constellation.__slots__))
    assert match_constellations(few, world.old, UP, CONFIG) == []
    assert match_constellations(world.old, few, UP, CONFIG) == []


def test_things_that_lie_otherwise_do_not_match():
    triangle = np.array([[0.0, 0.0, 0.8], [1.0, 0.0, 0.8], [0.0, 1.5, 0.8]])
    old = clean(triangle, [0, 1, 2])
    assert match_constellations(clean(3.0 * triangle, [0, 1, 2], seed=1), old, UP, CONFIG) == []
    upside = triangle * [1.0, 1.0, 0.0] + np.array([[0.0, 0.0, 0.2], [0.0, 0.0, 0.9], [0.0, 0.0, 1.6]])
    assert match_constellations(clean(upside, [0, 1, 2], seed=1), old, UP, CONFIG) == []


def test_things_of_other_classes_never_match():
    places = scattered(np.random.default_rng(0), 6)
    rng = np.random.default_rng(1)
    sure = [replace(clean(places, [k] * 6), class_posteriors=np.tile(np.eye(CLASSES)[k], (6, 1))) for k in (0, 1)]
    assert match_constellations(sure[0], sure[1], UP, CONFIG) == []
    same = replace(
        sure[1], class_posteriors=sure[0].class_posteriors, positions=places + 0.003 * rng.normal(size=(6, 3))
    )
    assert believed(match_constellations(replace(same, log_sizes=sure[0].log_sizes), sure[0], UP, CONFIG))
    large = replace(same, log_sizes=sure[0].log_sizes + 1.5)
    assert match_constellations(large, sure[0], UP, CONFIG) == []


def shuffled(group: Constellation, order: np.ndarray) -> Constellation:
    return Constellation(*(getattr(group, name)[order] for name in Constellation.__slots__))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 900), arrangement=st.integers(0, 2**31))
def test_the_order_of_things_does_not_matter(seed, arrangement):
    world, rng = room(seed), np.random.default_rng(arrangement)
    i, j = rng.permutation(len(world.recent)), rng.permutation(len(world.old))
    before, after = match(world), match_constellations(shuffled(world.recent, i), shuffled(world.old, j), UP, CONFIG)
    assert believed(before) == believed(after)
    if believed(before):
        assert {(int(i[a]), int(j[b])) for a, b in after[0].pairs} == set(before[0].pairs)
        np.testing.assert_allclose(after[0].T_old_recent, before[0].T_old_recent, atol=1e-7)
        assert after[0].evidence == pytest.approx(before[0].evidence, abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 900), yaw=st.floats(-3.1, 3.1), x=st.floats(-5, 5), y=st.floats(-5, 5), tilted=st.booleans())
def test_moving_the_world_moves_the_correction(seed, yaw, x, y, tilted):
    world = room(seed)
    G = about_up(yaw, np.array([x, y, 0.3]), np.zeros(3))
    if tilted:  # another choice of axes, up and all
        G[:3, :3] = Rotation.from_euler("x", 1.2).as_matrix() @ G[:3, :3]

    def carried(group: Constellation) -> Constellation:
        R = G[:3, :3]
        return replace(group, positions=moved(G, group.positions), covariances=R @ group.covariances @ R.T)

    known = {"drift": Drift(0.6, 0.6)}
    before = match(world, **known)
    after = match_constellations(carried(world.recent), carried(world.old), G[:3, :3] @ UP, CONFIG, **known)
    assert believed(before) == believed(after)
    if believed(before):
        assert after[0].pairs == before[0].pairs
        np.testing.assert_allclose(after[0].T_old_recent, G @ before[0].T_old_recent @ np.linalg.inv(G), atol=1e-6)
        assert after[0].log_odds == pytest.approx(before[0].log_odds, abs=1e-5)


def test_thirty_among_two_hundred_is_quick():
    rng = np.random.default_rng(0)
    places, classes = np.c_[rng.uniform(0.0, 8.0, (200, 2)), rng.uniform(0.1, 1.4, 200)], rng.integers(0, USED, 200)
    near = np.argsort(np.linalg.norm(places - places[0], axis=1))[:30]
    old, recent = things(places, classes, 0.02, rng), things(places[near], classes[near], 0.02, rng)
    assert believed(match_constellations(recent, old, UP, CONFIG))  # compiled by now
    taken = []
    for _ in range(5):
        start = process_time()
        match_constellations(recent, old, UP, CONFIG)
        taken.append(process_time() - start)
    print(f"{1e3 * min(taken):.1f} ms")
    assert min(taken) < 0.02


def landmark(number: int, supporting: set[int], existence: float = 0.9, variance: float = 0.01) -> Landmark:
    belief = SimpleNamespace(existence=existence, class_posterior=lambda: np.array([0.8, 0.2]))
    place, covariance = np.full(3, float(number)), variance * np.eye(3)
    return Landmark(number, belief, place, np.zeros(3), 0.0, 1.0, covariance, supporting=supporting)  # type: ignore[arg-type]


def test_recent_and_old_landmarks():
    config = ConstellationConfig(recent_keyframes=10, old_keyframes=20)
    new, lost, kept = landmark(5, {91, 95}), landmark(2, {3, 80}), landmark(3, {3, 95})
    lately, doubtful, unseen = landmark(4, {70, 85}), landmark(1, {95}, existence=0.5), landmark(6, set())
    groups = recent_and_old([new, lost, kept, lately, doubtful, unseen], 100, config)
    assert [[one.number for one in group] for group in groups] == [[5], [2]]


def test_constellation_of_landmarks_leaves_out_the_shared_drift():
    group = constellation_of([landmark(1, {1}, variance=0.25), landmark(4, {2}, variance=0.2504)])
    np.testing.assert_array_equal(group.numbers, [1, 4])
    np.testing.assert_allclose(group.covariances, [np.zeros((3, 3)), 0.0004 * np.eye(3)], atol=1e-12)
    np.testing.assert_allclose(group.class_posteriors, [[0.8, 0.2]] * 2)
    assert len(constellation_of([])) == 0
    assert match_constellations(constellation_of([]), group, UP, CONFIG) == []


def test_loop_candidates_saw_most_of_the_matched_things_from_nearly_the_same_place():
    T = about_up(0.4, np.array([0.5, 0.0, 0.0]), np.zeros(3))
    poses = np.tile(np.eye(4), (100, 1, 1))
    poses[:50, 0, 3] = 0.1 * np.arange(50)  # keyframes 50-99 are 0-49 again, as the camera believes them to be
    poses[50:] = np.linalg.inv(T) @ poses[:50]
    found = ConstellationMatch(T, ((0, 1), (1, 0), (2, 2)), 20.0, 15.0, 0, np.eye(6))
    recent = [{60, 61, 62, 75}, {61, 62}, {61, 75, 90}, {50}]
    old = [{11, 12, 25}, {11, 25}, {11, 12, 40}]
    candidates = loop_candidates(found, recent, old, poses, CONFIG)
    first = candidates[0]
    assert (first.old, first.recent, first.seen) == (11, 61, 3)
    np.testing.assert_allclose(first.T_old_recent, np.eye(4), atol=1e-9)
    assert all(one.seen >= 2 for one in candidates)
    assert len({(one.old, one.recent) for one in candidates}) == len(candidates) <= CONFIG.max_candidates
    assert loop_candidates(found, recent, [set(), set(), set()], poses, CONFIG) == []
    for one in candidates:
        expected = np.linalg.inv(poses[one.old]) @ poses[one.recent - 50]
        np.testing.assert_allclose(one.T_old_recent, expected, atol=1e-9)

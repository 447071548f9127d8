"""Verifying candidates: by what they are verified, what fails, and that it may happen in another process."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from thingmap.mapper.config import LoopConfig, ScanConfig, VisualConfig
from thingmap.mapper.trajectory.loops import link_jobs
from thingmap.mapper.trajectory.loops.link_jobs import Candidate, LinkConfig, LinkFound, LinkJob, LinkKind, find_links
from thingmap.mapper.trajectory.loops.places import Place
from thingmap.mapper.trajectory.loops.scan_matching import Scan
from thingmap.mapper.trajectory.rigid import inverse
from thingmap.mapper.trajectory.visual.features import Features

from .box_room import depth_points, features, pose, retracted, tangent

CONFIG = LinkConfig(
    ScanConfig(), VisualConfig(min_inliers=LoopConfig().min_inliers), agreement=LoopConfig().agreement, seed=0
)
OLD, NEW = pose(), pose(0.12, 0.0, 0.1, 0.2)
TRUTH = inverse(OLD) @ NEW
OWNER = iter(range(10**6, 2 * 10**6))  # a map of its own for every test


def place(keyframe: int, T: np.ndarray, features_shifted: float = 0.0) -> Place:
    seen = features(T)
    points = seen.points + np.array([0.0, features_shifted, 0.0])
    return Place(keyframe, Features(seen.descriptors, points), Scan.of(depth_points(T), CONFIG.scans.spacing))


def links(new: Place, *candidates: Candidate, owner: int | None = None) -> list[LinkFound]:
    return find_links(LinkJob(next(OWNER) if owner is None else owner, new, candidates, CONFIG))


def assert_right(link: LinkFound, truth: np.ndarray = TRUTH) -> None:
    gap = tangent(link.motion.T_a_b, truth)
    assert np.linalg.norm(gap[:3]) < 0.004 and np.linalg.norm(gap[3:]) < 0.006


def test_a_near_place_is_matched_from_its_guess():
    guess = retracted(TRUTH, np.array([0.0, 0.02, 0.0, 0.02, 0.02, -0.02]))
    (link,) = links(place(7, NEW), Candidate(place(2, OLD), LinkKind.NEAR, guess))
    assert (link.a, link.b, link.kind) == (2, 7, LinkKind.NEAR)
    assert_right(link)


def test_what_looks_alike_needs_no_guess():
    (link,) = links(place(7, NEW), Candidate(place(2, OLD), LinkKind.ALIKE, None))
    assert link.kind is LinkKind.ALIKE
    assert_right(link)


@pytest.mark.parametrize(("shift", "agrees"), [(0.0, True), (0.03, True), (0.1, False), (-0.1, False)])
def test_features_and_depth_must_agree(shift, agrees):
    """Features that lie elsewhere than the walls tell another motion than depth does."""
    old, new = place(2, OLD), place(7, NEW, shift)
    wide = replace(CONFIG, scans=replace(CONFIG.scans, reaches=(0.2, 0.04)))  # depth finds the truth from there
    for agreement, passes in ((CONFIG.agreement, agrees), ((1.0, 1.0), True)):
        config = replace(wide, agreement=agreement)
        found = find_links(LinkJob(next(OWNER), new, (Candidate(old, LinkKind.ALIKE, None),), config))
        assert len(found) == passes
        for link in found:
            assert_right(link)  # and what depth says is taken


def test_too_few_features_in_common_are_no_candidate():
    old, new = place(2, OLD), place(7, NEW)
    others = np.random.default_rng(3).integers(0, 256, old.features.descriptors.shape, np.uint8)
    stranger = replace(old, features=Features(others, old.features.points))
    assert links(new, Candidate(stranger, LinkKind.ALIKE, None)) == []
    assert len(links(new, Candidate(stranger, LinkKind.NEAR, TRUTH))) == 1  # which features have no say in


def test_things_tell_a_place_from_further_off_but_more_must_fit():
    guess = retracted(TRUTH, np.array([0.0, 0.03, 0.0, 0.08, 0.08, 0.12]))
    old, new = place(2, OLD), place(7, NEW)
    (link,) = links(new, Candidate(old, LinkKind.SAME_THINGS, guess))
    assert link.kind is LinkKind.SAME_THINGS
    assert_right(link)
    share = link.motion.inliers / min(len(old.scan.points), len(new.scan.points))
    for kind, factor, passes in (
        (LinkKind.NEAR, 0.98, True), (LinkKind.SAME_THINGS, 0.98, False), (LinkKind.SAME_THINGS, 0.78, True)
    ):  # fmt: skip
        config = replace(CONFIG, scans=replace(CONFIG.scans, min_share=factor * share))
        found = find_links(LinkJob(next(OWNER), new, (Candidate(old, kind, TRUTH),), config))
        assert len(found) == passes


def test_those_that_fail_are_left_out_and_others_not():
    away = place(1, pose(turn=np.pi))
    found = links(
        place(7, NEW),
        Candidate(away, LinkKind.NEAR, inverse(pose(turn=np.pi)) @ NEW),
        Candidate(place(2, OLD), LinkKind.NEAR, TRUTH),
        Candidate(away, LinkKind.ALIKE, None),
    )
    assert [(link.a, link.b) for link in found] == [(2, 7)]
    assert links(place(7, NEW)) == []


def test_prepared_scans_are_those_of_their_map_and_not_many(monkeypatch):
    """Keyframes of two maps have the same numbers."""
    monkeypatch.setattr(link_jobs, "KEPT", 5)
    one, other = next(OWNER), next(OWNER)
    elsewhere = pose(0.1, 0.0, -0.3)  # further from the wall
    for owner, T in ((one, OLD), (other, elsewhere), (one, OLD)):
        new = T @ TRUTH
        (link,) = links(place(7, new), Candidate(place(2, T), LinkKind.NEAR, TRUTH), owner=owner)
        assert_right(link)
    for number in range(10):
        links(place(50 + number, NEW), Candidate(place(2, OLD), LinkKind.NEAR, TRUTH), owner=one)
    assert len(link_jobs._scans) == 5 and (one, 2) in link_jobs._scans  # what is used again and again stays


def test_a_job_survives_the_way_to_another_process_and_gives_the_same():
    job = LinkJob(next(OWNER), place(7, NEW), (Candidate(place(2, OLD), LinkKind.ALIKE, None),), CONFIG)
    there = replace(pickle.loads(pickle.dumps(job)), owner=next(OWNER))
    (one,), (other,) = find_links(job), pickle.loads(pickle.dumps(find_links(there)))
    assert (one.a, one.b, one.kind, one.motion.inliers) == (other.a, other.b, other.kind, other.motion.inliers)
    np.testing.assert_array_equal(one.motion.T_a_b, other.motion.T_a_b)
    np.testing.assert_array_equal(one.motion.covariance, other.motion.covariance)

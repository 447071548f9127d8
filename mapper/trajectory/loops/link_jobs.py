"""Matching keyframes that are not neighbours: jobs that may run in another process, and what comes of them."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from ...config import ScanConfig, VisualConfig
from ..odometry.odometry import fused
from ..rigid import inverse, rotation_angle
from ..visual.feature_motion import RelativePose, relative_pose
from .places import Place
from .scan_matching import PreparedScan, match_scans

KEPT = 48  # prepared scans at hand, 1 MB each: neighbours are matched again and again


class LinkKind(Enum):
    """Why two keyframes are matched."""

    NEAR = "near"  # it is known well enough how they lie
    ALIKE = "alike"  # their images look alike
    SAME_THINGS = "same things"  # the things in them lie alike


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A keyframe to match with: `T_guess` is its (4, 4) `T_place_camera`, None where only the images can tell."""

    place: Place
    kind: LinkKind
    T_guess: np.ndarray | None


@dataclass(frozen=True, slots=True, eq=False)
class LinkConfig:
    """Numbers of the jobs: of scans and features, and how far both may disagree (rad, m)."""

    scans: ScanConfig
    features: VisualConfig
    agreement: tuple[float, float]
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class LinkJob:
    """A keyframe and what it may be linked to; `owner` tells maps apart."""

    owner: int
    place: Place
    candidates: tuple[Candidate, ...]
    config: LinkConfig


@dataclass(frozen=True, slots=True, eq=False)
class LinkFound:
    """A verified motion between keyframes: `motion.T_a_b` is b in a."""

    a: int
    b: int
    kind: LinkKind
    motion: RelativePose


def find_links(job: LinkJob) -> list[LinkFound]:
    """Verifies a job's candidates; those that fail are left out."""
    found = []
    for candidate in job.candidates:
        motion = _verified(job, candidate)
        if motion is not None:
            found.append(LinkFound(candidate.place.keyframe, job.place.keyframe, candidate.kind, motion))
    return found


def _verified(job: LinkJob, candidate: Candidate) -> RelativePose | None:
    c, guess = job.config, candidate.T_guess
    seen = None
    if candidate.kind is LinkKind.ALIKE:
        seen = relative_pose(candidate.place.features, job.place.features, c.features, c.seed)
        if seen is None:
            return None
        guess = seen.T_a_b
    assert guess is not None
    a, b = _prepared(job.owner, candidate.place, c.scans), _prepared(job.owner, job.place, c.scans)
    if candidate.kind is LinkKind.SAME_THINGS:
        return match_scans(a, b, guess, _from_afar(c.scans))
    motion = match_scans(a, b, guess, c.scans)
    if motion is None or seen is None:
        return motion
    off = inverse(guess) @ motion.T_a_b
    if rotation_angle(off[:3, :3]) > c.agreement[0] or np.linalg.norm(off[:3, 3]) > c.agreement[1]:
        return None
    # what the depth leaves open, the features hold
    T, covariance = fused(motion.T_a_b, motion.covariance, seen.T_a_b, seen.covariance)
    return RelativePose(T, covariance, motion.inliers)


def _from_afar(config: ScanConfig) -> ScanConfig:
    """Things tell a place to a few centimetres and degrees: the first reach is wider, and more must fit in the end."""
    return replace(config, reaches=(3.0 * config.reaches[0], *config.reaches), min_share=1.25 * config.min_share)


_scans: OrderedDict[tuple[int, int], PreparedScan] = OrderedDict()


def _prepared(owner: int, place: Place, config: ScanConfig) -> PreparedScan:
    """Search tree and planes of a place's scan, of which the latest used are kept."""
    key = owner, place.keyframe
    known = _scans.pop(key, None)
    if known is None:
        known = PreparedScan(place.scan, config)
    _scans[key] = known
    while len(_scans) > KEPT:
        _scans.popitem(last=False)
    return known

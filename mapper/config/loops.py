"""How places are recognised and loops closed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PlaceConfig:
    """Keyframes recognised by appearance; numbers from benchmarks/places.py."""

    votes: int = 5  # keyframes that a feature votes for; 3 to 8 are alike
    max_distance: int = 63  # bits of 256 between a feature and one it votes for; 55 finds less, 70 nothing more
    max_comparisons: int = 150_000  # of features in a query, 3 ms; beyond it those of rare words are asked alone
    neighbours: int = 2  # keyframes on both sides of a better one that are not named beside it
    unseen: int = 20  # keyframes added to the average without a vote: a few keyframes of one place are no background
    min_score: float = 0.015  # share of features; nine of ten revisits of a recorded kitchen score more


@dataclass(frozen=True, slots=True)
class LoopConfig:
    """Links between keyframes that are not neighbours: by depth where it is known where they are, else by the image."""

    enabled: bool = True
    appearance: bool = True  # places are recognised by their images
    constellation: bool = True  # and by the things in them
    process: bool = True  # matching is done by another process; off: here, with the same result
    lag: int = 5  # keyframes after which links enter the graph: 1 s, in which the other process makes them
    place_spacing: tuple[float, float] = (0.1, 0.1)  # rad, m: a keyframe is remembered if no place is as near
    reach: tuple[float, float] = (0.5, 0.5)  # rad, m, within which two views overlap enough to be matched by depth
    skip: int = 3  # keyframes between ends of a link; nearer ones are tied by odometry
    ages: tuple[int, ...] = (8, 40)  # keyframes: a link each to the nearest place younger, in between, and older
    known: tuple[float, float] = (0.03, 0.05)  # rad, m: deviation of a relative pose up to which depth needs no image
    gate: float = 22.46  # chi-square, 6 degrees of freedom, 99.9 %: a link this far from the estimate is refused
    gate_floor: tuple[float, float] = (0.005, 0.01)  # rad, m: of the estimate, for what its covariance leaves out
    candidates: int = 3  # places that look alike, verified for a keyframe
    min_age: int = 30  # keyframes, from which a place that looks alike closes a loop
    min_inliers: int = 25  # matched features that agree on one motion
    agreement: tuple[float, float] = (0.05, 0.08)  # rad, m: between the motions by features and by depth
    check_every: int = 20  # keyframes between checks of all loops by GNC, if there are new ones
    check_lag: int = 10  # keyframes until a check's verdict enters the graph
    probability: float = 0.9999  # with which a right loop passes the check
    patience: int = 60  # keyframes without a known place after which the map goes on from a guessed one
    constellation_every: int = 10  # keyframes


@dataclass(frozen=True, slots=True)
class ConstellationConfig:
    """Things that were mapped twice, once before and once after the camera drifted, recognised by how they lie."""

    recent_keyframes: int = 60  # a recent thing was first seen within these; about a quarter of a lap of two rooms
    old_keyframes: int = 60  # an old thing was not seen within these
    again_keyframes: int = 10  # an old thing seen within these was seen again: as often as LoopConfig asks
    min_existence: float = 0.7  # only things one is sure of
    min_matches: int = 3  # things; with two any pair of cups lies on any other
    sigma_position: float = 0.02  # m, floor of a centre's noise against its neighbours
    sigma_extent: float = 0.15  # of the mean half axis: a centre moves when the thing is seen from another side
    sigma_limit: float = 0.1  # m, above which a thing's place among its neighbours says too little: cut down to it
    sigma_size: float = 0.35  # log units between two boxes of one thing, as in LifecycleConfig.merge_log_size
    sigma_tilt: float = 0.03  # rad, of the correction against gravity: UpConfig.upright_tolerance
    gate: float = 11.34  # chi-square, 3 degrees of freedom, 99 %
    min_baseline: float = 0.2  # m, horizontal, between the two pairs that a correction is first made from
    class_error: float = 0.1  # probability that a class posterior says nothing
    min_class_ratio: float = 0.5  # of one class against any two, below which a pair is not tried; 0.19 at least
    detection: float = 0.6  # probability that a thing in view becomes a confident landmark again
    seen_before: float = 0.5  # prior share of recent things that are old ones, where the camera is at a known place
    view_radius: float = 0.5  # m around recent things within which an old one should have been mapped again
    spread: float = 0.1  # m, added to how far things are spread, for few of them
    prior_log_odds: float = -2.2  # that the camera is at a known place: 0.1
    min_log_odds: float = 2.0  # from which a correction is believed: 0.88; in made-up rooms 99 % of these are right
    max_pairs: int = 1500  # compatible pairs that are looked at, the most telling first
    max_corrections: int = 24  # weighed against each other
    max_candidates: int = 3  # pairs of keyframes proposed for a correction

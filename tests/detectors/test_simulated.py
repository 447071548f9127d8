"""The simulated detector: on a made-up sequence whose truth is under control, and on the sample."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.synthetic.sample import TabletopConfig, TabletopSequence
from thingmap.datasets.truth import FrameTruth, TrueObject
from thingmap.datasets.views import subset
from thingmap.detectors.detections import Detections
from thingmap.detectors.simulated import SimulatedDetector, SimulatedDetectorConfig

CLASSES = ("cup", "bowl", "soda can", "cap")
CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
QUIET = SimulatedDetectorConfig(background_spots=0, chance_rate=0.0, spot_chance=0.0)


class Lineup:
    """Cups in a row, each visible to a chosen share: the right part of a 60 x 80 box is hidden."""

    def __init__(self, *visibility: float, label: str = "cup") -> None:
        self.classes = CLASSES
        self.objects = tuple(
            TrueObject(k, label, np.array([0.0, 0.0, 1.0]), np.full(3, 0.1), 0.0) for k in range(len(visibility))
        )
        whole = np.array([[20.0 + 70 * k, 200.0, 80.0 + 70 * k, 280.0] for k in range(len(visibility))])
        visible = whole.copy()
        visible[:, 2] = whole[:, 0] + 60 * np.array(visibility)
        visible[np.array(visibility) == 0] = np.nan
        self._truth = FrameTruth(np.arange(len(visibility)), whole, visible, np.array(visibility, float))

    def truth(self, index: int) -> FrameTruth:
        return self._truth


def frame(name: str, index: int = 0) -> Frame:
    return Frame(index, name, 0.0, np.zeros((480, 640, 3), np.uint8), np.zeros((480, 640), np.float32), CAMERA)


def run(detector: SimulatedDetector, count: int = 400) -> list[Detections]:
    return [detector(frame(f"f{k}")) for k in range(count)]


def near_column(found: Detections, left: float) -> np.ndarray:
    """Which detections begin near a column."""
    return np.abs(found.xyxy[:, 0] - left - 0.5) < 25


@pytest.fixture(scope="module")
def tabletop() -> TabletopSequence:
    return TabletopSequence(TabletopConfig(width=320, frames=100))


def test_objects_are_missed_the_more_they_are_hidden():
    levels = (1.0, 0.6, 0.4, 0.3, 0.2, 0.0)
    found = run(SimulatedDetector(Lineup(*levels), QUIET))
    rate = np.array([np.mean([near_column(d, 20 + 70 * k).any() for d in found]) for k in range(len(levels))])
    assert np.all(np.diff(rate) < 0.01) and rate[0] > 0.93 and rate[-1] == 0.0
    assert rate[1] - rate[4] > 0.5


def test_small_objects_are_missed_more_often():
    detector = SimulatedDetector(Lineup(1.0))
    by_size = detector.find_probability(1.0, np.array([6.0, 12.0, 18.0, 36.0, 120.0]))
    by_visibility = detector.find_probability(np.linspace(0.0, 1.0, 11), 80.0)
    assert np.all(np.diff(by_size) > 0) and np.all(np.diff(by_visibility) > 0)
    assert by_size[0] < 0.1 and by_size[2] == pytest.approx(0.48, abs=0.01) and by_size[-1] > 0.95


def test_mean_scores_rise_with_size_and_visibility():
    detector = SimulatedDetector(Lineup(1.0), QUIET)
    by_size = detector.mean_score(1.0, np.array([4.0, 10.0, 20.0, 40.0, 200.0]))
    by_visibility = detector.mean_score(np.linspace(0.0, 1.0, 11), 80.0)
    assert np.all(np.diff(by_size) > 0) and np.all(np.diff(by_visibility) > 0)
    low, high = QUIET.score_range
    half = low + (high - low) / 2.0
    assert by_size[2] == pytest.approx(half, abs=0.01) and by_size[-1] == pytest.approx(high, abs=0.02)
    assert detector.mean_score(QUIET.score_visibility, 1e6) == pytest.approx(half)


def test_scores_are_a_full_vector_that_falls_with_occlusion():
    found = run(SimulatedDetector(Lineup(1.0, 0.45), QUIET))
    scores = np.concatenate([d.scores for d in found])
    assert scores.shape[1] == len(CLASSES) and np.isfinite(scores).all()
    assert scores.min() >= 0.0 and scores.sum(axis=1).max() <= 1.0 + 1e-9
    sure = np.concatenate([d.confidence[near_column(d, 20)] for d in found])
    unsure = np.concatenate([d.confidence[near_column(d, 90)] for d in found])
    assert sure.mean() > 0.5 and sure.mean() - unsure.mean() > 0.2
    assert 0.05 < sure.std() < 0.3, "scores vary"


@pytest.mark.parametrize(
    "change",
    [
        {"max_recall": 1.5}, {"visibility_width": 0.0}, {"half_side": 0.0}, {"mood_rate": 0.0},
        {"score_strength": -1.0}, {"min_score": 2.0}, {"split_strength": 0.0}, {"box_sigma": float("inf")},
        {"box_tail": 2.0}, {"background_spots": -3}, {"spot_chance": float("nan")}, {"chance_rate": -1.0},
    ],
)  # fmt: skip
def test_impossible_numbers_are_told(change: dict[str, float]):
    with pytest.raises(UserError, match=f"expected {next(iter(change))} from"):
        SimulatedDetectorConfig(**change)


def test_shares_that_leave_nothing_and_negative_seeds_are_told():
    with pytest.raises(UserError, match="lower stray_share"):
        SimulatedDetector(Lineup(1.0), SimulatedDetectorConfig(stray_share=0.5))
    with pytest.raises(UserError, match="a seed >= 0, found -1"):
        SimulatedDetector(Lineup(1.0), seed=-1)


def test_confusions_happen_between_the_stated_pairs_and_grow_with_occlusion():
    config = SimulatedDetectorConfig(
        background_spots=0, chance_rate=0.0, spot_chance=0.0, confusions=(("cup", "bowl", 0.3),), min_score=0.0
    )
    named = {}
    for visibility in (1.0, 0.4):
        found = run(SimulatedDetector(Lineup(visibility), config), 800)
        named[visibility] = Counter(CLASSES[k] for d in found for k in d.class_id)
    for names in named.values():
        assert names["cup"] > names["bowl"] > 5 * max(names["soda can"], names["cap"], 1)
    share = {v: names["bowl"] / names.total() for v, names in named.items()}
    assert 0.02 < share[1.0] < share[0.4]


def test_boxes_lie_between_the_visible_part_and_the_whole_and_err_more_when_hidden():
    found = run(SimulatedDetector(Lineup(1.0, 0.5), QUIET))
    whole = np.concatenate([d.xyxy[near_column(d, 20)] for d in found]) - 0.5
    half = np.concatenate([d.xyxy[near_column(d, 90)] for d in found]) - 0.5
    np.testing.assert_allclose(whole.mean(axis=0), [20, 200, 80, 280], atol=0.6)
    right = half[:, 2].mean()
    assert 120 < right < 145, "between 120, where the visible part ends, and 150"
    assert whole[:, 0].std() == pytest.approx(0.03 * 60, rel=0.2)
    assert half[:, 1].std() > 1.4 * whole[:, 1].std()


def test_equal_seeds_and_names_give_equal_detections_in_any_order(tabletop, assert_same):
    frames = [tabletop[k] for k in (0, 40, 80)]
    first, second = SimulatedDetector(tabletop, seed=2), SimulatedDetector(tabletop, seed=2)
    forward = [first(f) for f in frames]
    for k in (2, 0, 1):
        assert_same(second(frames[k]), forward[k])
    other = SimulatedDetector(tabletop, seed=3)(frames[0])
    assert len(other) != len(forward[0]) or not np.array_equal(other.xyxy, forward[0].xyxy)


def test_every_nth_frame_gets_the_same_detections_as_in_the_whole(tabletop, assert_same):
    third = subset(tabletop, stride=33)
    whole, part = SimulatedDetector(tabletop), SimulatedDetector(third)
    for k in range(len(third)):
        assert_same(part(third[k]), whole(tabletop[33 * k]))


def test_on_the_sample_it_finds_most_and_invents_some(tabletop):
    detector = SimulatedDetector(tabletop)
    visible = found_in = invented = 0
    for index in range(0, 100, 6):
        truth, found = tabletop.truth(index), detector(tabletop[index])
        assert found.classes == tabletop.classes
        assert found.xyxy.min() >= 0 and np.all(found.xyxy[:, [2, 3]] <= [320, 240])
        clear = truth.visibility > 0.7
        overlaps = iou(truth.xyxy_visible[clear] + 0.5, found.xyxy)
        visible += clear.sum()
        found_in += (overlaps.max(axis=1, initial=0.0) > 0.5).sum()
        seen = truth.visibility > 0
        invented += (iou(found.xyxy, truth.xyxy[seen] + 0.5).max(axis=1, initial=0.0) < 0.2).sum()
    assert found_in / visible > 0.7
    assert 3 <= invented <= 60


def test_false_detections_come_again_at_the_clutter(tabletop):
    only_spots = SimulatedDetectorConfig(max_recall=0.0, chance_rate=0.0, background_spots=0, spot_chance=1.0)
    detector = SimulatedDetector(tabletop, only_spots, seed=1)
    centres = []
    for index in range(100):
        T = tabletop.poses[index]
        image = Frame(index, f"f{index}", 0.0, np.zeros((1, 1, 3), np.uint8), FAR, tabletop.intrinsics, T)
        found = detector(image)
        for box in found.xyxy:
            pixel = (box[:2] + box[2:]) / 2 - 0.5
            points = np.stack([(thing.position - T[:3, 3]) @ T[:3, :3] for thing in tabletop.clutter])
            distance = np.linalg.norm(tabletop.intrinsics.project(points) - pixel, axis=1)
            centres.append((distance.argmin(), distance.min()))
    which, distance = np.array(centres).T
    assert np.median(distance) < 8 and distance.max() < 40
    assert len(centres) > 20 and set(which) == {0.0, 1.0}


FAR = np.full((240, 320), 9.0, np.float32)


def test_spots_behind_a_surface_are_not_seen(tabletop):
    only_spots = SimulatedDetectorConfig(max_recall=0.0, chance_rate=0.0, background_spots=4, spot_chance=1.0)
    detector = SimulatedDetector(tabletop, only_spots)
    counts = []
    for depth in (FAR, np.full_like(FAR, 0.45)):
        images = (
            Frame(k, f"f{k}", 0.0, np.zeros((1, 1, 3), np.uint8), depth, tabletop.intrinsics, tabletop.poses[k])
            for k in range(0, 100, 10)
        )
        counts.append(sum(len(detector(image)) for image in images))
    assert counts[0] > 3 and counts[1] == 0


def test_a_sequence_without_truth_is_refused(tabletop):
    class Recording:
        name = "my recording"

    with pytest.raises(UserError, match="my recording: expected a sequence whose objects are known"):
        SimulatedDetector(Recording())  # pyright: ignore[reportArgumentType]


def test_frames_of_another_sequence_are_refused(tabletop):
    other = TabletopSequence(TabletopConfig(width=64, frames=10, seed=4))
    with pytest.raises(UserError, match="expected a frame of the sequence"):
        SimulatedDetector(tabletop)(other[5])
    with pytest.raises(UserError, match="expected a frame of the sequence"):
        SimulatedDetector(other)(tabletop[50])


def iou(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(A, B) intersection over union of boxes."""
    low, high = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=2)
    area_a, area_b = (np.prod(x[:, 2:] - x[:, :2], axis=1) for x in (a, b))
    return both / (area_a[:, None] + area_b - both)

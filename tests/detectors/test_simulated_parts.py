"""The templates of halves of the simulated detector."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.synthetic.sample import TabletopConfig, TabletopSequence
from thingmap.datasets.truth import FrameTruth, TrueObject
from thingmap.datasets.views import subset
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.parts import part_box
from thingmap.detectors.recorded import RecordedDetections, write_detections
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.detectors.simulated_config import SimulatedDetectorConfig
from thingmap.detectors.spec import make_detector

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
WITH_PARTS = SimulatedDetectorConfig(parts=True)
QUIET = SimulatedDetectorConfig(parts=True, background_spots=0, chance_rate=0.0, spot_chance=0.0)
SQUARE, TALL, WIDE = (200, 200, 300, 300), (200, 200, 260, 320), (200, 200, 320, 260)
CLASSES = ("cup", "bowl", "soda can", "cap")


class OneCup:
    """One cup, of which the parts (whole, top, bottom, left, right) are visible to chosen shares."""

    def __init__(self, shares: tuple[float, ...], xyxy: tuple[float, ...] = SQUARE) -> None:
        self.classes = CLASSES
        self.objects = (TrueObject(7, "cup", np.array([0.0, 0.0, 1.0]), np.full(3, 0.1), 0.0),)
        visible = np.array([shares])
        box = np.array([xyxy], dtype=float)
        seen = box.copy()
        seen[0, 2] -= (1.0 - shares[0]) * (box[0, 2] - box[0, 0])
        self._truth = FrameTruth(np.array([7]), box, seen, visible[:, 0], visible)

    def truth(self, index: int) -> FrameTruth:
        return self._truth


FREE, RIGHT_HIDDEN = (1.0,) * 5, (0.5, 0.5, 0.5, 1.0, 0.0)
BEHIND = (0.3, 0.6, 0.0, 0.3, 0.3)  # only the upper part looks out


def run(sequence: OneCup, config: SimulatedDetectorConfig = QUIET, count: int = 600) -> list[Detections]:
    detector = SimulatedDetector(sequence, config, seed=4)
    depth = np.zeros((480, 640), np.float32)
    return [detector(Frame(0, f"f{k}", 0.0, np.zeros((1, 1, 3), np.uint8), depth, CAMERA)) for k in range(count)]


def rates(found: list[Detections]) -> np.ndarray:
    """(5,) share of the frames in which each template found something."""
    return np.mean([np.isin(np.arange(5), d.part) for d in found], axis=0)


def of(part: Part, found: list[Detections]) -> Detections:
    return Detections.concatenate([d.select(d.part == part) for d in found])


@pytest.fixture(scope="module")
def tabletop() -> TabletopSequence:
    return TabletopSequence(TabletopConfig(width=320, frames=100))


def test_whole_objects_are_found_as_without_parts(tabletop, assert_same):
    without, with_parts = SimulatedDetector(tabletop, seed=2), SimulatedDetector(tabletop, WITH_PARTS, seed=2)
    parts: set[int] = set()
    for k in range(0, 100, 12):
        found = with_parts(tabletop[k])
        assert_same(found.select(found.part == Part.WHOLE), without(tabletop[k]))
        parts |= set(found.part.tolist())
    assert parts == set(range(5))


def test_equal_seeds_and_names_give_equal_parts_in_any_order(tabletop, assert_same):
    first, second = (SimulatedDetector(s, WITH_PARTS, seed=2) for s in (tabletop, subset(tabletop, stride=33)))
    forward = [first(tabletop[33 * k]) for k in range(3)]
    for k in (2, 0, 1):
        assert_same(second(subset(tabletop, stride=33)[k]), forward[k])
    other = SimulatedDetector(tabletop, WITH_PARTS, seed=3)(tabletop[0])
    assert len(other) != len(forward[0]) or not np.array_equal(other.xyxy, forward[0].xyxy)


def test_a_half_does_not_care_about_the_other(assert_same):
    free, hidden = run(OneCup(FREE), count=100), run(OneCup(RIGHT_HIDDEN), count=100)
    assert_same(of(Part.LEFT, hidden), of(Part.LEFT, free))
    assert len(of(Part.LEFT, hidden)) > 50 and len(of(Part.RIGHT, hidden)) == 0 < len(of(Part.RIGHT, free))
    assert 0 < len(of(Part.TOP, hidden)) < len(of(Part.TOP, free))


def test_halves_find_what_the_whole_template_misses():
    found = run(OneCup(BEHIND))
    whole, top, bottom, *_ = rates(found)
    assert top > 1.3 * whole > 0.1 and bottom == 0.0
    missed = np.array([Part.WHOLE not in d.part for d in found])
    only_half = np.mean([len(d) > 0 for d in np.array(found, dtype=object)[missed]])
    assert only_half > 0.3


def test_the_whole_template_is_the_best_of_what_is_in_sight():
    found = run(OneCup(FREE))
    whole, *halves = rates(found)
    assert min(halves) > 0.5 and max(halves) < whole - 0.05
    best, *others = (of(part, found) for part in Part)
    right = (best.class_id == 0).mean()
    for half in others:
        assert half.confidence.mean() < best.confidence.mean() - 0.05
        assert (half.class_id == 0).mean() < right


def test_the_halves_cut_along_the_longer_side_are_weaker():
    for xyxy, strips in ((TALL, [Part.LEFT, Part.RIGHT]), (WIDE, [Part.TOP, Part.BOTTOM])):
        rate = rates(run(OneCup(FREE, xyxy)))
        others = [part for part in list(Part)[1:] if part not in strips]
        assert rate[strips].max() < rate[others].min() - 0.05


def test_boxes_are_the_halves_with_noise_relative_to_their_own_extent():
    found = run(OneCup(FREE, TALL))
    for part in list(Part)[1:]:
        box = of(part, found).xyxy - 0.5
        target = part_box(np.array(TALL, dtype=float), part)
        np.testing.assert_allclose(box.mean(axis=0), target, atol=0.6)
        extent = np.tile(target[2:] - target[:2], 2)
        np.testing.assert_allclose(box.std(axis=0), QUIET.box_sigma * extent, rtol=0.25)


def test_what_is_hard_for_the_whole_is_hard_for_its_halves():
    clear = (0.4, 0.6, 0.5, 0.5, 0.5)
    gaps = {}
    for common in (0.0, 0.9):
        found = run(OneCup(clear), replace(QUIET, part_common=common), 1000)
        whole = np.array([Part.WHOLE in d.part for d in found])
        left = np.array([Part.LEFT in d.part for d in found])
        gaps[common] = left[whole].mean() - left[~whole].mean()
    assert abs(gaps[0.0]) < 0.12 and gaps[0.9] > 0.3


def test_halves_of_spots_are_found_less_often(tabletop):
    config = replace(WITH_PARTS, max_recall=0.0, chance_rate=0.0, background_spots=8, spot_chance=1.0, min_score=0.0)
    detector, counts, centres = SimulatedDetector(tabletop, config, seed=1), np.zeros(5), {p: [] for p in Part}
    spots = detector._known_spots()
    far = np.full((240, 320), 9.0, np.float32)
    for k in range(0, 100, 2):
        image = Frame(k, f"f{k}", 0.0, np.zeros((1, 1, 3), np.uint8), far, tabletop.intrinsics, tabletop.poses[k])
        found = detector(image)
        counts += np.bincount(found.part, minlength=5)
        boxes = [box for spot in spots if (box := spot.project(image)) is not None]
        for xyxy, part in zip(found.xyxy, found.part, strict=True):
            targets = np.clip(part_box(np.array(boxes), part), 0, [320, 240, 320, 240])
            extent = np.maximum(targets[:, 2:] - targets[:, :2], 1.0)
            centres[Part(part)].append((np.abs(targets - xyxy) / np.tile(extent, 2)).max(axis=1).min())
    assert counts[0] > 60 and np.all(counts[1:] < 0.75 * counts[0]) and np.all(counts[1:] > 0.25 * counts[0])
    assert all(np.median(errors) < 0.25 for errors in centres.values())


def test_false_detections_of_halves_are_more_frequent_and_lower():
    only_chance = replace(WITH_PARTS, max_recall=0.0, chance_rate=1.0, min_score=0.0)
    found = run(OneCup(FREE), only_chance, 500)
    whole, *halves = (of(part, found) for part in Part)
    assert len(whole) == pytest.approx(500, rel=0.15)
    for half in halves:
        assert len(half) == pytest.approx(1000, rel=0.15)
        assert half.scores.sum(axis=1).mean() < 0.95 * whole.scores.sum(axis=1).mean()
    assert not np.array_equal(halves[2].scores[:50], halves[3].scores[:50]), "each template errs on its own"
    wide, high = ((d.xyxy[:, 2:] - d.xyxy[:, :2]).mean(axis=0) for d in (halves[0], halves[2]))
    assert wide[0] > 1.5 * wide[1] and high[1] > 1.5 * high[0]


def test_parts_survive_being_written_and_read(tabletop, tmp_path: Path, assert_same):
    detector = make_detector("simulated?seed=1&parts=1", tabletop)
    found = {frame.name: detector(frame) for frame in (tabletop[k] for k in range(0, 40, 10))}
    path = tmp_path / "detections.json"
    write_detections(path, tabletop.classes, found.items())
    recorded = RecordedDetections(path)
    for k in range(0, 40, 10):
        assert_same(recorded(tabletop[k]), found[tabletop[k].name])
    assert any(np.any(d.part != Part.WHOLE) for d in found.values())


def test_the_option(tabletop):
    for spec, parts in (
        ("simulated", False),
        ("simulated?parts=0", False),
        ("simulated?parts=1&part_recall=0.5", True),
    ):
        detector = make_detector(spec, tabletop)
        assert isinstance(detector, SimulatedDetector) and detector.config.parts is parts
    for wrong in ("2", "yes", ""):
        with pytest.raises(UserError, match=f"parts={wrong} is not 0 or 1"):
            make_detector(f"simulated?parts={wrong}", tabletop)


@pytest.mark.parametrize(
    "change",
    [
        {"part_recall": 1.2}, {"part_score": 0.0}, {"part_side": 0.0}, {"part_strip": -0.1}, {"part_common": 1.1},
        {"part_confusion": float("nan")}, {"part_spots": -1.0}, {"part_chance": float("inf")},
    ],
)  # fmt: skip
def test_impossible_numbers_are_told(change: dict[str, float]):
    with pytest.raises(UserError, match=f"expected {next(iter(change))} from"):
        SimulatedDetectorConfig(**change)  # type: ignore[arg-type]

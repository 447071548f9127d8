"""A box before a wall, a half of it hidden, and a detector whose every box is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.truth import TrueObject
from thingmap.detectors.detections import Detections
from thingmap.mapper.learning.collecting import Collector
from thingmap.mapper.learning.known_scene import known_scene
from thingmap.mapper.learning.learn import collect_samples, learn

CAMERA = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
SIDE = 150.0 * 0.2 / 1.0  # px, of a ball of 0.2 m at 1 m, but for perspective
UP = np.array([0.0, -1.0, 0.0])


class Wall:
    """Four frames of a wall at 2 m with balls at 1 m; in frame 1 a board hides the left half, frame 3 is broken."""

    name, intrinsics, gravity, names = "wall", CAMERA, None, ("a", "b", "c", "d")
    stamps, poses = np.arange(4.0), np.tile(np.eye(4), (4, 1, 1))

    def __len__(self) -> int:
        return 4

    def __getitem__(self, index: int) -> Frame:
        if index == 3:
            raise BrokenFrame("d", FrameProblem.UNREADABLE)
        v, u = np.mgrid[:120, :160]
        depth = np.where(np.hypot(u - 79.5, v - 59.5) < SIDE / 2, 0.95, 2.0).astype(np.float32)
        if index == 1:
            depth[:, :80] = 0.5
        if index == 2:
            depth[:] = 0.0
        pose = None if self.poses is None else self.poses[index]
        return Frame(index, self.names[index], float(index), np.zeros((120, 160, 3), np.uint8), depth, CAMERA, pose)

    def __iter__(self):
        return (self[k] for k in range(4))


def ball(number: int = 0, label: str = "ball", x: float = 0.0) -> TrueObject:
    return TrueObject(number, label, np.array([x, 0.0, 1.0]), np.full(3, 0.2), 0.0)


def truth(*things: TrueObject, **changes) -> GroundTruth:
    return replace(GroundTruth("wall", ("ball",), things or (ball(),), up=UP), **changes)


def around(u: float, v: float, side: float = SIDE) -> list[float]:
    return [u + 0.5 - side / 2, v + 0.5 - side / 2, u + 0.5 + side / 2, v + 0.5 + side / 2]


def detect(frame: Frame) -> Detections:
    """The ball, something beside it, a second box on the ball, and a weak one."""
    boxes = [around(79.5, 59.5), around(20.0, 20.0), around(82.0, 59.5), around(120.0, 90.0)]
    return Detections(("Ball", "box"), boxes, [[0.8, 0.1], [0.05, 0.3], [0.6, 0.1], [0.05, 0.01]])


def test_samples_of_a_known_scene():
    collector = Collector()
    done = []
    collector.add_scene(known_scene(Wall(), truth(), "truth"), detect, done.append)
    samples, tally = collector.samples(), collector.tally
    assert done == [1, 2, 3, 4]
    assert (tally.frames, tally.detections, tally.weak, tally.duplicates, tally.no_depth) == (3, 9, 3, 3, 1)
    assert tally.skipped == {"unreadable image": ["d"]}
    assert samples.classes == ("Ball", "box")
    whole = samples.part == 0
    assert samples.class_id.tolist() == [0] * 10  # two frames, five templates
    assert samples.visible[whole] == pytest.approx([1.0, 0.5], abs=0.03)
    assert samples.visible[~whole] == pytest.approx([1, 1, 1, 1, 0.5, 0.5, 0, 1], abs=0.06)  # top, bottom, left, right
    assert samples.side_px[0] == pytest.approx(SIDE, rel=0.02)
    assert samples.found.tolist() == ([True] + [False] * 4) * 2
    assert samples.own_score[whole].tolist() == [0.8, 0.8]
    assert samples.false_scores.tolist() == [[0.05, 0.3]] * 3
    part, scores = samples.background()
    assert len(part) == len(scores) == 3


def test_what_is_not_known_is_left_out_and_said():
    unmeasured = replace(ball(1), size=np.full(3, np.nan))
    scene = known_scene(Wall(), truth(ball(), unmeasured, ball(2, "ghost", 0.3)), "truth")
    samples = collect_samples([(scene, detect)])
    assert samples.tally.unmeasured == {"ball": 1} and samples.tally.strangers == {"ghost": 1}
    assert samples.tally.incomplete == ["wall"]
    assert len(samples.false_part) == 0  # any of them may be the ball of unknown size
    assert set(samples.object_id) == {0}


def test_poses_of_the_truth_come_first_and_frames_without_are_skipped():
    moved = np.tile(np.eye(4), (2, 1, 1))
    moved[:, 0, 3] = 0.2
    moved[1] = np.nan
    sequence = Wall()
    sequence.poses = None
    known = truth(poses=moved, names=("a", "b"))
    samples = collect_samples([(known_scene(sequence, known, "truth"), detect)])
    assert samples.tally.skipped["no camera pose"] == ["b", "c"]
    assert samples.tally.frames == 1 and not samples.found.any()  # the ball is 30 px to the left of every box


def test_classes_of_several_sequences_are_joined():
    def other(frame: Frame) -> Detections:
        return Detections(("cup", "ball"), [around(79.5, 59.5)], [[0.2, 0.7]])

    scene = known_scene(Wall(), truth(), "truth")
    samples = collect_samples([(scene, detect), (scene, other)])
    assert samples.classes == ("Ball", "box", "cup")
    whole = samples.scores[(samples.part == 0) & samples.found]
    assert np.array_equal(whole[-1], [0.7, np.nan, 0.2], equal_nan=True)
    assert np.array_equal(whole[0], [0.8, 0.1, np.nan], equal_nan=True)
    assert samples.scene.tolist() == [0] * 10 + [1] * 10


def test_the_model_names_what_it_was_learned_from_and_is_the_same_again():
    scene = known_scene(Wall(), truth(), "truth")
    first, second = (learn(collect_samples([(scene, detect)]), "mine").model for _ in range(2))
    assert first.learned_from == "1 sequence (wall), 3 frames, detector mine"
    assert first.classes == ("Ball", "box") and first.existence == second.existence and first.background_size is None
    assert np.array_equal(first.scores.mean, second.scores.mean)
    assert np.array_equal(first.detection.intercept, second.detection.intercept)


@pytest.mark.parametrize(
    ("known", "part"),
    [
        (GroundTruth("wall", ("ball",), up=UP), "found no objects"),
        (truth(replace(ball(), position=np.full(3, np.nan))), "found 1 objects without it"),
        (truth(up=None), "which way is up"),
    ],
)
def test_truth_that_is_not_enough(known, part):
    with pytest.raises(UserError, match=part):
        known_scene(Wall(), known, "truth")


def test_no_poses():
    sequence = Wall()
    sequence.poses = None
    with pytest.raises(UserError, match="no camera poses"):
        known_scene(sequence, truth(), "truth")


@pytest.mark.parametrize(
    ("detector", "label", "part"),
    [
        (lambda frame: Detections.empty(("ball",)), "ball", "found nothing in 3 frames"),
        (lambda frame: detect(frame).select([3]), "ball", "but 3 below the least confidence"),
        (detect, "ghost", "objects without: ghost; the detector's classes: Ball, box"),
        (lambda frame: detect(frame).select([1]), "ball", "none of 3 detections shows an object"),
    ],
)
def test_nothing_to_learn_from(detector, label, part):
    scene = known_scene(Wall(), truth(ball(label=label)), "truth")
    with pytest.raises(UserError, match=part):
        learn(collect_samples([(scene, detector)]), "mine")

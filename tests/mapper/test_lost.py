"""A camera carried off or covered: its trajectory goes on in the same world, and nothing is mapped meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from thingmap.datasets.frame import BrokenFrame, Frame
from thingmap.datasets.synthetic.sample import open_sample
from thingmap.detectors.detections import Detections
from thingmap.detectors.spec import make_detector
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.mapper import SemanticMapper

from .lost_sequences import Cover, Spliced

STEP = 3  # frames of the sample between those shown
THERE = list(range(0, 150, STEP))
BACK = list(range(30, 75, STEP))  # 1.2 m and more from where the camera was taken away
JUMP = len(THERE)


@dataclass
class Run:
    """A mapper after a sequence: who was broken, and the distance of each live pose from the truth, metres."""

    mapper: SemanticMapper
    sequence: Spliced
    broken: list[int]
    errors: np.ndarray
    outcomes: dict[str, int]
    place: dict[str, int]

    def final_errors(self) -> np.ndarray:
        """(N,) metres, of the trajectory as known in the end, in the first camera's world."""
        stamps, poses = self.mapper.trajectory()
        positions = np.searchsorted(self.sequence.stamps, stamps - 1e-6)
        return _off(poses, np.array([self.sequence[int(i)].T_world_camera for i in positions]))


@pytest.fixture(scope="module")
def play() -> Callable[..., Run]:
    sample = open_sample("tabletop?frames=300&seed=1&width=320")
    frames: dict[int, Frame] = {}
    detect = make_detector("simulated?seed=1", sample)

    class Rendered(Sequence):
        def __len__(self) -> int:
            return len(sample)

        def __getitem__(self, index: int) -> Frame:
            if index not in frames:
                frames[index] = sample[index]
            return frames[index]

    def run(order: list[int], **splice) -> Run:
        sequence = Spliced(Rendered(), order, **splice)

        def detector(frame: Frame) -> Detections:
            if frame.index in sequence.covered:
                return Detections.empty(tuple(sample.classes))
            return detect(frames[order[frame.index]])

        config = MapperConfig()
        mapper = SemanticMapper(detector, replace(config, loops=replace(config.loops, process=False)))
        broken, live, truth = [], [], []
        for frame in sequence:
            try:
                live.append(mapper.process_frame(frame).T_world_camera)
                truth.append(frame.T_world_camera)
            except BrokenFrame:
                broken.append(frame.index)
        statistics = mapper.statistics()
        errors = _off(np.array(live), np.array(truth))
        return Run(mapper, sequence, broken, errors, statistics["outcomes"], statistics["place"])

    return run


def _off(poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(N,) metres between the positions of (N, 4, 4) poses, each in its own first camera's axes."""
    one, other = (np.linalg.inv(T[0]) @ T for T in (poses, truth))
    return np.linalg.norm(one[:, :3, 3] - other[:, :3, 3], axis=1)


def test_a_camera_carried_back_finds_its_place_and_maps_nothing_before(play):
    run = play(THERE + BACK)
    assert run.errors[JUMP] > 0.8  # nobody could know at once
    assert (run.errors[JUMP + 6 :] < 0.03).all()
    assert (run.final_errors() < 0.03).all()  # also of frames while it was lost, and just before
    assert run.place == {"lost": 1, "found": 1, "given_up": 0}
    assert run.outcomes["adrift"] > 0
    things = run.mapper.object_map().things
    apart = [np.linalg.norm(a.position - b.position) for a in things for b in things if a.id < b.id]
    assert len(things) > 3 and min(apart) > 0.03


def test_a_covered_lens_is_skipped_and_the_camera_found_elsewhere(play):
    covered = range(JUMP, JUMP + 10)
    run = play(THERE + [THERE[-1]] * 10 + BACK, covered=covered, cover=Cover.CAP)
    assert run.broken == list(covered)
    assert run.place == {"lost": 1, "found": 1, "given_up": 0}
    assert (run.final_errors() < 0.03).all()

"""`BatchMapper` from frames to a map, on a second of the rendered sample."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.synthetic.sample import open_sample
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.mapper.batch.batch_mapper import BatchMapper
from thingmap.mapper.config import MapperConfig, OdometryConfig, OdometrySource
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.records import NewLandmark
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.proposals.volumes import Volumes

GIVEN_POSES = MapperConfig(odometry=OdometryConfig(source=OdometrySource.POSES))
VIEWS = (0, 5, 9, 14, 19)


@pytest.fixture(scope="module")
def sequence():
    return open_sample("tabletop?frames=80&width=320")


@pytest.fixture(scope="module")
def frames(sequence):
    return [sequence[i] for i in range(0, 80, 4)]


def make(sequence, frames, views=VIEWS) -> BatchMapper:
    mapper = BatchMapper(SimulatedDetector(sequence), GIVEN_POSES, views=views, source="sample")
    for frame in frames:
        mapper.process_frame(frame)
    return mapper


@pytest.fixture(scope="module")
def mapper(sequence, frames) -> BatchMapper:
    """The whole second; treat as read-only."""
    return make(sequence, frames)


def as_text(object_map: ObjectMap) -> str:
    return json.dumps(
        [[t.id, t.label, t.probability, t.existence, t.position.tolist(), t.size.tolist()] for t in object_map.things]
    )


def test_it_finds_the_true_objects(mapper, sequence):
    object_map = mapper.object_map()
    places = np.array([o.position for o in sequence.objects])
    distance = np.linalg.norm(np.array([t.position for t in object_map.things])[:, None] - places[None], axis=2)
    nearest = [sequence.objects[j].label for j in distance.argmin(axis=1)]
    right = [thing.label == label for thing, label in zip(object_map.things, nearest, strict=True)]
    assert len(object_map) >= 6
    assert np.median(distance.min(axis=1)) < 0.04 and np.mean(right) > 0.6


def test_asking_twice_gives_the_same_map(mapper):
    assert as_text(mapper.object_map(True)) == as_text(mapper.object_map(True))


def test_nothing_is_lost_by_asking_early(mapper, sequence, frames):
    asked = make(sequence, frames[:8])
    early = asked.object_map(True)
    assert asked.statistics()["batch"]["views"] == 2 and len(early) > 0
    for frame in frames[8:]:
        asked.process_frame(frame)
    assert as_text(asked.object_map(True)) == as_text(mapper.object_map(True))
    np.testing.assert_array_equal(asked.trajectory()[1], mapper.trajectory()[1])
    assert asked.statistics()["outcomes"] == mapper.statistics()["outcomes"]


def test_views_are_keyframes_and_only_they_are_looked_at(sequence, frames):
    asked = []

    def detect(frame):
        asked.append(frame.index)
        return SimulatedDetector(sequence)(frame)

    still = [frames[0]] * 4  # the camera does not move: nothing else makes a keyframe
    mapper = BatchMapper(detect, GIVEN_POSES, views=[0, 2])
    updates = [mapper.process_frame(frame) for frame in still]
    assert [u.is_keyframe for u in updates] == [True, False, True, False]
    assert len(asked) == 2 and mapper.statistics()["keyframes"] == 2
    assert len(mapper.trajectory()[0]) == 4


def test_it_says_what_inference_did(mapper):
    mapper.object_map()
    batch = json.loads(json.dumps(mapper.statistics()))["batch"]
    assert batch["views"] == 5 and batch["samples"] == 300 and batch["sliding_volumes"] > 0
    assert batch["before_suppression"] >= batch["after_suppression"] >= batch["with_own_detections"] > 0
    assert 1 <= batch["iterations_median"] <= batch["iterations_most"] <= GIVEN_POSES.batch.max_iterations


def test_the_ledger_holds_the_landmarks(mapper, tmp_path):
    mapper.object_map()
    mapper.save_ledger(tmp_path / "ledger.npz")
    ledger, _ = Ledger.load(tmp_path / "ledger.npz")
    made = sum(isinstance(record, NewLandmark) for record in ledger)
    assert made == mapper.statistics()["batch"]["with_own_detections"]


def test_every_thing_was_measured(mapper):
    things = mapper.object_map(include_doubtful=True).things
    assert (
        len(things)
        <= mapper.statistics()["outcomes"]["promoted"]
        <= mapper.statistics()["batch"]["with_own_detections"]
    )
    assert max(np.sqrt(np.trace(t.position_covariance)) for t in things) < 1.0


def test_what_gets_no_detection_leaves(sequence, frames, monkeypatch):
    """A hypothesis behind everything that the cameras see."""
    mapper = make(sequence, frames)
    infer = mapper._infer_volumes

    def with_one_more():
        inference = infer()
        first = inference.volumes.select(np.array([0]))
        away = replace(first, position=first.position + 30.0)
        return replace(inference, volumes=Volumes.concatenate(inference.volumes, away))

    monkeypatch.setattr(mapper, "_infer_volumes", with_one_more)
    landmarks = mapper.landmarks(include_retired=True)
    assert landmarks and all(landmark.measurements > 0 for landmark in landmarks)


def test_without_views_there_is_an_empty_map(sequence, frames):
    mapper = make(sequence, frames[:3], views=())
    assert len(mapper.object_map(True)) == 0 and mapper.infer() is None
    assert mapper.statistics()["batch"] == {"views": 0}

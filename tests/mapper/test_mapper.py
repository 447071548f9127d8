"""`SemanticMapper` from frames to a map, on a second of the rendered sample."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from sample_maps import GIVEN_POSES, as_text, assert_readable, feed

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Detections
from thingmap.detectors.detector import find_nothing
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.mapper.config import LifecycleConfig, LoopConfig, MapperConfig
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.map.object_map import MapFrame
from thingmap.mapper.mapper import SemanticMapper


@pytest.fixture(scope="module")
def mapper(sample_frames, sample_detections) -> SemanticMapper:
    """The whole second; treat as read-only."""
    return feed(SemanticMapper(source="sample"), sample_frames, sample_detections)


def test_things_are_where_the_true_objects_are(mapper, sample):
    object_map = mapper.object_map()
    assert object_map.frame is MapFrame.FIRST_CAMERA and object_map.source == "sample"
    assert object_map.classes == sample.classes and len(object_map) >= 6
    T_map_world = np.linalg.inv(sample.poses[0])
    places = np.array([T_map_world[:3, :3] @ o.position + T_map_world[:3, 3] for o in sample.objects])
    gaps, right = [], []
    for thing in object_map.things:
        distance = np.linalg.norm(places - thing.position, axis=1)
        gaps.append(distance.min())
        right.append(sample.objects[int(distance.argmin())].label == thing.label)
    assert np.median(gaps) < 0.06 and np.mean(right) > 0.6
    assert object_map.up.direction @ (T_map_world[:3, :3] @ [0.0, 0.0, 1.0]) > np.cos(0.2)


def test_the_trajectory_follows_the_true_camera(mapper, sample, sample_frames):
    stamps, poses = mapper.trajectory()
    np.testing.assert_array_equal(stamps, [frame.stamp for frame in sample_frames])
    truth = np.linalg.inv(sample.poses[0]) @ sample.poses[[frame.index for frame in sample_frames]]
    assert np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max() < 0.05
    R = poses[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-6)


def test_every_frame_is_answered(sample_frames, sample_detections):
    mapper, updates = SemanticMapper(), []
    for frame, found in zip(sample_frames[:10], sample_detections, strict=False):
        updates.append(mapper.process_frame(frame, found))
    assert [u.frame_index for u in updates] == [frame.index for frame in sample_frames[:10]]
    assert updates[0].is_keyframe and updates[-1].things >= 1
    np.testing.assert_allclose(updates[0].T_world_camera, np.eye(4), atol=1e-5)
    assert 2 <= sum(u.is_keyframe for u in updates) < 10
    assert sum(u.is_keyframe for u in updates) == mapper.statistics()["keyframes"]
    # whoever asks for the path gets what is still being worked on as well: links that correct it a little
    np.testing.assert_allclose(mapper.trajectory()[1][-1], updates[-1].T_world_camera, atol=0.02)
    np.testing.assert_allclose(mapper.trajectory()[1][-1], mapper._camera.pose(), atol=1e-9)
    assert updates[-1].things == len(mapper.object_map())


def test_without_links_the_answer_is_the_last_pose_of_the_path(sample_frames, sample_detections):
    mapper = SemanticMapper(config=replace(MapperConfig(), loops=LoopConfig(enabled=False)))
    for frame, found in zip(sample_frames[:10], sample_detections, strict=False):
        update = mapper.process_frame(frame, found)
        # to what solving once more for the reader still changes
        np.testing.assert_allclose(mapper.trajectory()[1][-1], update.T_world_camera, atol=1e-4)


def test_a_detector_and_given_detections_are_alike(sample_frames, sample_detections, sample):
    with_detector, asked = SemanticMapper(SimulatedDetector(sample)), []

    def detect(frame: Frame) -> Detections:
        asked.append(frame.index)
        return SimulatedDetector(sample)(frame)

    counting = SemanticMapper(detect)
    for frame in sample_frames[:10]:
        with_detector.process_frame(frame)
        counting.process_frame(frame)
    given = feed(SemanticMapper(), sample_frames[:10], sample_detections[:10])
    assert as_text(with_detector.object_map()) == as_text(given.object_map()) == as_text(counting.object_map())
    assert len(asked) == counting.statistics()["keyframes"]  # and on no other frame


def test_the_same_input_gives_the_same_map_to_the_last_bit(mapper, sample_frames, sample_detections):
    again, other = (feed(SemanticMapper(source="sample"), sample_frames, sample_detections) for _ in range(2))
    things = again.object_map(True)
    assert len(things) > 0 and as_text(things) == as_text(other.object_map(True))
    mapper.object_map(True)  # which solves once more: the path is compared as readers find it
    np.testing.assert_array_equal(again.trajectory()[1], mapper.trajectory()[1])
    np.testing.assert_array_equal(again.cloud()[0], mapper.cloud()[0])


def test_the_map_says_what_the_graph_says(mapper, tmp_path):
    """The graph is rebuilt from what the mapper saved after it was read."""
    object_map = mapper.object_map()
    mapper.save_ledger(tmp_path / "ledger.npz")
    ledger, meta = Ledger.load(tmp_path / "ledger.npz")
    assert tuple(meta["classes"]) == object_map.classes
    smoother = Smoother.from_ledger(ledger, mapper.config.smoother, Intrinsics(**meta["intrinsics"]))
    assert smoother.keyframes == mapper.statistics()["keyframes"]
    assert smoother.up()[0] @ object_map.up.direction > np.cos(0.01)
    np.testing.assert_allclose(smoother.pose(smoother.keyframes - 1), mapper._camera.smoother.poses()[-1], atol=0.01)
    for thing in object_map.things:
        number = int(thing.id.removeprefix("thing-"))
        np.testing.assert_allclose(smoother.position(number), thing.position, atol=0.01)
        off = np.abs(np.log(thing.size / 2.0) - smoother.log_size(number))
        assert (off < np.maximum(0.15, thing.size_std / thing.size)).all()  # seen once, a size is nearly free


def test_reading_the_map_again_gives_the_same_map(sample_frames, sample_detections):
    mapper = feed(SemanticMapper(), sample_frames, sample_detections)
    maps = [mapper.object_map(include_doubtful=True) for _ in range(3)]
    for again in maps[1:]:
        for a, b in zip(maps[0].things, again.things, strict=True):
            assert a.existence == pytest.approx(b.existence, abs=0.01)
            assert a.belief(a.label) == pytest.approx(b.belief(a.label), abs=0.02)
            np.testing.assert_allclose(a.position, b.position, atol=0.002)
            np.testing.assert_allclose(a.size, b.size, rtol=0.03)
            np.testing.assert_allclose(a.size_std, b.size_std, rtol=0.1)


def test_doubtful_things_are_those_that_hardly_exist(sample_frames, sample_detections):
    careful = replace(MapperConfig(), lifecycle=LifecycleConfig(retire_below=0.4, retire_views=0.5))
    mapper = feed(SemanticMapper(config=careful), sample_frames, sample_detections)
    sure, all_of_them = mapper.object_map(), mapper.object_map(include_doubtful=True)
    assert {t.id for t in sure.things} == {t.id for t in all_of_them.things if t.existence >= 0.5}
    statistics = mapper.statistics()
    assert len(all_of_them) == statistics["landmarks"] + statistics["retired"]
    assert statistics["retired"] >= 1


def test_statistics_are_plain_and_add_up(mapper):
    mapper.object_map()
    statistics = json.loads(json.dumps(mapper.statistics()))
    outcomes = statistics["outcomes"]
    assert outcomes["promoted"] == statistics["landmarks"] + statistics["retired"] + outcomes["merged"]
    ended = outcomes["promoted"] + outcomes["rejected_missed"] + outcomes["rejected_free_space"]
    assert outcomes["new_track"] == ended + statistics["candidates"]
    assert outcomes["supported"] >= outcomes["associated"]
    stages = statistics["stages"]
    assert stages["odometry"]["count"] == 20 and stages["keyframe"]["count"] == statistics["keyframes"]
    # a keyframe is solved once; the end, when what is still being worked on comes in, once more
    assert stages["smoothing"]["count"] in (statistics["keyframes"], statistics["keyframes"] + 1)
    assert all(s["total_s"] >= 0.0 for s in stages.values())
    assert statistics["ledger_records"] > 50


def test_given_poses_and_gravity_make_the_dataset_s_world(sample, sample_frames, sample_detections):
    down = np.array([0.0, 0.0, -1.0])
    mapper = feed(SemanticMapper(config=GIVEN_POSES, gravity=down), sample_frames, sample_detections)
    object_map = mapper.object_map()
    assert object_map.frame is MapFrame.DATASET and object_map.up.source == "gravity file"
    assert object_map.up.direction @ [0.0, 0.0, 1.0] > np.cos(0.02)
    truth = sample.poses[[frame.index for frame in sample_frames]]
    np.testing.assert_allclose(mapper.trajectory()[1][:, :3, 3], truth[:, :3, 3], atol=0.02)
    places = np.array([o.position for o in sample.objects])
    gaps = [np.linalg.norm(places - thing.position, axis=1).min() for thing in object_map.things]
    assert len(gaps) >= 6 and np.median(gaps) < 0.06


def test_a_mapper_without_frames_is_an_empty_map(tmp_path):
    mapper = SemanticMapper(source="nothing")
    object_map = mapper.object_map()
    assert len(object_map) == 0 and object_map.classes == () and object_map.up.source == "camera prior"
    stamps, poses = mapper.trajectory()
    assert stamps.shape == (0,) and poses.shape == (0, 4, 4)
    points, colors = mapper.cloud()
    assert points.shape == colors.shape == (0, 3)
    assert mapper.statistics()["keyframes"] == 0
    assert_readable(mapper)


def test_a_detector_that_finds_nothing_still_gives_a_trajectory(sample_frames):
    mapper = SemanticMapper(find_nothing)
    for frame in sample_frames[:10]:
        assert mapper.process_frame(frame).things == 0
    assert len(mapper.object_map()) == 0
    assert len(mapper.trajectory()[0]) == 10 and len(mapper.cloud()[0]) > 1000
    assert_readable(mapper)

"""`SemanticMapper` from frames to a map, on a second of the rendered sample."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.synthetic.sample import TabletopSequence, open_sample
from thingmap.detectors.detections import Detections
from thingmap.detectors.detector import find_nothing
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.mapper.config import LifecycleConfig, LoopConfig, MapperConfig, OdometryConfig, OdometrySource
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.mapper import SemanticMapper

GIVEN_POSES = MapperConfig(odometry=OdometryConfig(source=OdometrySource.POSES))


@pytest.fixture(scope="module")
def sequence() -> TabletopSequence:
    return open_sample("tabletop?frames=80&width=320")


@pytest.fixture(scope="module")
def frames(sequence) -> list[Frame]:
    return [sequence[i] for i in range(0, 80, 4)]


@pytest.fixture(scope="module")
def detections(sequence, frames) -> list[Detections]:
    detector = SimulatedDetector(sequence)
    return [detector(frame) for frame in frames]


def feed(mapper: SemanticMapper, frames: Iterable[Frame], detections: Iterable[Detections]) -> SemanticMapper:
    for frame, found in zip(frames, detections, strict=True):
        mapper.process_frame(frame, found)
    return mapper


@pytest.fixture(scope="module")
def mapper(frames, detections) -> SemanticMapper:
    """The whole second; treat as read-only."""
    return feed(SemanticMapper(source="sample"), frames, detections)


@pytest.fixture
def half(frames, detections) -> SemanticMapper:
    """The first ten frames, to go on from."""
    return feed(SemanticMapper(), frames[:10], detections[:10])


def as_text(object_map: ObjectMap) -> str:
    """Everything that a map says, to the last bit."""
    things = [
        [t.id, t.label, t.probability, t.existence, dict(t.class_posterior), t.first_seen, t.last_seen, str(t.evidence)]
        + [a.tolist() for a in (t.position, t.position_covariance, t.size, t.size_std)]
        for t in object_map.things
    ]
    return json.dumps([things, object_map.classes, object_map.source, str(object_map.frame), str(object_map.up)])


def assert_readable(mapper: SemanticMapper) -> None:
    """Every question gets an answer."""
    mapper.object_map(include_doubtful=True)
    stamps, poses = mapper.trajectory()
    assert len(stamps) == len(poses)
    mapper.cloud()
    json.dumps(mapper.statistics())


def other_classes() -> Detections:
    return Detections.from_best_class(("zebra", "giraffe"), np.array([[100.0, 60.0, 160.0, 120.0]]), [0], [0.9])


# -- what it finds


def test_things_are_where_the_true_objects_are(mapper, sequence):
    object_map = mapper.object_map()
    assert object_map.frame is MapFrame.FIRST_CAMERA and object_map.source == "sample"
    assert object_map.classes == sequence.classes and len(object_map) >= 6
    T_map_world = np.linalg.inv(sequence.poses[0])
    places = np.array([T_map_world[:3, :3] @ o.position + T_map_world[:3, 3] for o in sequence.objects])
    gaps, right = [], []
    for thing in object_map.things:
        distance = np.linalg.norm(places - thing.position, axis=1)
        gaps.append(distance.min())
        right.append(sequence.objects[int(distance.argmin())].label == thing.label)
    assert np.median(gaps) < 0.06 and np.mean(right) > 0.6
    assert object_map.up.direction @ (T_map_world[:3, :3] @ [0.0, 0.0, 1.0]) > np.cos(0.2)


def test_the_trajectory_follows_the_true_camera(mapper, sequence, frames):
    stamps, poses = mapper.trajectory()
    np.testing.assert_array_equal(stamps, [frame.stamp for frame in frames])
    truth = np.linalg.inv(sequence.poses[0]) @ sequence.poses[[frame.index for frame in frames]]
    assert np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max() < 0.05
    R = poses[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-6)


def test_every_frame_is_answered(frames, detections):
    mapper, updates = SemanticMapper(), []
    for frame, found in zip(frames[:10], detections, strict=False):
        updates.append(mapper.process_frame(frame, found))
    assert [u.frame_index for u in updates] == [frame.index for frame in frames[:10]]
    assert updates[0].is_keyframe and updates[-1].things >= 1
    np.testing.assert_allclose(updates[0].T_world_camera, np.eye(4), atol=1e-5)
    assert 2 <= sum(u.is_keyframe for u in updates) < 10
    assert sum(u.is_keyframe for u in updates) == mapper.statistics()["keyframes"]
    # whoever asks for the path gets what is still being worked on as well: links that correct it a little
    np.testing.assert_allclose(mapper.trajectory()[1][-1], updates[-1].T_world_camera, atol=0.02)
    np.testing.assert_allclose(mapper.trajectory()[1][-1], mapper._camera.pose(), atol=1e-9)
    assert updates[-1].things == len(mapper.object_map())


def test_without_links_the_answer_is_the_last_pose_of_the_path(frames, detections):
    mapper = SemanticMapper(config=replace(MapperConfig(), loops=LoopConfig(enabled=False)))
    for frame, found in zip(frames[:10], detections, strict=False):
        update = mapper.process_frame(frame, found)
        # to what solving once more for the reader still changes
        np.testing.assert_allclose(mapper.trajectory()[1][-1], update.T_world_camera, atol=1e-4)


def test_a_detector_and_given_detections_are_alike(frames, detections, sequence):
    with_detector, asked = SemanticMapper(SimulatedDetector(sequence)), []

    def detect(frame: Frame) -> Detections:
        asked.append(frame.index)
        return SimulatedDetector(sequence)(frame)

    counting = SemanticMapper(detect)
    for frame in frames[:10]:
        with_detector.process_frame(frame)
        counting.process_frame(frame)
    given = feed(SemanticMapper(), frames[:10], detections[:10])
    assert as_text(with_detector.object_map()) == as_text(given.object_map()) == as_text(counting.object_map())
    assert len(asked) == counting.statistics()["keyframes"]  # and on no other frame


def test_the_same_input_gives_the_same_map_to_the_last_bit(mapper, frames, detections):
    again = feed(SemanticMapper(source="sample"), frames, detections)
    one, other = again.object_map(True), feed(SemanticMapper(source="sample"), frames, detections).object_map(True)
    assert len(one) > 0 and as_text(one) == as_text(other)
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


def test_reading_the_map_again_gives_the_same_map(frames, detections):
    mapper = feed(SemanticMapper(), frames, detections)
    maps = [mapper.object_map(include_doubtful=True) for _ in range(3)]
    for again in maps[1:]:
        for a, b in zip(maps[0].things, again.things, strict=True):
            assert a.existence == pytest.approx(b.existence, abs=0.01)
            assert a.belief(a.label) == pytest.approx(b.belief(a.label), abs=0.02)
            np.testing.assert_allclose(a.position, b.position, atol=0.002)
            np.testing.assert_allclose(a.size, b.size, rtol=0.03)
            np.testing.assert_allclose(a.size_std, b.size_std, rtol=0.1)


def test_doubtful_things_are_those_that_hardly_exist(frames, detections):
    careful = replace(MapperConfig(), lifecycle=LifecycleConfig(retire_below=0.4, retire_views=0.5))
    mapper = feed(SemanticMapper(config=careful), frames, detections)
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


def test_given_poses_and_gravity_make_the_dataset_s_world(sequence, frames, detections):
    mapper = feed(SemanticMapper(config=GIVEN_POSES, gravity=np.array([0.0, 0.0, -1.0])), frames, detections)
    object_map = mapper.object_map()
    assert object_map.frame is MapFrame.DATASET and object_map.up.source == "gravity file"
    assert object_map.up.direction @ [0.0, 0.0, 1.0] > np.cos(0.02)
    truth = sequence.poses[[frame.index for frame in frames]]
    np.testing.assert_allclose(mapper.trajectory()[1][:, :3, 3], truth[:, :3, 3], atol=0.02)
    places = np.array([o.position for o in sequence.objects])
    gaps = [np.linalg.norm(places - thing.position, axis=1).min() for thing in object_map.things]
    assert len(gaps) >= 6 and np.median(gaps) < 0.06


# -- before there is anything


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


def test_a_detector_that_finds_nothing_still_gives_a_trajectory(frames):
    mapper = SemanticMapper(find_nothing)
    for frame in frames[:10]:
        assert mapper.process_frame(frame).things == 0
    assert len(mapper.object_map()) == 0
    assert len(mapper.trajectory()[0]) == 10 and len(mapper.cloud()[0]) > 1000
    assert_readable(mapper)


# -- mistakes


def test_without_detector_and_detections_nothing_can_be_mapped(frames, detections):
    mapper = SemanticMapper()
    with pytest.raises(UserError, match="detector"):
        mapper.process_frame(frames[0])
    assert_readable(mapper)
    assert mapper.statistics()["keyframes"] == 0


def test_the_first_frame_can_be_given_again_with_detections(frames, detections):
    mapper = SemanticMapper()
    with pytest.raises(UserError):
        mapper.process_frame(frames[0])
    assert mapper.process_frame(frames[0], detections[0]).is_keyframe
    feed(mapper, frames[1:10], detections[1:10])
    assert len(mapper.object_map()) > 0


def test_other_classes_half_way_are_refused_and_the_map_goes_on(half, frames, detections):
    before, keyframes = half.object_map(), half.statistics()["keyframes"]
    refused = 0
    for frame in frames[10:15]:
        try:
            half.process_frame(frame, other_classes())
        except UserError as error:
            refused += 1
            assert frame.name in str(error) and "classes" in str(error)
    assert refused >= 1
    assert half.statistics()["keyframes"] == keyframes and half.object_map().classes == before.classes
    assert {t.id for t in half.object_map().things} == {t.id for t in before.things}
    assert_readable(half)
    feed(half, frames[15:], detections[15:])
    assert half.statistics()["keyframes"] > keyframes
    assert len(half.object_map()) >= len(before)


def test_a_detector_that_fails_once_leaves_the_mapper_whole(frames, sequence):
    detector, failed = SimulatedDetector(sequence), []

    def flaky(frame: Frame) -> Detections:
        if frame.index >= 40 and not failed:
            failed.append(frame.index)
            raise MemoryError("the network does not fit")
        return detector(frame)

    mapper = SemanticMapper(flaky)
    for frame in frames:
        try:
            mapper.process_frame(frame)
        except MemoryError:
            assert_readable(mapper)
    assert failed and len(mapper.object_map()) >= 6
    stamps, poses = mapper.trajectory()
    truth = np.linalg.inv(sequence.poses[0]) @ sequence.poses[np.rint(stamps * 30.0).astype(int)]
    assert np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max() < 0.05


def test_a_broken_frame_leaves_the_map_as_it_was(half, frames, detections):
    twin = feed(SemanticMapper(), frames[:10], detections[:10])
    blind = replace(frames[10], depth=np.zeros_like(frames[10].depth))
    for _ in range(3):
        with pytest.raises(BrokenFrame) as caught:
            half.process_frame(blind, detections[10])
        assert caught.value.problem is FrameProblem.NO_DEPTH and caught.value.name == frames[10].name
    for each in (half, twin):  # both are read: what is still being worked on comes in then
        assert len(each.trajectory()[0]) == 10
        feed(each, frames[10:], detections[10:])
    assert as_text(half.object_map(True)) == as_text(twin.object_map(True))
    np.testing.assert_array_equal(half.trajectory()[1], twin.trajectory()[1])


def test_a_first_frame_that_is_broken_does_not_count(frames, detections):
    mapper = SemanticMapper()
    with pytest.raises(BrokenFrame):
        mapper.process_frame(replace(frames[0], depth=np.zeros_like(frames[0].depth)), detections[0])
    assert_readable(mapper)
    assert mapper.process_frame(frames[0], detections[0]).is_keyframe


def test_given_poses_must_be_there(frames, detections):
    mapper = SemanticMapper(config=GIVEN_POSES)
    mapper.process_frame(frames[0], detections[0])
    with pytest.raises(BrokenFrame) as caught:
        mapper.process_frame(replace(frames[1], T_world_camera=None), detections[1])
    assert caught.value.problem is FrameProblem.MISSING_POSE
    mapper.process_frame(frames[1], detections[1])
    assert len(mapper.trajectory()[0]) == 2


def test_a_missing_file_of_class_sizes_is_named_and_breaks_nothing(frames, detections, tmp_path):
    mapper = SemanticMapper(config=MapperConfig(class_sizes=str(tmp_path / "sizes.yaml")))
    with pytest.raises(InputError, match=r"sizes\.yaml"):
        mapper.process_frame(frames[0], detections[0])
    assert_readable(mapper)


def test_a_frame_of_another_camera_is_refused(half, frames, detections):
    other = open_sample("tabletop?frames=41&width=640")[40]
    before = half.object_map()
    with pytest.raises((BrokenFrame, UserError)):
        half.process_frame(other, detections[10])
    assert as_text(half.object_map()) == as_text(before)


def test_boxes_that_mean_nothing_do_no_harm(frames, detections):
    """Boxes without depth, of no size, beyond the image or far below the threshold among the good ones."""
    mapper = SemanticMapper()
    for frame, found in zip(frames, detections, strict=True):
        boxes = np.array([[5.0, 5, 5, 5], [-90, 10, -50, 40], [400, 300, 410, 310], [0, 0, 320, 240]])
        scores = np.full((4, len(found.classes)), 0.3)
        scores[3] = 0.01
        mapper.process_frame(frame, Detections.concatenate([found, Detections(found.classes, boxes, scores)]))
    plain = feed(SemanticMapper(), frames, detections)
    assert as_text(mapper.object_map(True)) == as_text(plain.object_map(True))
    outcomes = mapper.statistics()["outcomes"]
    assert outcomes["low_confidence"] >= 1 and outcomes["no_depth"] >= 3

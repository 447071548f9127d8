"""`SemanticMapper` given what it cannot take: it says so, and the map stays whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sample_maps import GIVEN_POSES, as_text, assert_readable, feed

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem
from thingmap.datasets.synthetic.sample import open_sample
from thingmap.detectors.detections import Detections
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.mapper import SemanticMapper


@pytest.fixture
def half(sample_frames, sample_detections) -> SemanticMapper:
    """The first ten frames, to go on from."""
    return feed(SemanticMapper(), sample_frames[:10], sample_detections[:10])


def other_classes() -> Detections:
    return Detections.from_best_class(("zebra", "giraffe"), np.array([[100.0, 60.0, 160.0, 120.0]]), [0], [0.9])


def test_without_detector_and_detections_nothing_can_be_mapped(sample_frames, sample_detections):
    mapper = SemanticMapper()
    with pytest.raises(UserError, match="detector"):
        mapper.process_frame(sample_frames[0])
    assert_readable(mapper)
    assert mapper.statistics()["keyframes"] == 0


def test_the_first_frame_can_be_given_again_with_detections(sample_frames, sample_detections):
    mapper = SemanticMapper()
    with pytest.raises(UserError):
        mapper.process_frame(sample_frames[0])
    assert mapper.process_frame(sample_frames[0], sample_detections[0]).is_keyframe
    feed(mapper, sample_frames[1:10], sample_detections[1:10])
    assert len(mapper.object_map()) > 0


def test_other_classes_half_way_are_refused_and_the_map_goes_on(half, sample_frames, sample_detections):
    before, keyframes = half.object_map(), half.statistics()["keyframes"]
    refused = 0
    for frame in sample_frames[10:15]:
        try:
            half.process_frame(frame, other_classes())
        except UserError as error:
            refused += 1
            assert frame.name in str(error) and "classes" in str(error)
    assert refused >= 1
    assert half.statistics()["keyframes"] == keyframes and half.object_map().classes == before.classes
    assert {t.id for t in half.object_map().things} == {t.id for t in before.things}
    assert_readable(half)
    feed(half, sample_frames[15:], sample_detections[15:])
    assert half.statistics()["keyframes"] > keyframes
    assert len(half.object_map()) >= len(before)


def test_embeddings_of_another_length_are_refused_before_the_map_changes(sample_frames, sample_detections):
    def with_embeddings(found: Detections, length: int) -> Detections:
        return replace(found, embedding=np.ones((len(found), length), dtype=np.float32))

    mapper = SemanticMapper(None, GIVEN_POSES, source="sample")
    for frame, found in zip(sample_frames[:8], sample_detections[:8], strict=True):
        mapper.process_frame(frame, with_embeddings(found, 4))
    keyframes = mapper.statistics()["keyframes"]
    refused = 0
    for frame, found in zip(sample_frames[8:16], sample_detections[8:16], strict=True):
        try:
            mapper.process_frame(frame, with_embeddings(found, 3))
        except UserError as error:
            refused += 1
            assert frame.name in str(error) and "4" in str(error) and "3" in str(error)
    assert refused >= 1 and mapper.statistics()["keyframes"] == keyframes
    things = mapper.object_map().things
    assert things and all(thing.embedding is not None and thing.embedding.shape == (4,) for thing in things)


def test_a_detector_that_fails_once_leaves_the_mapper_whole(sample_frames, sample):
    detector, failed = SimulatedDetector(sample), []

    def flaky(frame: Frame) -> Detections:
        if frame.index >= 40 and not failed:
            failed.append(frame.index)
            raise MemoryError("the network does not fit")
        return detector(frame)

    mapper = SemanticMapper(flaky)
    for frame in sample_frames:
        try:
            mapper.process_frame(frame)
        except MemoryError:
            assert_readable(mapper)
    assert failed and len(mapper.object_map()) >= 6
    stamps, poses = mapper.trajectory()
    truth = np.linalg.inv(sample.poses[0]) @ sample.poses[np.rint(stamps * 30.0).astype(int)]
    assert np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max() < 0.05


def test_a_broken_frame_leaves_the_map_as_it_was(half, sample_frames, sample_detections):
    twin = feed(SemanticMapper(), sample_frames[:10], sample_detections[:10])
    blind = replace(sample_frames[10], depth=np.zeros_like(sample_frames[10].depth))
    for _ in range(3):
        with pytest.raises(BrokenFrame) as caught:
            half.process_frame(blind, sample_detections[10])
        assert caught.value.problem is FrameProblem.NO_DEPTH and caught.value.name == sample_frames[10].name
    for each in (half, twin):  # both are read: what is still being worked on comes in then
        assert len(each.trajectory()[0]) == 10
        feed(each, sample_frames[10:], sample_detections[10:])
    assert as_text(half.object_map(True)) == as_text(twin.object_map(True))
    np.testing.assert_array_equal(half.trajectory()[1], twin.trajectory()[1])


def test_a_first_frame_that_is_broken_does_not_count(sample_frames, sample_detections):
    mapper = SemanticMapper()
    blind = replace(sample_frames[0], depth=np.zeros_like(sample_frames[0].depth))
    with pytest.raises(BrokenFrame):
        mapper.process_frame(blind, sample_detections[0])
    assert_readable(mapper)
    assert mapper.process_frame(sample_frames[0], sample_detections[0]).is_keyframe


def test_given_poses_must_be_there(sample_frames, sample_detections):
    mapper = SemanticMapper(config=GIVEN_POSES)
    mapper.process_frame(sample_frames[0], sample_detections[0])
    with pytest.raises(BrokenFrame) as caught:
        mapper.process_frame(replace(sample_frames[1], T_world_camera=None), sample_detections[1])
    assert caught.value.problem is FrameProblem.MISSING_POSE
    mapper.process_frame(sample_frames[1], sample_detections[1])
    assert len(mapper.trajectory()[0]) == 2


def test_a_missing_file_of_class_sizes_is_named_and_breaks_nothing(sample_frames, sample_detections, tmp_path):
    mapper = SemanticMapper(config=MapperConfig(class_sizes=str(tmp_path / "sizes.yaml")))
    with pytest.raises(InputError, match=r"sizes\.yaml"):
        mapper.process_frame(sample_frames[0], sample_detections[0])
    assert_readable(mapper)


def test_a_frame_of_another_camera_is_refused(half, sample_frames, sample_detections):
    other = open_sample("tabletop?frames=41&width=640")[40]
    before = half.object_map()
    with pytest.raises((BrokenFrame, UserError)):
        half.process_frame(other, sample_detections[10])
    assert as_text(half.object_map()) == as_text(before)


def test_boxes_that_mean_nothing_do_no_harm(sample_frames, sample_detections):
    """Boxes without depth, of no size, beyond the image or far below the threshold among the good ones."""
    mapper = SemanticMapper()
    for frame, found in zip(sample_frames, sample_detections, strict=True):
        boxes = np.array([[5.0, 5, 5, 5], [-90, 10, -50, 40], [400, 300, 410, 310], [0, 0, 320, 240]])
        scores = np.full((4, len(found.classes)), 0.3)
        scores[3] = 0.01
        mapper.process_frame(frame, Detections.concatenate([found, Detections(found.classes, boxes, scores)]))
    plain = feed(SemanticMapper(), sample_frames, sample_detections)
    assert as_text(mapper.object_map(True)) == as_text(plain.object_map(True))
    outcomes = mapper.statistics()["outcomes"]
    assert outcomes["low_confidence"] >= 1 and outcomes["no_depth"] >= 3

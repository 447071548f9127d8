"""Common frames and common axes: found where they are, refused with the differences where they are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import UserError
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.inputs.frames import align, common_frames
from thingmap.mapper.map.object_map import MapFrame

CONFIG = EvaluationConfig()


def in_dataset_axes(run, poses):
    return replace(run, poses=poses, object_map=replace(run.object_map, frame=MapFrame.DATASET))


def aligned(run, truth):
    return align(run, truth, *common_frames(run, truth, CONFIG))


def test_frames_are_paired_by_their_stamps(scene_truth, perfect_run) -> None:
    run = perfect_run(scene_truth)
    some = np.array([3, 10, 11, 39])
    run = replace(run, stamps=run.stamps[some] + np.array([0.009, -0.009, 0.0, 0.02]), poses=run.poses[some])
    in_truth, in_run = common_frames(run, scene_truth, CONFIG)
    assert in_truth.tolist() == [3, 10, 11] and in_run.tolist() == [0, 1, 2]


def test_no_common_frame_tells_both_ranges(scene_truth, perfect_run) -> None:
    run = perfect_run(scene_truth)
    with pytest.raises(UserError, match=r"40 frames from 0\.000 to 3\.900 s.*40 frames from 100\.000 to 103\.900 s"):
        common_frames(replace(run, stamps=run.stamps - 100.0), scene_truth, CONFIG)


def test_a_truth_without_frames_has_none_in_common(scene_truth, perfect_run) -> None:
    truth = replace(scene_truth, stamps=np.empty(0), poses=None, names=())
    assert [len(index) for index in common_frames(perfect_run(scene_truth), truth, CONFIG)] == [0, 0]


def test_a_map_in_its_own_axes_is_moved_to_the_truth(scene_truth, perfect_run) -> None:
    run = perfect_run(scene_truth)
    for alignment in aligned(run, scene_truth):
        np.testing.assert_allclose(alignment.pose(run.poses), scene_truth.poses, atol=1e-9)


def test_an_early_error_moves_the_anchor_but_hardly_the_alignment(scene_truth, perfect_run) -> None:
    run = perfect_run(scene_truth)
    poses = run.poses.copy()
    poses[0, :3, 3] += [0.1, 0.0, 0.0]
    alignment, anchored = aligned(replace(run, poses=poses), scene_truth)
    true = scene_truth.objects[0].position
    assert np.linalg.norm(alignment.apply(run.object_map.things[0].position) - true) == pytest.approx(0.1 / 40)
    assert np.linalg.norm(anchored.apply(run.object_map.things[0].position) - true) == pytest.approx(0.1)


def test_frames_without_a_true_pose_do_not_align(scene_truth, perfect_run) -> None:
    run, poses = perfect_run(scene_truth), scene_truth.poses.copy()
    poses[:20] = np.nan
    alignment, anchored = aligned(run, replace(scene_truth, poses=poses))
    np.testing.assert_allclose(alignment.pose(run.poses)[20:], poses[20:], atol=1e-9)
    np.testing.assert_allclose(anchored.pose(run.poses)[20:], poses[20:], atol=1e-9)


def test_a_map_in_the_axes_of_the_dataset_stays_where_it_is(scene_truth, perfect_run) -> None:
    poses = scene_truth.poses.copy()
    poses[:, 0, 3] += 0.05
    alignment, anchored = aligned(in_dataset_axes(perfect_run(scene_truth), poses), scene_truth)
    for same in (alignment, anchored):
        np.testing.assert_array_equal(same.R, np.eye(3))
        np.testing.assert_array_equal(same.t, np.zeros(3))
    assert "dataset" in alignment.method


def test_another_world_is_refused_with_the_differences(scene_truth, perfect_run) -> None:
    run, motion = perfect_run(scene_truth), np.eye(4)
    motion[:3, 3] = [0.0, 3.0, 4.0]
    with pytest.raises(UserError, match=r"another world.*5\.00 m and 0 degrees"):
        aligned(in_dataset_axes(run, motion @ scene_truth.poses), scene_truth)
    turned = scene_truth.poses.copy()
    turned[:, :3, :3] = turned[:, :3, :3] @ Rotation.from_rotvec([0.0, 0.0, np.pi / 2]).as_matrix()
    with pytest.raises(UserError, match=r"0\.00 m and 90 degrees"):
        aligned(in_dataset_axes(run, turned), scene_truth)


def of_sequence(truth, name: str):
    """The truth as that of a sequence of this name."""
    return replace(truth, name=name, sequence=object())


def test_a_map_of_another_sequence_must_fit_its_path(scene_truth, perfect_run) -> None:
    """The middle camera is a metre off once the path is aligned: the same scene mapped badly, or another scene."""
    run = perfect_run(scene_truth)  # made of "eight boxes"
    lost = run.poses.copy()
    lost[::2, :3, 3] += [2.0, 0.0, 0.0]
    with pytest.raises(UserError, match=r"made of eight boxes, not of kitchen.*1\.00 m and 0 degrees.*0\.5 m"):
        aligned(replace(run, poses=lost), of_sequence(scene_truth, "kitchen"))
    for truth in (of_sequence(scene_truth, "eight boxes"), replace(scene_truth, name="groundtruth.txt")):
        aligned(replace(run, poses=lost), truth)  # to be measured, not refused
    aligned(run, of_sequence(scene_truth, "kitchen"))


def test_without_true_poses_only_a_map_in_the_axes_of_the_dataset_can_be_judged(scene_truth, perfect_run) -> None:
    run, truth = perfect_run(scene_truth), replace(scene_truth, poses=None)
    with pytest.raises(UserError, match=r"first camera.*--odometry poses"):
        aligned(run, truth)
    no_frames = replace(truth, stamps=np.empty(0))
    np.testing.assert_array_equal(aligned(in_dataset_axes(run, scene_truth.poses), no_frames)[0].R, np.eye(3))


def test_a_truth_of_images_alone_needs_no_axes(scene_truth, perfect_run) -> None:
    nowhere = tuple(replace(thing, position=np.full(3, np.nan)) for thing in scene_truth.objects)
    truth = replace(scene_truth, poses=None, objects=nowhere, point_truth=None)
    alignment, _ = aligned(perfect_run(scene_truth), truth)
    assert "images only" in alignment.method

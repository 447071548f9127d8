"""The loaders against real recordings: what is known of the scenes must come out of the files."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from thingmap.datasets.box_truth import read_boxes_tsv
from thingmap.datasets.frame import Frame
from thingmap.datasets.open import open_sequence
from thingmap.datasets.poses import read_pose_rows
from thingmap.datasets.recorded import RecordedSequence
from thingmap.datasets.rgbd_scenes_v2 import CLASSES, RgbdScenesV2


def camera_points(frame: Frame, step: int = 4) -> np.ndarray:
    """(N, 3) every `step`-th pixel with a depth, camera frame."""
    v, u = np.mgrid[0 : frame.depth.shape[0] : step, 0 : frame.depth.shape[1] : step]
    z = frame.depth[::step, ::step]
    seen = z > 0
    return frame.intrinsics.back_project(np.stack([u[seen], v[seen]], axis=1).astype(float), z[seen].astype(float))


def move(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ T[:3, :3].T + T[:3, 3]


def disagreement(a: Frame, b: Frame, T_b_a: np.ndarray) -> float:
    """Median difference, metres, between the depth of `b` and that of the points of `a` seen from there."""
    points = move(T_b_a, camera_points(a))
    points = points[points[:, 2] > 0.3]
    pixels = np.rint(b.intrinsics.project(points)).astype(int)
    inside = (pixels >= 0).all(axis=1) & (pixels < [b.intrinsics.width, b.intrinsics.height]).all(axis=1)
    points, pixels = points[inside], pixels[inside]
    depth = b.depth[pixels[:, 1], pixels[:, 0]]
    assert (depth > 0).sum() > 2000, "the frames hardly overlap"
    return float(np.median(np.abs(depth - points[:, 2])[depth > 0]))


def test_redkitchen_opens_fast_and_two_frames_agree_under_their_poses(real_data: Path) -> None:
    start = time.perf_counter()
    sequence = open_sequence(real_data / "redkitchen")
    elapsed = time.perf_counter() - start
    assert len(sequence) == 600
    assert elapsed < 0.5
    assert sequence.poses is not None and np.isfinite(sequence.poses).all()
    assert sequence.gravity is not None and np.linalg.norm(sequence.gravity) == pytest.approx(1)
    for i, j in ((0, 20), (300, 340)):
        a, b = sequence[i], sequence[j]
        assert a.T_world_camera is not None and b.T_world_camera is not None
        T_b_a = np.linalg.inv(b.T_world_camera) @ a.T_world_camera
        agreed = disagreement(a, b, T_b_a)
        assert agreed < 0.012
        assert agreed < 0.5 * disagreement(a, b, np.linalg.inv(T_b_a))  # poses are camera to world, not its inverse


def test_the_floor_of_fr3_cabinet_is_where_the_motion_capture_says(real_data: Path) -> None:
    sequence = open_sequence(real_data / "tum_fr3_cabinet")
    assert (len(sequence), sequence.intrinsics.fx) == (58, 535.4)
    heights = []
    for i in (8, 24, 32, 48):
        frame = sequence[i]
        assert frame.T_world_camera is not None
        points = move(frame.T_world_camera, camera_points(frame))
        floor = points[np.abs(points[:, 2]) < 0.06, 2]
        assert len(floor) > 0.5 * len(points)  # the camera looks down at a cabinet on the floor
        heights.append(np.median(floor))
    assert np.abs(heights).max() < 0.015
    np.testing.assert_array_equal(sequence.gravity, [0, 0, -1])


def test_the_labels_of_scene_02_and_03_are_the_things_on_their_tables(real_data: Path, tmp_path: Path) -> None:
    scenes = open_sequence(real_data / "uw_scenes_v2")
    assert isinstance(scenes, RgbdScenesV2)
    assert (len(scenes), scenes.poses) == (1, None)  # one image pair of scene 01, whose poses are not here
    assert 0.5 < np.median(scenes[0].depth[scenes[0].depth > 0]) < 3
    on_tables = {}
    for number, count in (("02", 1168556), ("03", 1249801)):
        fields = vars(scenes) | {"label_file": real_data / f"uw_scenes_v2/pc/{number}.label"}
        labels = RgbdScenesV2(**fields).labels()
        assert len(labels) == count
        on_tables[number] = {CLASSES[i] for i in np.unique(labels)}
    big = {"coffee_table", "sofa", "background"}
    assert on_tables["02"] - big == {"bowl", "cereal_box", "coffee_mug", "soda_can"}
    assert on_tables["03"] - big == {"bowl", "cap", "coffee_mug", "soda_can"}


def test_the_poses_of_all_scenes_are_smooth_and_start_at_the_origin(real_data: Path) -> None:
    files = sorted((real_data / "uw_scenes_v2/pc").glob("*.pose"))
    counts = {}
    for file in files:
        poses = read_pose_rows(file)
        counts[file.stem] = len(poses)
        np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-6)
        steps = np.linalg.inv(poses[:-1]) @ poses[1:]
        turn = np.arccos(np.clip((np.trace(steps[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1))
        assert np.degrees(np.median(turn)) < 2  # a wrong quaternion order turns by tens of degrees
        assert np.median(np.linalg.norm(steps[:, :3, 3], axis=1)) < 0.05
    assert (counts["02"], counts["03"], sum(counts.values())) == (834, 861, 10539)


def test_all_boxes_of_version_1_are_inside_their_images(real_data: Path) -> None:
    videos = read_boxes_tsv(real_data / "uw_scenes_v1/rgbd-scenes_boxes.tsv")
    assert len(videos) == 8
    frames = [boxes for video in videos.values() for boxes in video.values()]
    assert sum(len(boxes) for boxes in frames) == 5492
    assert len(frames) == 1408
    xyxy = np.concatenate([boxes.xyxy for boxes in frames])
    assert (xyxy >= 0).all() and (xyxy[:, 2] <= 639).all() and (xyxy[:, 3] <= 479).all()
    assert (xyxy[:, 2:] > xyxy[:, :2]).all()
    classes = {name for boxes in frames for name in boxes.classes}
    assert classes == {"bowl", "cap", "cereal_box", "coffee_mug", "flashlight", "soda_can"}


def test_a_frame_decodes_its_two_images_once_each(real_data: Path, monkeypatch) -> None:
    sequence = open_sequence(real_data / "redkitchen")
    decoded, imdecode = [], cv2.imdecode
    monkeypatch.setattr(cv2, "imdecode", lambda data, flags: decoded.append(len(data)) or imdecode(data, flags))
    assert isinstance(sequence, RecordedSequence)
    assert sequence[3].color.shape == (480, 640, 3)
    files = sequence.files[3]
    assert decoded == [files.color.stat().st_size, files.depth.stat().st_size]

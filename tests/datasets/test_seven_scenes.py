from pathlib import Path

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import BrokenFrame, FrameProblem, Intrinsics
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.seven_scenes import KINECT, REGISTRATION, find_seven_scenes, open_seven_scenes

MATRIX = "60 0 31.5\n0 60 23.5\n0 0 1\n"


def write_frame(folder: Path, number: int, write_images, pose: np.ndarray | None, kind: str = "png"):
    stem = f"frame-{number:06d}"
    images = write_images(folder / f"{stem}.color.{kind}", folder / f"{stem}.depth.png", seed=number)
    if pose is not None:
        np.savetxt(folder / f"{stem}.pose.txt", pose)
    return images


@pytest.fixture
def kitchen(tmp_path: Path, write_images, pose) -> Path:
    for number in range(3):
        write_frame(tmp_path / "kitchen", number, write_images, pose(number))
    (tmp_path / "kitchen" / "camera-intrinsics.txt").write_text(MATRIX)
    return tmp_path / "kitchen"


def test_frames_come_with_images_camera_stamps_and_poses(tmp_path: Path, write_images, pose) -> None:
    images = {n: write_frame(tmp_path / "kitchen", n, write_images, pose(n)) for n in (1, 0, 12)}
    (tmp_path / "kitchen" / "camera-intrinsics.color.txt").write_text(MATRIX)
    sequence = open_seven_scenes(tmp_path / "kitchen")
    assert isinstance(sequence, Sequence)
    assert (sequence.name, len(sequence), sequence.gravity) == ("kitchen", 3, None)
    assert sequence.intrinsics == Intrinsics(64, 48, 60, 60, 31.5, 23.5)
    np.testing.assert_allclose(sequence.stamps, [0, 1 / 30, 12 / 30])
    for index, (frame, number) in enumerate(zip(sequence, (0, 1, 12), strict=True)):
        rgb, raw = images[number]
        assert (frame.index, frame.name) == (index, f"frame-{number:06d}")
        assert frame.stamp == pytest.approx(number / 30)
        np.testing.assert_array_equal(frame.color, rgb)
        np.testing.assert_allclose(frame.depth, raw / 1000, rtol=1e-6)
        np.testing.assert_allclose(frame.T_world_camera, pose(number), atol=1e-12)
        np.testing.assert_allclose(sequence.poses[index], pose(number), atol=1e-12)


def test_the_jpeg_form_with_gravity(tmp_path: Path, write_images, pose) -> None:
    rgb, _ = write_frame(tmp_path / "k", 0, write_images, pose(0), kind="jpg")
    (tmp_path / "k" / "camera-intrinsics.txt").write_text(MATRIX)
    (tmp_path / "k" / "gravity-direction.txt").write_text("0\n9.8\n0\n")
    sequence = open_seven_scenes(tmp_path / "k")
    np.testing.assert_array_equal(sequence.gravity, [0, 1, 0])
    assert np.abs(sequence[0].color.astype(int) - rgb).mean() < 12  # JPEG is lossy; swapped channels are off by 80


def write_kinect(folder: Path, write_images) -> tuple[np.ndarray, np.ndarray]:
    stem = folder / "frame-000000"
    return write_images(stem.with_suffix(".color.png"), stem.with_suffix(".depth.png"), size=(640, 480))


@pytest.mark.parametrize("camera", [None, "585 0 320\n0 585 240\n0 0 1\n"])
def test_the_kinect_s_depth_is_registered_to_its_colour(tmp_path: Path, write_images, camera: str | None) -> None:
    folder = tmp_path / "chess" / "seq-01"
    rgb, raw = write_kinect(folder, write_images)
    if camera is not None:
        (folder / "camera-intrinsics.txt").write_text(camera)
    sequence = open_seven_scenes(folder)
    assert sequence.name == "chess-seq-01"
    assert sequence.poses is None and sequence[0].T_world_camera is None
    assert sequence.intrinsics == REGISTRATION.color != KINECT
    frame = sequence[0]
    assert frame.intrinsics == sequence.intrinsics
    np.testing.assert_array_equal(frame.color, rgb)
    np.testing.assert_allclose(frame.depth, REGISTRATION.register((raw / 1000).astype(np.float32)), rtol=1e-6)


def test_the_kinect_s_poses_become_those_of_its_colour_camera(tmp_path: Path, write_images, pose) -> None:
    write_kinect(tmp_path / "k", write_images)
    np.savetxt(tmp_path / "k" / "frame-000000.pose.txt", pose(3))
    sequence = open_seven_scenes(tmp_path / "k")
    p_depth = np.array([0.2, -0.1, 1.5, 1.0])  # a point in the depth camera, whose poses the files give
    p_color = p_depth + np.array([*REGISTRATION.offset, 0.0])
    for T in (sequence.poses[0], sequence[0].T_world_camera):
        np.testing.assert_allclose(T @ p_color, pose(3) @ p_depth, atol=1e-9)


def test_another_camera_s_images_are_taken_as_registered(tmp_path: Path, write_images, pose) -> None:
    _, raw = write_kinect(tmp_path / "k", write_images)
    np.savetxt(tmp_path / "k" / "frame-000000.pose.txt", pose(3))
    (tmp_path / "k" / "camera-intrinsics.txt").write_text("525 0 319.5\n0 525 239.5\n0 0 1\n")
    sequence = open_seven_scenes(tmp_path / "k")
    assert sequence.registration is None and sequence.intrinsics.fx == 525
    np.testing.assert_allclose(sequence[0].depth, raw / 1000, rtol=1e-6)
    np.testing.assert_allclose(sequence.poses[0], pose(3), atol=1e-12)


def test_a_missing_pose_stays_missing_when_poses_are_moved(tmp_path: Path, write_images, pose) -> None:
    write_kinect(tmp_path / "k", write_images)
    write_images(tmp_path / "k" / "frame-000001.color.png", tmp_path / "k" / "frame-000001.depth.png", size=(640, 480))
    np.savetxt(tmp_path / "k" / "frame-000000.pose.txt", pose(3))
    sequence = open_seven_scenes(tmp_path / "k")
    assert np.isfinite(sequence.poses[0]).all() and np.isnan(sequence.poses[1]).all()
    with pytest.raises(BrokenFrame, match="no pose file"):
        sequence[1]


def test_another_camera_needs_its_file(kitchen: Path) -> None:
    (kitchen / "camera-intrinsics.txt").unlink()
    with pytest.raises(InputError, match=r"64 x 48 pixels, so they are not the Kinect's"):
        open_seven_scenes(kitchen)


def test_slightly_rounded_poses_become_rotations(kitchen: Path, pose) -> None:
    np.savetxt(kitchen / "frame-000001.pose.txt", pose(1), fmt="%.3f")
    rotation = open_seven_scenes(kitchen)[1].T_world_camera[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rotation, pose(1)[:3, :3], atol=2e-3)


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (lambda path: path.unlink(), "no pose file"),
        (lambda path: path.write_text("1 0 0"), "frame-000001.pose.txt is not a 4x4 matrix"),
        (lambda path: path.write_text("lost"), "not a 4x4 matrix"),
        (lambda path: np.savetxt(path, np.full((4, 4), np.nan)), "not finite"),
        (lambda path: np.savetxt(path, np.diag([2.0, 2, 2, 1])), "off orthonormal by 3"),
        (lambda path: np.savetxt(path, np.diag([1.0, 1, -1, 1])), "reflection"),
    ],
)
def test_a_pose_that_is_missing_or_wrong_breaks_its_frame_only(kitchen: Path, damage, word: str) -> None:
    damage(kitchen / "frame-000001.pose.txt")
    sequence = open_seven_scenes(kitchen)
    with pytest.raises(BrokenFrame, match=word) as broken:
        sequence[1]
    assert (broken.value.problem, broken.value.name) == (FrameProblem.MISSING_POSE, "frame-000001")
    assert np.isnan(sequence.poses[1]).all()
    assert sequence[0].T_world_camera is not None and sequence[2].T_world_camera is not None


def test_a_frame_with_one_image_is_broken_not_skipped(kitchen: Path) -> None:
    (kitchen / "frame-000001.depth.png").unlink()
    (kitchen / "frame-000002.color.png").unlink()
    sequence = open_seven_scenes(kitchen)
    assert len(sequence) == 3
    for index, missing in ((1, "depth"), (2, "color")):
        with pytest.raises(BrokenFrame, match=f"frame-00000{index}.{missing}.png is missing") as broken:
            sequence[index]
        assert broken.value.problem is FrameProblem.UNREADABLE


def test_a_frame_of_another_size_is_broken(kitchen: Path, write_images) -> None:
    write_images(kitchen / "frame-000002.color.png", kitchen / "frame-000002.depth.png", size=(32, 24))
    with pytest.raises(BrokenFrame) as broken:
        open_seven_scenes(kitchen)[2]
    assert broken.value.problem is FrameProblem.SIZE_MISMATCH


def test_invalid_depths_of_both_kinds_break_a_frame(kitchen: Path) -> None:
    depth = np.zeros((48, 64), np.uint16)
    depth[:24] = 65535
    cv2.imwrite(str(kitchen / "frame-000000.depth.png"), depth)
    with pytest.raises(BrokenFrame) as broken:
        open_seven_scenes(kitchen)[0]
    assert broken.value.problem is FrameProblem.NO_DEPTH


def test_indices_behave_as_a_list_does(kitchen: Path) -> None:
    sequence = open_seven_scenes(kitchen)
    assert (sequence[-1].index, sequence[-1].name) == (2, "frame-000002")
    for index in (3, -4):
        with pytest.raises(IndexError):
            sequence[index]


def test_a_folder_without_frames_is_told(tmp_path: Path, kitchen: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="frame-000000"):
        open_seven_scenes(tmp_path / "empty")
    with pytest.raises(InputError, match="frame-000000"):
        open_seven_scenes(tmp_path / "nowhere")
    for file in kitchen.glob("*.depth.png"):
        file.unlink()
    with pytest.raises(InputError, match="none of the 3 frames has both files"):
        open_seven_scenes(kitchen)


def test_sequences_are_found_at_a_path_and_one_level_below(tmp_path: Path, write_images) -> None:
    for name in ("seq-01", "seq-02"):
        write_frame(tmp_path / "chess" / name, 0, write_images, None)
    assert find_seven_scenes(tmp_path / "chess" / "seq-02") == [tmp_path / "chess" / "seq-02"]
    assert find_seven_scenes(tmp_path / "chess") == [tmp_path / "chess" / "seq-01", tmp_path / "chess" / "seq-02"]
    assert find_seven_scenes(tmp_path) == []

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.folder import open_folder
from thingmap.datasets.frame import BrokenFrame, FrameProblem, Intrinsics
from thingmap.datasets.sequence import Sequence

CAMERA = {"width": 64, "height": 48, "fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "depth_scale": 1000}


def write_folder(root: Path, names: list[str], write_images, **camera) -> Path:
    for seed, name in enumerate(names):
        write_images(root / f"color/{name}.png", root / f"depth/{name}.png", seed)
    (root / "intrinsics.json").write_text(json.dumps(CAMERA | camera))
    return root


@pytest.fixture
def office(tmp_path: Path, write_images) -> Path:
    return write_folder(tmp_path / "office", ["frame_2", "frame_10", "frame_1"], write_images)


@pytest.fixture
def stamped(tmp_path: Path, write_images) -> Path:
    return write_folder(tmp_path / "stamped", ["9.50", "10.25", "10.125"], write_images)


def test_frames_are_in_natural_order_with_stamps_by_index(office: Path, write_images) -> None:
    sequence = open_folder(office)
    assert isinstance(sequence, Sequence)
    assert (sequence.name, sequence.poses, sequence.gravity) == ("office", None, None)
    assert sequence.intrinsics == Intrinsics(64, 48, 60, 60, 31.5, 23.5)
    assert [f.name for f in sequence] == ["frame_1", "frame_2", "frame_10"]
    np.testing.assert_allclose(sequence.stamps, np.arange(3) / 30)
    rgb, raw = write_images(office / "x.png", office / "y.png", seed=1)
    np.testing.assert_array_equal(sequence[2].color, rgb)
    np.testing.assert_allclose(sequence[2].depth, raw / 1000, rtol=1e-6)


def test_camera_file_options_are_used(tmp_path: Path, write_images, pose, tum_row) -> None:
    root = write_folder(tmp_path / "r", ["a1", "a2"], write_images, depth_scale=4000, fps=10, gravity=[0, 3, 4])
    (root / "poses.txt").write_text(tum_row(0, pose(0)) + tum_row(1, pose(1)))
    sequence = open_folder(root)
    np.testing.assert_allclose(sequence.stamps, [0, 0.1])
    np.testing.assert_allclose(sequence.gravity, [0, 0.6, 0.8])
    assert 500 / 4000 <= np.median(sequence[0].depth) <= 1


def test_names_that_are_seconds_are_stamps_and_find_their_poses(stamped: Path, pose, tum_row) -> None:
    rows = [tum_row(stamp, pose(i)) for i, stamp in enumerate((9.5, 10.13, 12.0))]
    (stamped / "poses.txt").write_text("# stamp tx ty tz qx qy qz qw\n" + "".join(reversed(rows)))
    sequence = open_folder(stamped)
    np.testing.assert_array_equal(sequence.stamps, [9.5, 10.125, 10.25])
    np.testing.assert_allclose(sequence[0].T_world_camera, pose(0), atol=1e-8)
    np.testing.assert_allclose(sequence[1].T_world_camera, pose(1), atol=1e-8)
    assert sequence[2].T_world_camera is None


def test_names_without_a_decimal_point_are_numbers_not_seconds(tmp_path: Path, write_images) -> None:
    sequence = open_folder(write_folder(tmp_path / "r", ["000100", "000200"], write_images))
    np.testing.assert_allclose(sequence.stamps, [0, 1 / 30])


def test_rows_belong_to_frames_where_names_are_no_stamps(office: Path, pose, tum_row) -> None:
    (office / "poses.txt").write_text("".join(tum_row(100 + i, pose(i)) for i in range(3)))
    for i, frame in enumerate(open_folder(office)):
        np.testing.assert_allclose(frame.T_world_camera, pose(i), atol=1e-8)


def test_a_row_without_a_pose_breaks_its_frame(office: Path, pose, tum_row) -> None:
    (office / "poses.txt").write_text(tum_row(0, pose(0)) + "1 nan nan nan nan nan nan nan\n" + tum_row(2, pose(2)))
    sequence = open_folder(office)
    with pytest.raises(BrokenFrame, match=r"row 2 of poses\.txt has no pose") as broken:
        sequence[1]
    assert broken.value.problem is FrameProblem.MISSING_POSE
    np.testing.assert_allclose(sequence[2].T_world_camera, pose(2), atol=1e-8)


def test_the_accelerometer_is_in_camera_axes_already(stamped: Path) -> None:
    (stamped / "accelerometer.txt").write_text("9.51 0.1 -9.8 0.2\n10.2 1 2 9\n")
    sequence = open_folder(stamped)
    np.testing.assert_array_equal(sequence[0].specific_force, [0.1, -9.8, 0.2])
    assert sequence[1].specific_force is None


def test_float_depth_and_jpeg_colour(office: Path) -> None:
    for name in ("frame_1", "frame_2", "frame_10"):
        (office / f"depth/{name}.png").unlink()
        (office / f"color/{name}.png").unlink()
        cv2.imwrite(str(office / f"depth/{name}.tiff"), np.full((48, 64), 1.25, np.float32))
        cv2.imwrite(str(office / f"color/{name}.JPG"), np.full((48, 64, 3), (0, 0, 250), np.uint8))
    (office / "intrinsics.json").write_text(json.dumps(CAMERA | {"depth_scale": 1}))
    frame = open_folder(office)[0]
    assert (frame.depth == 1.25).all()
    assert frame.color[..., 0].min() > 240 and frame.color[..., 1:].max() < 10


def test_one_bad_frame_does_not_stop_the_others(office: Path) -> None:
    (office / "depth/frame_1.png").unlink()
    cv2.imwrite(str(office / "depth/frame_2.png"), np.zeros((48, 64), np.uint16))
    (office / "color/note.txt").write_text("not an image")
    sequence = open_folder(office)
    problems = []
    for i in range(2):
        with pytest.raises(BrokenFrame) as broken:
            sequence[i]
        problems.append((broken.value.name, broken.value.problem))
    assert problems == [("frame_1", FrameProblem.UNREADABLE), ("frame_2", FrameProblem.NO_DEPTH)]
    assert sequence[2].name == "frame_10"


def remove(root: Path, what: str) -> None:
    for file in root.glob(what):
        file.unlink() if file.is_file() else [f.unlink() for f in file.iterdir()] and file.rmdir()


def resize(root: Path, what: str) -> None:
    for file in root.glob(what):
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(file), cv2.resize(image, (32, 24), interpolation=cv2.INTER_NEAREST))


def repaint(root: Path, dtype: type, value: int) -> None:
    for file in root.glob("depth/*"):
        cv2.imwrite(str(file), np.full((48, 64), value, dtype))


MISTAKES = {
    "no colour folder": (lambda r: remove(r, "color"), ["color: expected a folder of images", "color/, depth/ and"]),
    "no depth folder": (lambda r: remove(r, "depth"), ["depth: expected a folder of images"]),
    "no camera": (lambda r: remove(r, "intrinsics.json"), ["intrinsics.json", "no such file", '"depth_scale": 1000']),
    "no colour image": (lambda r: remove(r, "color/*"), ["color: expected images (*.png, *.jpg", "found none"]),
    "two of a name": (
        lambda r: (r / "color/frame_1.jpg").write_bytes(b"x"),
        ["found frame_1.jpg and frame_1.png; remove one"],
    ),
    "names differ": (
        lambda r: [f.rename(f.with_name("depth_" + f.name)) for f in r.glob("depth/*")],
        ["equal names", "color/frame_1.png and depth/depth_frame_1.png"],
    ),
    "camera of another size": (
        lambda r: (r / "intrinsics.json").write_text(json.dumps(CAMERA | {"width": 128})),
        ["is 64 x 48, the camera 128 x 48", "give the intrinsics of these images"],
    ),
    "depth not registered": (lambda r: resize(r, "depth/*"), ["is 32 x 24", "register depth to colour"]),
    "depth as a picture": (lambda r: repaint(r, np.uint8, 9), ["1 x uint8", "depth as 16-bit PNG"]),
    "depth all zero": (lambda r: repaint(r, np.uint16, 0), ["no pixel of frame_1.png has a depth"]),
    "too few poses": (
        lambda r: (r / "poses.txt").write_text("0 0 0 0 0 0 0 1\n"),
        ["poses.txt: expected 3 rows, one a frame, found 1 rows", "name the images by their stamps"],
    ),
    "gravity without poses": (
        lambda r: (r / "intrinsics.json").write_text(json.dumps(CAMERA | {"gravity": [0, 1, 0]})),
        ["gravity in the world of the poses", "no poses.txt"],
    ),
    "a matrix for poses": (
        lambda r: (r / "poses.txt").write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"),
        ["rows of `stamp tx ty tz qx qy qz qw`", "4 fields in line 1: '1 0 0 0'"],
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_every_mistake_is_told_with_what_to_do(office: Path, mistake: str) -> None:
    make, words = MISTAKES[mistake]
    make(office)
    with pytest.raises(InputError) as error:
        open_folder(office)
    assert all(word in str(error.value) for word in [str(office), *words]), str(error.value)


def test_poses_by_another_clock_are_told(stamped: Path) -> None:
    (stamped / "poses.txt").write_text("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n")
    with pytest.raises(InputError, match=r"9\.500000 to 10\.250000, found stamps 0\.000000 to 1\.000000"):
        open_folder(stamped)

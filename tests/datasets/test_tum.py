from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.camera_files import EXAMPLE_JSON
from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import BrokenFrame, FrameProblem, Intrinsics
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.tum import CAMERAS, find_tum, open_tum

T0 = 1305031102.0
# Colour and depth are recorded by clocks of their own: the third depth image is too late for any colour image.
COLOR = T0 + np.array([0.175304, 0.211214, 0.243211, 0.280000])
DEPTH = T0 + np.array([0.160407, 0.226738, 0.305000, 0.278500])


@pytest.fixture
def desk(tmp_path: Path, write_images, pose, tum_row) -> Path:
    folder = tmp_path / "rgbd_dataset_freiburg1_desk"
    for seed, (color, depth) in enumerate(zip(COLOR, DEPTH, strict=True)):
        write_images(folder / f"rgb/{color:.6f}.png", folder / f"depth/{depth:.6f}.png", seed, size=(640, 480))
    for name, stamps in (("rgb", COLOR), ("depth", DEPTH)):
        rows = "".join(f"{stamp:.6f} {name}/{stamp:.6f}.png\n" for stamp in stamps)
        (folder / f"{name}.txt").write_text(f"# images\n# file: 'desk.bag'\n# timestamp filename\n{rows}")
    rows = "".join(tum_row(stamp, pose(0)) for stamp in T0 + np.arange(0.1, 0.23, 0.01))
    (folder / "groundtruth.txt").write_text("# ground truth trajectory\n" + rows)
    return folder


def test_frames_are_colour_and_depth_paired_by_stamp(desk: Path, pose) -> None:
    sequence = open_tum(desk)
    assert isinstance(sequence, Sequence)
    assert sequence.name == "rgbd_dataset_freiburg1_desk"
    np.testing.assert_allclose(sequence.stamps, COLOR[[0, 1, 3]], atol=1e-6)
    assert [f.name for f in sequence.files] == ["1305031102.175304", "1305031102.211214", "1305031102.280000"]
    assert [f.depth.stem for f in sequence.files] == ["1305031102.160407", "1305031102.226738", "1305031102.278500"]
    np.testing.assert_array_equal(sequence.gravity, [0, 0, -1])
    frame = sequence[1]
    assert (frame.index, frame.stamp) == (1, pytest.approx(COLOR[1], abs=1e-6))
    np.testing.assert_allclose(frame.T_world_camera, pose(0), atol=1e-8)


def test_depth_is_in_fifths_of_a_millimetre(tmp_path: Path, write_images) -> None:
    _, raw = write_images(tmp_path / "fr3_x/rgb/1.0.png", tmp_path / "fr3_x/depth/1.0.png", size=(640, 480))
    for name in ("rgb", "depth"):
        (tmp_path / f"fr3_x/{name}.txt").write_text(f"1.0 {name}/1.0.png\n")
    frame = open_tum(tmp_path / "fr3_x")[0]
    np.testing.assert_allclose(frame.depth, raw / 5000, rtol=1e-6)
    assert frame.intrinsics == CAMERAS[3]


def test_a_frame_in_a_gap_of_the_motion_capture_is_usable_without_a_pose(desk: Path) -> None:
    sequence = open_tum(desk)
    assert sequence[2].T_world_camera is None
    np.testing.assert_array_equal(np.isnan(sequence.poses[:, 0, 0]), [False, False, True])


def test_without_ground_truth_there_are_no_poses_and_no_gravity(desk: Path) -> None:
    (desk / "groundtruth.txt").unlink()
    sequence = open_tum(desk)
    assert sequence.poses is None and sequence.gravity is None


def test_in_another_world_gravity_is_what_the_camera_file_says(desk: Path) -> None:
    folder = desk.rename(desk.parent / "kitchen")
    (folder / "intrinsics.json").write_text(EXAMPLE_JSON)
    assert open_tum(folder).gravity is None
    (folder / "intrinsics.json").write_text(EXAMPLE_JSON.replace("}", ', "gravity": [0, 2, 0]}'))
    np.testing.assert_array_equal(open_tum(folder).gravity, [0, 1, 0])


def test_ground_truth_of_another_recording_is_told(desk: Path, pose, tum_row) -> None:
    (desk / "groundtruth.txt").write_text(tum_row(5.0, pose(0)))
    with pytest.raises(InputError, match=r"found stamps 5\.000000"):
        open_tum(desk)


def test_the_accelerometer_is_turned_into_camera_axes(desk: Path) -> None:
    # A level Kinect reads +g along its own y, which points up; camera y points down.
    (desk / "accelerometer.txt").write_text(
        f"# timestamp ax ay az\n{COLOR[0] + 0.01:.6f} 0.5 9.7 -1.0\n{COLOR[0] - 0.02:.6f} 9 9 9\n"
    )
    sequence = open_tum(desk)
    np.testing.assert_array_equal(sequence[0].specific_force, [-0.5, -9.7, -1.0])
    assert sequence[2].specific_force is None


@pytest.mark.parametrize(
    ("name", "camera"),
    [("rgbd_dataset_freiburg1_xyz", 1), ("freiburg2_desk", 2), ("fr3_office", 3), ("tum_fr2", 2), ("FR1-room", 1)],
)
def test_the_folder_name_tells_the_camera(desk: Path, name: str, camera: int) -> None:
    sequence = open_tum(desk.rename(desk.parent / name))
    assert sequence.intrinsics == CAMERAS[camera]


@pytest.mark.parametrize("name", ["office", "fr4_desk", "fr22", "afr1ca", "freiburg_desk"])
def test_an_unknown_camera_is_an_error_that_shows_what_to_write(desk: Path, name: str) -> None:
    folder = desk.rename(desk.parent / name)
    with pytest.raises(InputError) as error:
        open_tum(folder)
    remedy = error.value.remedy
    content = remedy[remedy.index("{") : remedy.index("}") + 1]
    (folder / "intrinsics.json").write_text(content)  # following the remedy works
    assert open_tum(folder).intrinsics == Intrinsics(640, 480, 525, 525, 319.5, 239.5)
    assert open_tum(folder).depth_unit.per_metre == 5000


def test_a_camera_file_goes_before_the_folder_name(desk: Path) -> None:
    (desk / "TUM2.yaml").write_text(
        "Camera.fx: 520\nCamera.fy: 521\nCamera.cx: 325\nCamera.cy: 249\nDepthMapFactor: 1000\n"
    )
    sequence = open_tum(desk)
    assert sequence.intrinsics == Intrinsics(640, 480, 520, 521, 325, 249)
    assert sequence.depth_unit.per_metre == 1000
    (desk / "other.yaml").write_text("")
    with pytest.raises(InputError, match=r"found TUM2\.yaml, other\.yaml"):
        open_tum(desk)
    (desk / "intrinsics.json").write_text(EXAMPLE_JSON)
    assert open_tum(desk).intrinsics.fx == 525


def test_images_that_are_listed_but_missing_break_their_frames(desk: Path) -> None:
    sequence = open_tum(desk)
    sequence.files[0].color.unlink()
    with pytest.raises(BrokenFrame, match=r"1305031102\.175304\.png is missing") as broken:
        open_tum(desk)[0]
    assert broken.value.problem is FrameProblem.UNREADABLE
    for frame in sequence.files[1:]:
        frame.depth.unlink()
    with pytest.raises(InputError, match="none of the 3 frames has both files"):
        open_tum(desk)


@pytest.mark.parametrize(
    ("rows", "word"),
    [
        ("1.0 rgb/a.png\nlate rgb/b.png\n", "'late' in line 2"),
        ("nan rgb/a.png\n", "'nan' in line 1"),
        ("1.0\n", "1 fields in line 1"),
        ("# nothing\n", "no row"),
        ("1.0 rgb/a.png\n", "none among 1 colour and 4 depth images"),
    ],
)
def test_wrong_lists_are_told(desk: Path, rows: str, word: str) -> None:
    (desk / "rgb.txt").write_text(rows)
    with pytest.raises(InputError, match=word):
        open_tum(desk)


def test_a_sequence_is_found_by_its_two_lists(desk: Path) -> None:
    assert find_tum(desk) == [desk]
    assert find_tum(desk.parent) == []
    (desk / "depth.txt").unlink()
    assert find_tum(desk) == []

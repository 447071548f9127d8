from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import BrokenFrame, FrameProblem, Intrinsics
from thingmap.datasets.rgbd_scenes_v2 import find_rgbd_scenes_v2, open_rgbd_scenes_v2


def pose_row(matrix: np.ndarray) -> str:
    q = Rotation.from_matrix(matrix[:3, :3]).as_quat(scalar_first=True)
    return " ".join(f"{v:.9f}" for v in (*q, *matrix[:3, 3])) + "\n"


@pytest.fixture
def scene(tmp_path: Path, write_images, pose) -> Path:
    folder = tmp_path / "rgbd-scenes-v2" / "imgs" / "scene_02"
    for number in (0, 2, 3):
        write_images(folder / f"{number:05d}-color.png", folder / f"{number:05d}-depth.png", number, size=(640, 480))
    clouds = tmp_path / "rgbd-scenes-v2" / "pc"
    clouds.mkdir()
    (clouds / "02.pose").write_text("".join(pose_row(pose(i)) for i in range(3)))
    (clouds / "02.label").write_text("4\n10\n10\n4\n1\n")
    return folder


def test_poses_are_those_of_the_image_numbers_and_depth_is_in_tenths_of_a_millimetre(scene: Path, pose) -> None:
    sequence = open_rgbd_scenes_v2(scene)
    assert (sequence.name, len(sequence)) == ("scene_02", 3)
    assert sequence.intrinsics == Intrinsics(640, 480, 525, 525, 319.5, 239.5)
    np.testing.assert_allclose(sequence.stamps, np.array([0, 2, 3]) / 30)
    frame = sequence[1]
    assert frame.name == "00002"
    np.testing.assert_allclose(frame.T_world_camera, pose(2), atol=1e-8)
    assert 0.05 < np.median(frame.depth) < 0.4  # raw 500 to 4000


def test_an_image_beyond_the_last_pose_is_broken(scene: Path) -> None:
    sequence = open_rgbd_scenes_v2(scene)
    with pytest.raises(BrokenFrame, match=r"02\.pose has no pose for image 3") as broken:
        sequence[2]
    assert broken.value.problem is FrameProblem.MISSING_POSE


def test_only_numbers_with_both_images_are_frames(scene: Path) -> None:
    (scene / "00002-depth.png").unlink()
    assert [f.name for f in open_rgbd_scenes_v2(scene).files] == ["00000", "00003"]


def test_a_scene_without_its_clouds_has_no_poses(scene: Path) -> None:
    (scene.parent.parent / "pc" / "02.pose").unlink()
    sequence = open_rgbd_scenes_v2(scene)
    assert sequence.poses is None and sequence[0].T_world_camera is None


def test_labels_are_the_ids_after_their_number(scene: Path) -> None:
    np.testing.assert_array_equal(open_rgbd_scenes_v2(scene).labels(), [10, 10, 4, 1])


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (None, "no such file; download the point clouds"),
        ("3\n10\n4\n", "found 3, and 2 ids"),
        ("", "no number"),
        ("1\nbowl\n", "bowl"),
    ],
)
def test_wrong_labels_are_told(scene: Path, text: str | None, word: str) -> None:
    path = scene.parent.parent / "pc" / "02.label"
    path.unlink() if text is None else path.write_text(text)
    with pytest.raises(InputError, match=word):
        open_rgbd_scenes_v2(scene).labels()


def test_scenes_are_found_from_the_root_the_image_folder_and_the_scene(scene: Path, write_images) -> None:
    root = scene.parent.parent
    for path in (root, root / "imgs", scene):
        assert find_rgbd_scenes_v2(path) == [scene]
    second = root / "imgs" / "scene_03"
    write_images(second / "00000-color.png", second / "00000-depth.png")
    assert find_rgbd_scenes_v2(root) == [scene, second]


def test_a_folder_without_pairs_is_told(tmp_path: Path, scene: Path) -> None:
    for file in scene.glob("*-depth.png"):
        file.unlink()
    with pytest.raises(InputError, match="3 colour and 0 depth images, and no pair"):
        open_rgbd_scenes_v2(scene)
    with pytest.raises(InputError, match="0 colour and 0 depth"):
        open_rgbd_scenes_v2(tmp_path / "nowhere")

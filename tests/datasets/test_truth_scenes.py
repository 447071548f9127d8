from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData, PlyElement
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import InputError
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.truth import NO_OBJECT

V1_CLASSES = ("bowl", "cap", "cereal_box", "coffee_mug", "flashlight", "soda_can")
V2_CLASSES = (
    *("bowl", "cap", "cereal_box", "coffee_mug", "coffee_table"),
    *("office_chair", "soda_can", "sofa", "table"),
)
FIELDS = [(name, object) for name in ("category", "instance", "top", "bottom", "left", "right")]


def pose_row(matrix: np.ndarray) -> str:
    q = Rotation.from_matrix(matrix[:3, :3]).as_quat(scalar_first=True)
    return " ".join(f"{value:.9f}" for value in (*q, *matrix[:3, 3])) + "\n"


def write_cloud(path: Path, points: np.ndarray) -> None:
    vertices = np.array([tuple(point) for point in points], dtype=[(axis, "f4") for axis in "xyz"])
    PlyData([PlyElement.describe(vertices, "vertex")]).write(str(path))


@pytest.fixture
def scene(tmp_path: Path, pose) -> Path:
    """The folder `pc` of scene 02: three poses, four labelled points."""
    clouds = tmp_path / "rgbd-scenes-v2" / "pc"
    clouds.mkdir(parents=True)
    (clouds / "02.pose").write_text("".join(pose_row(pose(i)) for i in range(3)))
    (clouds / "02.label").write_text("4\n10\n1\n7\n10\n")
    write_cloud(clouds / "02.ply", np.arange(12.0).reshape(4, 3))
    return clouds


@pytest.mark.parametrize("suffix", ["pose", "label", "ply"])
def test_any_file_of_a_scene_brings_the_others(scene: Path, pose, suffix: str) -> None:
    truth = open_truth(scene / f"02.{suffix}")
    assert (truth.name, truth.classes, truth.objects, truth.complete) == ("scene_02", V2_CLASSES, (), False)
    assert truth.names == ("00000", "00001", "00002") and truth.sequence is None and truth.up is None
    np.testing.assert_allclose(truth.stamps, np.arange(3) / 30)
    assert truth.poses is not None and truth.point_truth is not None
    np.testing.assert_allclose(truth.poses[2], pose(2), atol=1e-8)
    cloud = truth.point_truth()
    np.testing.assert_array_equal(cloud.points, np.arange(12.0).reshape(4, 3))
    np.testing.assert_array_equal(
        cloud.class_id, [NO_OBJECT, V2_CLASSES.index("bowl"), V2_CLASSES.index("soda_can"), NO_OBJECT]
    )
    assert cloud.object_id is None


def test_the_images_of_a_scene_are_its_sequence(scene: Path, write_images, pose) -> None:
    images = scene.parent / "imgs" / "scene_02"
    for number in (0, 2):
        write_images(images / f"{number:05d}-color.png", images / f"{number:05d}-depth.png", size=(640, 480))
    for spec in (scene / "02.label", images, scene.parent):
        truth = open_truth(spec)
        assert truth.sequence is not None and truth.names == ("00000", "00002")
        assert truth.point_truth is not None and truth.poses is not None
        np.testing.assert_allclose(truth.poses[1], pose(2), atol=1e-8)


def test_labels_without_a_name_are_told_by_their_number(scene: Path) -> None:
    (scene / "02.label").write_text("4\n0\n13\n7\n10\n")
    truth = open_truth(scene / "02.label")
    assert truth.classes == ("class 0", *V2_CLASSES, "class 13")
    assert truth.point_truth is not None
    np.testing.assert_array_equal(truth.point_truth().class_id, [0, 10, 7, NO_OBJECT])


def test_a_scene_is_known_in_part(scene: Path) -> None:
    (scene / "02.ply").unlink()
    truth = open_truth(scene / "02.pose")
    assert truth.point_truth is None and truth.classes == V2_CLASSES
    (scene / "02.label").unlink()
    assert open_truth(scene / "02.pose").classes == ()
    (scene / "02.pose").unlink()
    write_cloud(scene / "02.ply", np.zeros((4, 3)))
    with pytest.raises(InputError, match="neither poses nor objects nor labelled points"):
        open_truth(scene / "02.ply")


@pytest.mark.parametrize(
    ("labels", "part"),
    [("", "no number"), ("2\n1", "2, and 1 ids"), ("1\nbowl", "bowl"), ("1\n-3", "-3"), ("1\n" + "9" * 30, "02.label")],
)
def test_damaged_labels_are_told(scene: Path, labels: str, part: str) -> None:
    (scene / "02.label").write_text(labels)
    with pytest.raises(InputError) as error:
        open_truth(scene / "02.pose")
    assert part in str(error.value)


def test_a_cloud_of_another_scene_is_told(scene: Path) -> None:
    write_cloud(scene / "02.ply", np.zeros((5, 3)))
    truth = open_truth(scene / "02.pose")
    assert truth.point_truth is not None
    with pytest.raises(InputError, match="5 points and 4 labels"):
        truth.point_truth()
    (scene / "02.ply").write_bytes(b"ply\nnonsense")
    with pytest.raises(InputError, match=r"02\.ply"):
        truth.point_truth()


def write_mat(path: Path) -> None:
    """Boxes of frames 1 (two) and 3 (one), in the structure of the distribution."""
    bboxes = np.empty((1, 4), dtype=object)
    for cell in range(4):
        bboxes[0, cell] = np.zeros((0, 0))
    first, last = np.empty((1, 2), dtype=FIELDS), np.empty((1, 1), dtype=FIELDS)
    first[0, 0] = ("soda_can", 6, 175, 290, 272, 340)
    first[0, 1] = ("coffee_mug", 5, 158, 259, 182, 295)
    last[0, 0] = ("soda_can", 6, 1, 480, 1, 640)
    bboxes[0, 0], bboxes[0, 2] = first, last
    savemat(path, {"bboxes": bboxes})


@pytest.fixture
def video(tmp_path: Path, write_images) -> Path:
    folder = tmp_path / "desk" / "desk_1"
    for number in (1, 2, 3):
        stem = f"desk_1_{number}"
        write_images(folder / f"{stem}.png", folder / f"{stem}_depth.png", number, size=(640, 480))
    write_mat(folder.with_suffix(".mat"))
    return folder


@pytest.mark.parametrize("spec", ["desk_1", "desk_1.mat"])
def test_boxes_of_a_video(video: Path, spec: str) -> None:
    truth = open_truth(video.parent / spec)
    assert (truth.name, truth.classes, truth.complete, truth.poses) == ("desk_1", V1_CLASSES, True, None)
    assert truth.names == ("desk_1_1", "desk_1_2", "desk_1_3")
    np.testing.assert_allclose(truth.stamps, np.array([1, 2, 3]) / 30)
    assert [(thing.id, thing.label) for thing in truth.objects] == [(0, "coffee_mug"), (1, "soda_can")]
    assert truth.located == () and (truth.sequence is not None) == (spec == "desk_1")
    assert truth.frame_truth is not None and truth.intrinsics is not None
    first, none, last = (truth.frame_truth(k) for k in range(3))
    assert first is not None and none is not None and last is not None and truth.frame_truth(3) is None
    np.testing.assert_array_equal(first.object_id, [1, 0])
    np.testing.assert_array_equal(first.xyxy, [[271, 174, 339, 289], [181, 157, 294, 258]])
    np.testing.assert_array_equal(first.xyxy_visible, first.xyxy)
    np.testing.assert_array_equal(first.part_visibility, np.ones((2, 5)))
    assert len(none.object_id) == 0 and none.xyxy.shape == (0, 4)
    np.testing.assert_array_equal(last.object_id, [1])


def test_a_video_without_its_boxes_is_told(video: Path) -> None:
    video.with_suffix(".mat").unlink()
    with pytest.raises(InputError, match=r"desk_1\.mat"):
        open_truth(video)


def test_a_table_of_one_video_needs_no_name(tmp_path: Path) -> None:
    header = "no\tscene\tsubfolder\timage_id\tobject\tlabel\tbox\n"
    row = "1\tdesk\tdesk_2\t2\tcap\tcap_4\t(11, 21, 30, 40)\n"
    (tmp_path / "boxes.tsv").write_text(header + row)
    truth = open_truth(tmp_path / "boxes.tsv")
    assert (truth.name, truth.names) == ("desk_2", ("desk_2_1", "desk_2_2"))
    assert truth.frame_truth is not None and truth.frame_truth(1) is not None
    np.testing.assert_array_equal(truth.frame_truth(1).xyxy, [[10, 20, 40, 60]])
    (tmp_path / "boxes.tsv").write_text(header)
    with pytest.raises(InputError, match="no row"):
        open_truth(tmp_path / "boxes.tsv")


def test_poses_for_boxes_without_images_belong_to_the_frames_of_the_boxes(tmp_path: Path, pose, tum_row) -> None:
    header = "no\tscene\tsubfolder\timage_id\tobject\tlabel\tbox\n"
    (tmp_path / "boxes.tsv").write_text(header + "1\tdesk\tdesk_2\t3\tcap\tcap_4\t(11, 21, 30, 40)\n")
    trajectory = tmp_path / "groundtruth.txt"
    trajectory.write_text("".join(tum_row(k / 30, pose(k)) for k in range(9)))
    truth = open_truth(tmp_path / "boxes.tsv", poses=trajectory)
    assert truth.names == ("desk_2_1", "desk_2_2", "desk_2_3") and truth.poses is not None
    np.testing.assert_allclose(truth.poses, [pose(k) for k in (1, 2, 3)], atol=1e-6)
    trajectory.write_text("".join(tum_row(1e9 + k / 30, pose(k)) for k in range(9)))
    with pytest.raises(InputError, match="same clock"):
        open_truth(tmp_path / "boxes.tsv", poses=trajectory)


def test_all_real_boxes(real_data: Path) -> None:
    table = real_data / "uw_scenes_v1" / "rgbd-scenes_boxes.tsv"
    with pytest.raises(InputError, match=r"table_small_1.*#VIDEO"):
        open_truth(table)
    with pytest.raises(InputError, match="'attic'"):
        open_truth(f"{table}#attic")
    total = 0
    for video in ("desk_1", "desk_2", "desk_3", "kitchen_small_1", "meeting_small_1", "table_1"):
        total += _count(open_truth(f"{table}#{video}"))
    for number in (1, 2):
        total += _count(open_truth(f"{table}#table_small_{number}"))
    assert total == 5492


def _count(truth: GroundTruth) -> int:
    """Boxes of a video; every frame is annotated."""
    assert truth.frame_truth is not None and truth.classes == V1_CLASSES
    frames = [truth.frame_truth(index) for index in range(len(truth.names))]
    assert all(frame is not None for frame in frames)
    return sum(len(frame.object_id) for frame in frames if frame is not None)


def test_real_labels_and_poses(real_data: Path) -> None:
    truth = open_truth(real_data / "uw_scenes_v2" / "pc" / "02.label")
    assert (truth.name, len(truth.names), truth.classes) == ("scene_02", 834, V2_CLASSES)
    assert truth.poses is not None and truth.poses.shape == (834, 4, 4)
    assert truth.point_truth is None  # the cloud itself is not here

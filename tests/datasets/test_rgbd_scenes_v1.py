from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from thingmap.datasets.box_truth import read_boxes_mat, read_boxes_tsv
from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import BrokenFrame, Intrinsics
from thingmap.datasets.rgbd_scenes_v1 import find_rgbd_scenes_v1, open_rgbd_scenes_v1

FIELDS = [(f, object) for f in ("category", "instance", "top", "bottom", "left", "right")]
HEADER = "no\tscene\tsubfolder\timage_id\tobject\tlabel\tbox\n"


@pytest.fixture
def video(tmp_path: Path, write_images) -> Path:
    folder = tmp_path / "rgbd-scenes" / "desk" / "desk_1"
    for number in (1, 2, 10):
        stem = f"desk_1_{number}"
        write_images(folder / f"{stem}.png", folder / f"{stem}_depth.png", number, size=(640, 480))
    return folder


def write_mat(path: Path) -> None:
    """Boxes of frames 1 (two) and 10 (one), in the structure of the distribution."""
    bboxes = np.empty((1, 10), dtype=object)
    for cell in range(10):
        bboxes[0, cell] = np.zeros((0, 0))
    first = np.empty((1, 2), dtype=FIELDS)
    first[0, 0] = ("coffee_mug", 5, 158, 259, 182, 295)
    first[0, 1] = ("soda_can", 6, 175, 290, 272, 340)
    last = np.empty((1, 1), dtype=FIELDS)
    last[0, 0] = ("bowl", 2, 1, 480, 1, 640)
    bboxes[0, 0], bboxes[0, 9] = first, last
    savemat(path, {"bboxes": bboxes})


def test_frames_are_numbered_from_one_in_natural_order(video: Path, write_images) -> None:
    sequence = open_rgbd_scenes_v1(video)
    assert (sequence.name, len(sequence), sequence.poses) == ("desk_1", 3, None)
    assert [f.name for f in sequence.files] == ["desk_1_1", "desk_1_2", "desk_1_10"]
    np.testing.assert_array_equal(sequence.numbers, [1, 2, 10])
    np.testing.assert_allclose(sequence.stamps, np.array([1, 2, 10]) / 30)
    rgb, raw = write_images(video / "again.png", video / "again2.png", 10, size=(640, 480))
    np.testing.assert_array_equal(sequence[2].color, rgb)
    np.testing.assert_allclose(sequence[2].depth, raw / 1000, rtol=1e-6)


def test_other_intrinsics_can_be_given(video: Path) -> None:
    camera = Intrinsics(640, 480, 570.3, 570.3, 320, 240)
    assert open_rgbd_scenes_v1(video, camera)[0].intrinsics == camera


def test_a_frame_with_one_image_is_broken(video: Path) -> None:
    (video / "desk_1_2_depth.png").unlink()
    with pytest.raises(BrokenFrame, match=r"desk_1_2_depth\.png is missing"):
        open_rgbd_scenes_v1(video)[1]


def test_videos_are_found_from_the_dataset_the_scene_and_the_video(video: Path, write_images) -> None:
    for path in (video, video.parent, video.parent.parent):
        assert find_rgbd_scenes_v1(path) == [video]
    second = video.parent / "desk_2"
    write_images(second / "desk_2_1.png", second / "desk_2_1_depth.png")
    assert find_rgbd_scenes_v1(video.parent) == [video, second]
    odd = video.parent / "desk[1]"
    write_images(odd / "desk[1]_1.png", odd / "desk[1]_1_depth.png")
    assert find_rgbd_scenes_v1(odd) == [odd]
    with pytest.raises(InputError, match="NAME_1_depth"):
        open_rgbd_scenes_v1(video.parent)


def test_boxes_of_the_matlab_file_belong_to_the_frames_by_number(video: Path) -> None:
    write_mat(video.parent / "desk_1.mat")
    first, second, last = open_rgbd_scenes_v1(video).boxes()
    np.testing.assert_array_equal(first.xyxy, [[181, 157, 294, 258], [271, 174, 339, 289]])
    assert first.classes == ("coffee_mug", "soda_can")
    assert first.instances == ("coffee_mug_5", "soda_can_6")
    assert (len(second), second.xyxy.shape) == (0, (0, 4))
    np.testing.assert_array_equal(last.xyxy, [[0, 0, 639, 479]])


def test_the_table_says_the_same_as_the_matlab_file(tmp_path: Path) -> None:
    write_mat(tmp_path / "desk_1.mat")
    rows = [
        (1, "coffee_mug", "coffee_mug_5", "(182, 158, 113, 101)"),
        (1, "soda_can", "soda_can_6", "(272, 175, 68, 115)"),
        (10, "bowl", "bowl_2", "(1, 1, 639, 479)"),
    ]
    lines = [f"{i}\tdesk\tdesk_1\t{n}\t{c}\t{k}\t{b}\n" for i, (n, c, k, b) in enumerate(rows, 1)]
    (tmp_path / "boxes.tsv").write_text(HEADER + "".join(lines) + "4\tdesk\tdesk_2\t3\tcap\tcap_1\t(5, 6, 7, 8)\n")
    table = read_boxes_tsv(tmp_path / "boxes.tsv")
    mat = read_boxes_mat(tmp_path / "desk_1.mat")
    assert set(table) == {"desk_1", "desk_2"}
    assert set(table["desk_1"]) == set(mat) == {1, 10}
    for number, boxes in mat.items():
        np.testing.assert_array_equal(table["desk_1"][number].xyxy, boxes.xyxy)
        assert table["desk_1"][number].classes == boxes.classes
        assert table["desk_1"][number].instances == boxes.instances
    np.testing.assert_array_equal(table["desk_2"][3].xyxy, [[4, 5, 11, 13]])


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("scene\tbox\n", "no subfolder, image_id, object, label"),
        (HEADER + "1\tdesk\tdesk_1\t1\tcap\tcap_1\t(1, 2, 3)\n", r"'\(1, 2, 3\)' in line 2"),
        (HEADER + "1\tdesk\tdesk_1\tx\tcap\tcap_1\t(1, 2, 3, 4)\n", "'x'"),
        (HEADER + "1\tdesk\tdesk_1\t1\tcap\n", "None in line 2"),
    ],
)
def test_a_wrong_table_is_told(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "boxes.tsv").write_text(text)
    with pytest.raises(InputError, match=word):
        read_boxes_tsv(tmp_path / "boxes.tsv")


def test_a_wrong_matlab_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "desk_1.mat"
    with pytest.raises(InputError, match="no such file"):
        read_boxes_mat(path)
    for content in (b"", b"not a matlab file at all", b"\0" * 200):
        path.write_bytes(content)
        with pytest.raises(InputError, match="expected a MATLAB file"):
            read_boxes_mat(path)
    savemat(path, {"other": 1})
    with pytest.raises(InputError, match="bboxes"):
        read_boxes_mat(path)
    savemat(path, {"bboxes": np.eye(3)})
    with pytest.raises(InputError, match="expected a MATLAB file"):
        read_boxes_mat(path)

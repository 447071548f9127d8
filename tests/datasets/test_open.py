import json
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.folder import open_folder
from thingmap.datasets.open import DATASETS, LOADERS, open_sequence
from thingmap.datasets.rgbd_scenes_v1 import RgbdScenesV1
from thingmap.datasets.rgbd_scenes_v2 import RgbdScenesV2

CAMERA = {"width": 64, "height": 48, "fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "depth_scale": 1000}


@pytest.fixture
def recordings(tmp_path: Path, write_images) -> Path:
    """One recording of each layout."""
    for number in range(4):
        stem = f"7scenes/seq-01/frame-{number:06d}"
        write_images(tmp_path / f"{stem}.color.png", tmp_path / f"{stem}.depth.png")
        write_images(tmp_path / f"folder/color/{number}.png", tmp_path / f"folder/depth/{number}.png")
    (tmp_path / "7scenes/seq-01/camera-intrinsics.txt").write_text("60 0 31.5\n0 60 23.5\n0 0 1\n")
    (tmp_path / "folder/intrinsics.json").write_text(json.dumps(CAMERA))
    write_images(tmp_path / "tum/rgb/1.0.png", tmp_path / "tum/depth/1.0.png")
    for name in ("rgb", "depth"):
        (tmp_path / f"tum/{name}.txt").write_text(f"1.0 {name}/1.0.png\n")
    (tmp_path / "tum/intrinsics.json").write_text(json.dumps(CAMERA))
    write_images(tmp_path / "rgbd-scenes-v1/desk_1/desk_1_1.png", tmp_path / "rgbd-scenes-v1/desk_1/desk_1_1_depth.png")
    scene = tmp_path / "rgbd-scenes-v2/imgs/scene_01"
    write_images(scene / "00000-color.png", scene / "00000-depth.png")
    for place in ("kitti/velodyne/000000.bin", "pcd/1.pcd"):
        (tmp_path / place).parent.mkdir(parents=True)
    np.ones((4, 4), dtype=np.float32).tofile(tmp_path / "kitti/velodyne/000000.bin")
    (tmp_path / "kitti/calib.txt").write_text(f"P0: {'1 ' * 12}\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    (tmp_path / "pcd/1.pcd").write_text("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n")
    return tmp_path


NAMES = {"7scenes": "7scenes-seq-01", "kitti": "kitti-kitti", "rgbd-scenes-v1": "desk_1", "rgbd-scenes-v2": "scene_01"}


@pytest.mark.parametrize("dataset", [name for name in DATASETS if name != "ros"])  # bags have tests of their own
@pytest.mark.parametrize("told", [False, True])
def test_each_layout_is_recognised(recordings: Path, dataset: str, told: bool) -> None:
    sequence = open_sequence(recordings / dataset, dataset if told else None)
    assert sequence.name == NAMES.get(dataset, dataset)
    assert len(sequence) == (4 if dataset in ("7scenes", "folder") else 1)
    assert isinstance(sequence, RgbdScenesV1) == (dataset == "rgbd-scenes-v1")
    assert isinstance(sequence, RgbdScenesV2) == (dataset == "rgbd-scenes-v2")


def test_a_string_stride_and_a_number_of_frames(recordings: Path) -> None:
    sequence = open_sequence(str(recordings / "folder"), stride=2, max_frames=5)
    assert [f.name for f in sequence] == ["0", "2"]
    np.testing.assert_array_equal(sequence.stamps, open_folder(recordings / "folder").stamps[::2])


def test_a_missing_path_and_a_file_are_told(recordings: Path) -> None:
    with pytest.raises(InputError, match=r"no such folder; check the path, or use sample:NAME"):
        open_sequence(recordings / "nowhere")
    with pytest.raises(InputError, match=r"the folder of a sequence \(tum\), found a file"):
        open_sequence(recordings / "tum/rgb.txt", "tum")


def test_where_nothing_is_recognised_everything_looked_for_is_listed(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        open_sequence(tmp_path)
    assert all(loader.layout in str(error.value) for loader in LOADERS)
    assert "an empty folder" in error.value.found
    for i in range(8):
        (tmp_path / f"part-{i}").mkdir()
    with pytest.raises(InputError, match="found part-0, part-1, part-2, part-3, part-4 and 3 more"):
        open_sequence(tmp_path)


def test_a_map_is_no_sequence_and_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "map.json").write_text("{}")
    with pytest.raises(InputError, match="found the map that a run wrote; `thingmap query`"):
        open_sequence(tmp_path)


def test_only_the_named_dataset_is_looked_for(recordings: Path) -> None:
    with pytest.raises(InputError) as error:
        open_sequence(recordings / "folder", "7scenes")
    assert error.value.expected.startswith("frame-000000.color.png")
    assert "rgb.txt" not in error.value.expected
    with pytest.raises(InputError, match="color: expected a folder of images"):
        open_sequence(recordings / "tum", "folder")


def test_several_sequences_are_listed(recordings: Path, write_images) -> None:
    for name in ("seq-02", "seq-03"):
        write_images(
            recordings / f"7scenes/{name}/frame-000000.color.png", recordings / f"7scenes/{name}/frame-000000.depth.png"
        )
    with pytest.raises(InputError) as error:
        open_sequence(recordings / "7scenes")
    assert all(f"seq-0{i} (7scenes)" in error.value.found for i in (1, 2, 3))


def test_two_layouts_at_one_path_are_listed_and_a_name_decides(recordings: Path, write_images) -> None:
    write_images(recordings / "tum/color/a.png", recordings / "tum/depth/a.png")
    with pytest.raises(InputError, match=r"\(tum\), .*\(folder\); give one of these folders, and its dataset"):
        open_sequence(recordings / "tum")
    assert len(open_sequence(recordings / "tum", "tum")) == 1


def test_an_unknown_dataset_is_told(recordings: Path) -> None:
    with pytest.raises(UserError, match="unknown dataset 'scannet'; known are 7scenes, tum, rgbd-scenes-v1"):
        open_sequence(recordings / "tum", "scannet")


def test_samples_are_opened_by_name(recordings: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    sample = ModuleType("sample")
    sample.open_sample = lambda name: asked.append(name) or open_folder(recordings / "folder")  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "thingmap.datasets.synthetic.sample", sample)
    assert len(open_sequence("sample:desk", stride=3)) == 2
    assert asked == ["desk"]

from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.tum_keyframes import find_tum_keyframes, open_tum_keyframes

SETTINGS = "%YAML:1.0\nCamera.fx: 53.5\nCamera.fy: 53.9\nCamera.cx: 32.0\nCamera.cy: 24.8\nDepthMapFactor: 5000.0\n"


@pytest.fixture
def cabinet(tmp_path: Path, write_images, pose, tum_row) -> Path:
    folder = tmp_path / "fr3_cabinet"
    (folder / "benchun_gt").mkdir(parents=True)
    lists = {"rgb": "", "depth": ""}
    poses = ""
    for i in range(3):
        files = {"rgb": f"raw_imgs/{i:04d}_rgb_raw.png", "depth": f"depth_imgs/{i:04d}_depth_raw.png"}
        write_images(folder / "data" / files["rgb"], folder / "data" / files["depth"], seed=i)
        for name, file in files.items():
            lists[name] += f"{i} {file}\n"
        poses += tum_row(1341841278.5 + 0.7 * i, pose(i))
    for name, rows in lists.items():
        (folder / f"benchun_gt/{name}.txt").write_text("# timestamp filename\n" + rows)
    (folder / "benchun_gt/truth_cam_poses.txt").write_text(poses)
    (folder / "benchun_gt/TUM3.yaml").write_text(SETTINGS)
    return folder


def test_keyframes_pair_by_number_and_take_stamp_and_pose_of_their_row(cabinet: Path, pose, write_images) -> None:
    sequence = open_tum_keyframes(cabinet)
    assert (len(sequence), sequence.name) == (3, "fr3_cabinet")
    assert sequence.intrinsics == Intrinsics(64, 48, 53.5, 53.9, 32.0, 24.8)
    np.testing.assert_allclose(sequence.stamps, 1341841278.5 + 0.7 * np.arange(3), atol=1e-6)
    np.testing.assert_array_equal(sequence.gravity, [0, 0, -1])
    frame = sequence[2]
    assert frame.name == "0002"
    np.testing.assert_allclose(frame.T_world_camera, pose(2), atol=1e-8)
    rgb, raw = write_images(cabinet / "again.png", cabinet / "again_depth.png", seed=2)
    np.testing.assert_array_equal(frame.color, rgb)
    np.testing.assert_allclose(frame.depth, raw / 5000, rtol=1e-6)


def test_they_are_found_from_both_parts_of_the_folder(cabinet: Path) -> None:
    for path in (cabinet, cabinet / "benchun_gt", cabinet / "data"):
        assert [p.resolve() for p in find_tum_keyframes(path)] == [cabinet.resolve()]
    assert find_tum_keyframes(cabinet.parent) == []


def test_lists_of_different_length_are_told(cabinet: Path) -> None:
    path = cabinet / "benchun_gt/truth_cam_poses.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:2]))
    with pytest.raises(InputError, match="3 colour images, 3 depth images, 2 poses"):
        open_tum_keyframes(cabinet)

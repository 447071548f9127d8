import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sample import TabletopConfig, TabletopSequence

MUG = {"name": "white mug", "class": "cup", "position": [1, 2.5, 3], "tolerance": 0.08}
BOWL = {"class": "bowl", "position": [1, 2, 3]}
SETTINGS = "%YAML:1.0\nCamera.fx: 53.5\nCamera.fy: 53.9\nCamera.cx: 32.0\nCamera.cy: 24.8\n"


@pytest.fixture(scope="module")
def rendered() -> TabletopSequence:
    return TabletopSequence(TabletopConfig(objects=3, frames=3, width=64))


@pytest.fixture(scope="module")
def written(rendered: TabletopSequence, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("truth") / "table"
    write_sequence(rendered, folder)
    return folder


@pytest.fixture
def kitchen(tmp_path: Path, write_images, pose) -> Path:
    """7-Scenes with poses and gravity."""
    folder = tmp_path / "kitchen"
    for number in range(3):
        stem = f"frame-{number:06d}"
        write_images(folder / f"{stem}.color.png", folder / f"{stem}.depth.png", seed=number)
        np.savetxt(folder / f"{stem}.pose.txt", pose(number))
    (folder / "camera-intrinsics.txt").write_text("60 0 31.5\n0 60 23.5\n0 0 1\n")
    (folder / "gravity-direction.txt").write_text("0 1 0")
    return folder


def write_objects(path: Path) -> Path:
    path.write_text(json.dumps({"objects": [MUG], "known_false_detections": [BOWL]}))
    return path


def test_a_line_and_its_files_tell_the_same(rendered: TabletopSequence, written: Path) -> None:
    for spec in ("sample:tabletop?objects=3&frames=3&width=64", str(written), written / "truth" / "truth.json"):
        truth = open_truth(spec)
        assert truth.complete and truth.sequence is not None and truth.classes == rendered.classes
        assert (truth.names, truth.intrinsics) == (rendered.names, rendered.intrinsics)
        np.testing.assert_array_equal(truth.up, [0, 0, 1])
        np.testing.assert_array_equal(truth.stamps, rendered.stamps)
        np.testing.assert_allclose(truth.poses, rendered.poses, atol=1e-11)
        assert truth.located == truth.objects and len(truth.objects) == 3 and truth.tolerance == {}
        assert truth.frame_truth is not None and truth.point_truth is not None
        np.testing.assert_array_equal(truth.frame_truth(2).xyxy, rendered.truth(2).xyxy)
        np.testing.assert_array_equal(truth.point_truth().object_id, rendered.point_truth().object_id)


def test_the_file_of_a_truth_is_known_in_its_own_folder(written: Path, monkeypatch) -> None:
    monkeypatch.chdir(written / "truth")
    assert len(open_truth("truth.json").objects) == 3


def test_homes_of_nobody_are_told() -> None:
    for spec in ("~no such user/table", "synth:tabletop?meshes=~no such user/scans"):
        with pytest.raises(InputError, match="without ~"):
            open_truth(spec)


def test_a_synthetic_line(tmp_path: Path) -> None:
    truth = open_truth("synth:tabletop?objects=2&frames=2&width=64&clutter=low")
    assert len(truth.objects) == 2 and truth.complete
    assert truth.frame_truth is not None and truth.point_truth is not None and truth.poses is not None
    with pytest.raises(UserError, match="attic"):
        open_truth("synth:attic")


def test_a_recording_has_its_poses(kitchen: Path, pose) -> None:
    truth = open_truth(kitchen)
    assert (truth.name, truth.classes, truth.objects, truth.complete) == ("kitchen", (), (), False)
    assert truth.frame_truth is None and truth.point_truth is None and truth.sequence is not None
    np.testing.assert_allclose(truth.poses, [pose(k) for k in range(3)], atol=1e-12)
    np.testing.assert_array_equal(truth.up, [0, -1, 0])


def test_objects_and_their_sequence_find_each_other(kitchen: Path, tmp_path: Path, pose) -> None:
    inside = write_objects(kitchen / "objects_derived.json")
    alone = write_objects(tmp_path / "objects.json")
    for truth in (open_truth(kitchen), open_truth(inside), open_truth(alone, poses=kitchen)):
        assert (truth.classes, truth.complete, truth.tolerance) == (("cup", "bowl"), False, {0: 0.08, 1: 0.25})
        assert [thing.label for thing in truth.false_detections] == ["bowl"]
        assert truth.names == tuple(f"frame-{k:06d}" for k in range(3)) and truth.sequence is not None
        np.testing.assert_allclose(truth.poses, [pose(k) for k in range(3)], atol=1e-12)
        np.testing.assert_array_equal(truth.up, [0, -1, 0])
    truth = open_truth(alone)
    assert (truth.poses, truth.sequence, truth.up, len(truth.objects)) == (None, None, None, 1)
    (tmp_path / "alone").mkdir()
    assert len(open_truth(shutil.move(inside, tmp_path / "alone" / "objects_derived.json")).objects) == 1
    assert len(open_truth(tmp_path / "alone").objects) == 1


def test_poses_can_be_given_as_a_trajectory(kitchen: Path, tmp_path: Path, pose, tum_row) -> None:
    trajectory = tmp_path / "groundtruth.txt"
    trajectory.write_text("".join(tum_row(k / 30, pose(10 + k)) for k in range(3)))
    truth = open_truth(kitchen, poses=trajectory)
    np.testing.assert_allclose(truth.poses, [pose(10 + k) for k in range(3)], atol=1e-7)
    assert truth.names[0] == "frame-000000"
    truth = open_truth(write_objects(tmp_path / "objects.json"), poses=trajectory)
    assert truth.poses is not None and truth.poses.shape == (3, 4, 4) and truth.names == ()
    np.testing.assert_allclose(truth.stamps, np.arange(3) / 30, atol=1e-8)
    late = tmp_path / "late.txt"
    late.write_text(tum_row(1e9, pose(0)))
    with pytest.raises(InputError, match=r"late\.txt"):
        open_truth(kitchen, poses=late)
    with pytest.raises(InputError, match="poses of the frames, found none"):
        open_truth(trajectory, poses=tmp_path / "objects.json")


def test_poses_of_another_sequence_are_refused(kitchen: Path, written: Path) -> None:
    (kitchen / "frame-000002.color.png").unlink()
    (kitchen / "frame-000002.depth.png").unlink()
    with pytest.raises(InputError, match="a pose for each of the 2 frames, found 3 poses"):
        open_truth(kitchen, poses=written)


def test_a_trajectory_alone(tmp_path: Path, pose, tum_row) -> None:
    (tmp_path / "groundtruth.txt").write_text("# x\n" + "".join(tum_row(5.0 + k, pose(k)) for k in (1, 0)))
    for spec in (tmp_path, tmp_path / "groundtruth.txt"):
        truth = open_truth(spec)
        np.testing.assert_allclose(truth.stamps, [5, 6])
        np.testing.assert_allclose(truth.poses, [pose(0), pose(1)], atol=1e-8)
        assert (truth.names, truth.classes, truth.complete, truth.sequence) == ((), (), False, None)
    (tmp_path / "groundtruth.txt").write_text("# nothing\n")
    with pytest.raises(InputError, match="no pose"):
        open_truth(tmp_path / "groundtruth.txt")


@pytest.fixture
def cabinet(tmp_path: Path, write_images, pose, tum_row) -> Path:
    folder = tmp_path / "fr3_cabinet"
    (folder / "benchun_gt").mkdir(parents=True)
    for name, file in (("rgb", "raw_imgs/0000_rgb.png"), ("depth", "depth_imgs/0000_depth.png")):
        (folder / f"benchun_gt/{name}.txt").write_text(f"0 {file}\n")
    write_images(folder / "data/raw_imgs/0000_rgb.png", folder / "data/depth_imgs/0000_depth.png")
    (folder / "benchun_gt/truth_cam_poses.txt").write_text(tum_row(1e9, pose(0)))
    (folder / "benchun_gt/TUM3.yaml").write_text(SETTINGS)
    (folder / "benchun_gt/truth_objects.txt").write_text("-1.5 0.4 0.28 3.1 0.4 0.2 0.27\n\n")
    return folder


def test_the_cuboid_of_the_keyframes(cabinet: Path) -> None:
    for spec in (cabinet, cabinet / "benchun_gt"):
        truth = open_truth(spec)
        assert (truth.classes, truth.complete, truth.tolerance) == (("cabinet",), True, {0: 0.03})
        (thing,) = truth.objects
        assert (thing.label, thing.yaw) == ("cabinet", 3.1)
        np.testing.assert_array_equal(thing.position, [-1.5, 0.4, 0.28])
        np.testing.assert_array_equal(thing.size, [0.8, 0.4, 0.54])
        np.testing.assert_array_equal(truth.up, [0, 0, 1])


@pytest.mark.parametrize("rows", ["", "1 2 3 nan 1 1 1", "1 2 3 0 1 0 1", "1 2 3", "a 2 3 0 1 1 1"])
def test_wrong_cuboids_are_told(cabinet: Path, rows: str) -> None:
    (cabinet / "benchun_gt/truth_objects.txt").write_text(rows)
    with pytest.raises(InputError, match=r"truth_objects\.txt"):
        open_truth(cabinet)


def test_what_is_not_understood_is_told_with_what_is(tmp_path: Path) -> None:
    (tmp_path / "truth.docx").write_text("a mug")
    (tmp_path / "empty").mkdir()
    cases = (
        (tmp_path / "nowhere", "no such file or folder"),
        (tmp_path / "truth.docx", "a file .docx"),
        (tmp_path / "empty", "an empty folder"),
        (tmp_path, "empty, truth.docx"),
        ("boxes.csv#desk", "no such file"),
    )
    for spec, found in cases:
        with pytest.raises(InputError) as error:
            open_truth(spec)
        for part in (found, "synth:PRESET", "TUM trajectory", "*.json", "pc/NN.pose"):
            assert part in str(error.value)


def test_a_recording_that_tells_nothing_is_refused(kitchen: Path) -> None:
    for file in kitchen.glob("*.pose.txt"):
        file.unlink()
    with pytest.raises(InputError, match="neither poses nor objects"):
        open_truth(kitchen)


def test_redkitchen(real_data: Path) -> None:
    truth = open_truth(real_data / "redkitchen" / "objects_derived.json")
    assert len(truth.names) == 600 and truth.poses is not None and truth.sequence is not None
    assert len(truth.located) == 7 and len(truth.false_detections) == 3 and not truth.complete
    assert truth.up is not None and truth.up[1] < -0.8
    # The first object, the white mug, lies in the view of some frame and there is a surface where it is said to be.
    mug, errors = truth.objects[0], []
    for index in range(0, 600, 60):
        frame = truth.sequence[index]
        assert frame.T_world_camera is not None
        point = np.linalg.inv(frame.T_world_camera) @ np.append(mug.position, 1.0)
        u, v = np.rint(frame.intrinsics.project(point[None, :3])[0]).astype(int)
        if point[2] > 0.3 and 3 < u < 636 and 3 < v < 476:
            patch = frame.depth[v - 3 : v + 4, u - 3 : u + 4]
            if patch.any():
                errors.append(abs(float(np.median(patch[patch > 0])) - point[2]))
    assert errors and min(errors) < truth.tolerance[mug.id]


def test_the_real_cabinet_is_where_depth_sees_it(real_data: Path) -> None:
    truth = open_truth(real_data / "tum_fr3_cabinet")
    (thing,) = truth.objects
    assert truth.sequence is not None
    frame = truth.sequence[8]
    assert frame.T_world_camera is not None
    v, u = np.nonzero(cv2.erode((frame.depth > 0).astype(np.uint8), np.ones((5, 5), np.uint8)))
    pixels = np.stack([u, v], axis=1).astype(float)
    points = frame.intrinsics.back_project(pixels, frame.depth[v, u].astype(float))
    points = points @ frame.T_world_camera[:3, :3].T + frame.T_world_camera[:3, 3] - thing.position
    cosine, sine = np.cos(thing.yaw), np.sin(thing.yaw)
    local = points @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    near = np.abs(local) < thing.size / 2 + 0.03
    inside, deep = near.all(axis=1), (np.abs(local) < thing.size / 2 - 0.05).all(axis=1)
    assert inside.sum() > 5000 and deep.sum() < 0.05 * inside.sum()  # its faces, and nothing within it

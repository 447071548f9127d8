"""A rendered sequence, written and opened again, is the same sequence."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.folder import open_folder
from thingmap.datasets.folder_truth import FolderWithTruth
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.files.written_config import plain_config, read_config
from thingmap.datasets.synthetic.rendering.sensor import IDEAL
from thingmap.datasets.synthetic.sample import TabletopConfig, TabletopSequence
from thingmap.datasets.truth import HasClutter, HasInstances, HasPointTruth, HasTruth
from thingmap.datasets.views import subset
from thingmap.detectors.simulated import SimulatedDetector

CONFIG = TabletopConfig(seed=2, objects=4, frames=5, width=160)


@pytest.fixture(scope="module")
def rendered() -> TabletopSequence:
    return TabletopSequence(CONFIG)


@pytest.fixture(scope="module")
def folder(rendered: TabletopSequence, tmp_path_factory) -> Path:
    """Written once; tests that change it take `copy`."""
    path = tmp_path_factory.mktemp("written") / "above" / "table"
    seen: list[int] = []
    written = write_sequence(rendered, path, seen.append)
    assert (written.folder, written.frames, written.complete) == (path, 5, True)
    assert seen == [1, 2, 3, 4, 5]
    size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    assert written.megabytes == pytest.approx(size / 1e6)
    return path


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_it_comes_back_with_all_its_truth(folder: Path, rendered: TabletopSequence) -> None:
    opened = open_folder(folder)
    for protocol in (HasTruth, HasClutter, HasInstances, HasPointTruth):
        assert isinstance(opened, protocol)
    assert isinstance(opened, FolderWithTruth)
    assert (opened.name, opened.source, opened.classes) == ("table", rendered.name, rendered.classes)
    assert (opened.names, opened.intrinsics, opened.gravity) == (rendered.names, rendered.intrinsics, None)
    np.testing.assert_array_equal(opened.stamps, rendered.stamps)
    np.testing.assert_allclose(opened.poses, rendered.poses, atol=1e-11)
    np.testing.assert_array_equal(opened.up, [0, 0, 1])
    for ours, theirs in ((opened.objects, rendered.objects), (opened.clutter, rendered.clutter)):
        for one, other in zip(ours, theirs, strict=True):
            assert (one.id, one.label, one.yaw) == (other.id, other.label, other.yaw)
            np.testing.assert_array_equal(one.position, other.position)
            np.testing.assert_array_equal(one.size, other.size)
    cloud, true_cloud = opened.point_truth(), rendered.point_truth()
    for name in ("points", "class_id", "object_id"):
        np.testing.assert_array_equal(getattr(cloud, name), getattr(true_cloud, name))


def test_every_frame_comes_back(folder: Path, rendered: TabletopSequence) -> None:
    opened = open_folder(folder)
    assert isinstance(opened, FolderWithTruth)
    for index in (*range(5), -1):
        frame, original = opened[index], rendered[index]
        assert (frame.index, frame.name, frame.stamp) == (original.index, original.name, original.stamp)
        np.testing.assert_array_equal(frame.depth > 0, original.depth > 0)
        assert np.abs(frame.depth - original.depth).max() <= 0.000101  # half a step of 0.2 mm
        assert (frame.color.astype(float) - original.color).std() < 4.0
        seen, truth = opened.truth(index), rendered.truth(index)
        for name in ("object_id", "xyxy", "xyxy_visible", "visibility", "part_visibility"):
            np.testing.assert_array_equal(getattr(seen, name), getattr(truth, name))
        np.testing.assert_array_equal(opened.instances(index), rendered.instances(index))
    for ask in (opened.truth, opened.instances):
        with pytest.raises(IndexError):
            ask(5)


def test_the_simulated_detector_finds_the_same_in_both(folder: Path, rendered: TabletopSequence) -> None:
    opened = open_folder(folder)
    assert isinstance(opened, FolderWithTruth)
    on_files, on_rendering = SimulatedDetector(opened, seed=1), SimulatedDetector(rendered, seed=1)
    count = 0
    for index in range(5):
        one, other = on_files(opened[index]), on_rendering(rendered[index])
        assert (one.classes, len(one)) == (other.classes, len(other))
        np.testing.assert_allclose(one.xyxy, other.xyxy, atol=0.02)  # spots lie on surfaces as they were measured
        np.testing.assert_allclose(one.scores, other.scores, atol=1e-9)
        count += len(one)
    assert count > 5


def test_views_of_it_keep_its_truth(folder: Path) -> None:
    opened = open_folder(folder)
    part = subset(opened, stride=2)
    assert isinstance(opened, FolderWithTruth)
    assert isinstance(part, HasTruth) and isinstance(part, HasInstances) and isinstance(part, HasPointTruth)
    np.testing.assert_array_equal(part.instances(1), opened.instances(2))
    np.testing.assert_array_equal(part.truth(2).xyxy, opened.truth(4).xyxy)


def test_what_was_written_can_be_rendered_and_written_again(folder: Path, tmp_path: Path) -> None:
    config = read_config(folder)
    assert config == CONFIG
    write_sequence(TabletopSequence(config), tmp_path / "again", workers=1)
    assert contents(tmp_path / "again") == contents(folder)


@pytest.mark.parametrize(
    "config",
    [
        TabletopConfig(seed=4, sensor=IDEAL),
        SyntheticConfig(),
        SyntheticConfig(Preset.LAPS, 7, ClutterLevel.HIGH, 5, 99, 320, Path("/scans"), 4, 2.7),
        SyntheticConfig(Preset.WALL, 0, pace=3.0),
        replace(SyntheticConfig(), sensor=replace(IDEAL, axial_sigma=0.1 + 0.2, grazing_cosines=(0.1, 0.3))),
    ],
)
def test_configurations_come_back_exactly(copy: Path, config) -> None:
    path = copy / "truth" / "truth.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"configuration": plain_config(config)}))
    assert read_config(copy) == config


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"kind": "Sculpture"}, "among SyntheticConfig, TabletopConfig, found 'Sculpture'"),
        ({"width": "wide"}, "'wide' where a int belongs"),
        ({"seed": True}, "True where a int belongs"),
        ({"sensor": {"warp": 1}}, "unknown values warp"),
        ({"sensor": {"grazing_cosines": [1.0]}}, "a TabletopConfig at configuration"),
        ({"sensor": 3}, "a TabletopConfig at configuration"),
        ({"sensor": []}, "[] where values by name belong"),
        ({"kind": []}, "found []"),
        ({"camera": {"gain": 10**400}}, "too large"),
        ({"objects": 500}, "expected objects from 1"),
    ],
)
def test_configurations_of_another_renderer_are_told(copy: Path, change: dict, part: str) -> None:
    path = copy / "truth" / "truth.json"
    document = json.loads(path.read_text())
    document["configuration"] |= change
    path.write_text(json.dumps(document))
    with pytest.raises(UserError) as error:
        read_config(copy)
    assert part in str(error.value)
    open_folder(copy)  # the sequence itself does not need it


def test_a_stop_leaves_a_shorter_whole_sequence(rendered: TabletopSequence, folder: Path, tmp_path: Path) -> None:
    done: list[int] = []
    written = write_sequence(rendered, tmp_path / "part", done.append, lambda: len(done) == 2, workers=2)
    assert (written.frames, written.complete, done) == (2, False, [1, 2])
    short = open_folder(tmp_path / "part")
    assert isinstance(short, FolderWithTruth)
    assert (len(short), short.names) == (2, rendered.names[:2])
    np.testing.assert_array_equal(short.instances(1), rendered.instances(1))
    np.testing.assert_allclose(short.poses, rendered.poses[:2], atol=1e-11)
    assert read_config(tmp_path / "part") == replace(CONFIG, frames=2)
    write_sequence(TabletopSequence(replace(CONFIG, frames=2)), tmp_path / "two")
    assert contents(tmp_path / "part") == contents(tmp_path / "two")


def test_overwriting_leaves_nothing_of_the_longer_one(rendered: TabletopSequence, copy: Path, tmp_path: Path) -> None:
    (copy / "notes.txt").write_text("mine")
    two = TabletopSequence(replace(CONFIG, frames=2))
    with pytest.raises(UserError, match=r"not empty.*--overwrite"):
        write_sequence(two, copy)
    assert len(open_folder(copy)) == 5
    write_sequence(two, copy, overwrite=True)
    write_sequence(two, tmp_path / "new")
    assert contents(copy) == contents(tmp_path / "new") | {"notes.txt": b"mine"}


def test_a_writing_that_was_killed_is_told_and_can_be_overwritten(rendered: TabletopSequence, tmp_path: Path) -> None:
    class Killed(BaseException):
        pass

    def kill(done: int) -> None:
        if done == 2:
            raise Killed

    with pytest.raises(Killed):
        write_sequence(rendered, tmp_path / "torn", kill, workers=1)
    with pytest.raises(InputError, match=r"the 5 frames of truth/truth\.json, found . frames without frame-00000"):
        open_folder(tmp_path / "torn")
    write_sequence(rendered, tmp_path / "torn", overwrite=True)
    assert len(open_folder(tmp_path / "torn")) == 5


@pytest.mark.parametrize("name", ["color/extra.jpg", "depth/frame-000009.png", "accelerometer.txt", "truth/more"])
def test_files_of_somebody_else_are_never_replaced(rendered: TabletopSequence, copy: Path, name: str) -> None:
    (copy / name).write_bytes(b"mine")
    before = contents(copy)
    with pytest.raises(InputError, match=name):
        write_sequence(rendered, copy, overwrite=True)
    assert contents(copy) == before


def test_recordings_are_never_replaced(rendered: TabletopSequence, copy: Path) -> None:
    shutil.rmtree(copy / "truth")
    before = contents(copy)
    with pytest.raises(InputError, match="color, depth"):
        write_sequence(rendered, copy, overwrite=True)
    assert contents(copy) == before
    with pytest.raises(InputError, match="a file"):
        write_sequence(rendered, copy / "poses.txt")


def test_a_disk_that_takes_no_image_is_told(rendered: TabletopSequence, tmp_path: Path) -> None:
    def spoil(done: int) -> None:
        shutil.rmtree(tmp_path / "out" / "depth")

    with pytest.raises(UserError, match=r"depth.*cannot be written"):
        write_sequence(rendered, tmp_path / "out", spoil, workers=1)


@pytest.mark.parametrize(
    ("damage", "parts"),
    [
        (lambda f: (f / "truth/truth.json").unlink(), ["truth.json", "no such file"]),
        (lambda f: (f / "truth/truth.json").write_text("{"), ["truth.json", "no JSON"]),
        (lambda f: (f / "truth/frames.npz").unlink(), ["frames.npz", "no such file"]),
        (lambda f: (f / "truth/frames.npz").write_bytes(b"PK"), ["frames.npz", "damaged"]),
        (lambda f: (f / "truth/cloud.ply").unlink(), ["cloud.ply", "no such file"]),
        (lambda f: shutil.rmtree(f / "truth/instances"), ["instances", "no such file or folder"]),
        (lambda f: (f / "truth/instances/000002.png").unlink(), ["000002.png", "no such file"]),
        (lambda f: (f / "truth/instances/000002.png").write_bytes(b"x"), ["000002.png", "cannot be decoded"]),
        (lambda f: (f / "truth/cloud.ply").write_bytes(b"ply"), ["cloud.ply", "a point cloud"]),
    ],
)
def test_damaged_truth_is_told(copy: Path, damage, parts: list[str]) -> None:
    damage(copy)
    with pytest.raises(InputError) as error:
        opened = open_folder(copy)
        assert isinstance(opened, FolderWithTruth) and isinstance(opened, HasPointTruth)
        opened.instances(2)
        opened.point_truth()
    for part in (*parts, "thingmap synth"):
        assert part in str(error.value)


def test_truth_of_other_frames_is_told(copy: Path) -> None:
    for name in ("color/frame-000003.jpg", "depth/frame-000003.png"):
        (copy / name).unlink()
    rows = (copy / "poses.txt").read_text().splitlines()
    (copy / "poses.txt").write_text("\n".join(rows[:-1]))
    with pytest.raises(InputError, match="found 4 frames without frame-000003"):
        open_folder(copy)
    for kind, suffix in (("color", "jpg"), ("depth", "png")):
        for name in ("frame-000003", "frame-000007"):
            shutil.copy(copy / kind / f"frame-000001.{suffix}", copy / kind / f"{name}.{suffix}")
    (copy / "poses.txt").write_text("\n".join([*rows, rows[-1]]))
    with pytest.raises(InputError, match="found 6 frames with frame-000007 besides"):
        open_folder(copy)


def test_without_its_truth_it_is_a_recording(copy: Path) -> None:
    shutil.rmtree(copy / "truth")
    opened = open_folder(copy)
    assert len(opened) == 5 and not isinstance(opened, HasTruth)
    np.testing.assert_allclose(opened.stamps, np.arange(5) / 30.0)

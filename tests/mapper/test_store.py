import os

import numpy as np
import pytest
from plyfile import PlyData
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.map.atomic import replacing, write_atomic
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.run_report import RunReport
from thingmap.mapper.saving import save_run


@pytest.fixture
def report():
    return RunReport("tiny", 3, 3, 2, 3, {}, None, 1.5, {}, 100.0)


def test_a_full_folder_is_refused_and_stays_as_it_is(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(UserError, match=r"not empty.*--overwrite"):
        OutputFolder.create(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_overwriting_replaces_our_files_and_nothing_else(tmp_path, fake_mapper, tiny_sequence, report):
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / "sub").mkdir()
    (tmp_path / "map.json").write_text("old")
    folder = OutputFolder.create(tmp_path, overwrite=True)
    assert (tmp_path / "map.json").read_text() == "old"  # until the new one is whole
    mapper = fake_mapper()
    for frame in tiny_sequence(3):
        mapper.process_frame(frame)
    save_run(folder, mapper, report, config="seed: 0\n", command={"sequence": "tiny"})
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *(
            "cloud.ply",
            "config.yaml",
            "keyframes.npz",
            "ledger.npz",
            "map.json",
            "mine.txt",
            "report.json",
            "sub",
            "trajectory.txt",
        )
    ]
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert len(folder.read_map()) == 3
    assert folder.read_report()["mapper"] == {"keyframes": 3}
    assert folder.read_report()["command"] == {"sequence": "tiny"}
    assert folder.ledger_file.read_bytes() == b"ledger of 3"
    assert folder.config_file.read_text() == "seed: 0\n"


def test_doubtful_things_are_saved_when_asked_for(tmp_path, fake_mapper, report):
    for name, doubtful in (("sure", False), ("all", True)):
        folder = OutputFolder.create(tmp_path / name)
        save_run(folder, fake_mapper(), report, config="", include_doubtful=doubtful)
    assert [len(OutputFolder.open(tmp_path / name).read_map()) for name in ("sure", "all")] == [0, 1]


def test_folders_are_made_with_their_parents(tmp_path):
    assert OutputFolder.create(tmp_path / "a" / "b").path.is_dir()
    OutputFolder.create(tmp_path / "a" / "b")  # still empty


def test_a_file_is_no_folder(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(InputError, match="a folder to write to, found a file"):
        OutputFolder.create(file, overwrite=True)
    with pytest.raises(UserError, match="cannot be written"):
        OutputFolder.create(file / "below")
    with pytest.raises(InputError, match="output folder of a run, found a file"):
        OutputFolder.open(file)


def test_opening_wants_a_map(tmp_path):
    with pytest.raises(InputError, match=r"no map\.json in it"):
        OutputFolder.open(tmp_path)
    with pytest.raises(InputError, match="found nothing"):
        OutputFolder.open(tmp_path / "absent")


def test_a_failure_while_writing_leaves_the_old_file_and_no_other(tmp_path):
    file = tmp_path / "map.json"
    file.write_text("old")
    with pytest.raises(RuntimeError, match="power cut"), replacing(file) as temporary:
        temporary.write_text("half")
        raise RuntimeError("power cut")
    assert [path.name for path in tmp_path.iterdir()] == ["map.json"]
    assert file.read_text() == "old"


def test_temporary_files_keep_the_suffix_and_the_usual_permissions(tmp_path):
    with replacing(tmp_path / "ledger.npz") as temporary:
        assert temporary.suffix == ".npz" and temporary.parent == tmp_path
        temporary.write_bytes(b"")
    write_atomic(tmp_path / "a.txt", b"text")
    umask = os.umask(0)
    os.umask(umask)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o666 & ~umask


def test_a_place_that_cannot_be_written_is_a_users_mistake(tmp_path):
    with pytest.raises(UserError, match=r"absent.a\.txt: cannot be written \(No such file"):
        write_atomic(tmp_path / "absent" / "a.txt", b"")


def test_trajectory_is_tum_and_reads_back(tmp_path):
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, :3] = Rotation.random(5, rng=rng).as_matrix()
    poses[:, :3, 3] = rng.normal(size=(5, 3))
    stamps = 1311868164.363181 + 0.033 * np.arange(5)
    folder = OutputFolder.create(tmp_path)
    folder.write_trajectory(stamps, poses)
    rows = np.loadtxt(folder.trajectory_file)
    assert rows.shape == (5, 8)
    np.testing.assert_allclose(rows[:, 1:4], poses[:, :3, 3], atol=1e-6)
    np.testing.assert_allclose(Rotation.from_quat(rows[:, 4:]).as_matrix(), poses[:, :3, :3], atol=1e-7)
    read_stamps, read_poses = folder.read_trajectory()
    np.testing.assert_allclose(read_stamps, stamps, atol=1e-6)
    np.testing.assert_allclose(read_poses, poses, atol=1e-6)


def test_an_empty_trajectory_and_cloud(tmp_path):
    folder = OutputFolder.create(tmp_path)
    folder.write_trajectory(np.empty(0), np.empty((0, 4, 4)))
    folder.write_cloud(np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8))
    stamps, poses = folder.read_trajectory()
    assert stamps.shape == (0,) and poses.shape == (0, 4, 4)
    points, colors = folder.read_cloud()
    assert points.shape == (0, 3) and colors.shape == (0, 3)


def test_cloud_is_binary_and_coloured(tmp_path):
    folder = OutputFolder.create(tmp_path)
    points = np.random.default_rng(0).normal(size=(1000, 3))
    colors = np.random.default_rng(1).integers(0, 256, (1000, 3), dtype=np.uint8)
    folder.write_cloud(points, colors)
    assert folder.cloud_file.read_bytes().startswith(b"ply\nformat binary_little_endian 1.0\n")
    assert PlyData.read(str(folder.cloud_file))["vertex"].data.dtype.names == ("x", "y", "z", "red", "green", "blue")
    read_points, read_colors = folder.read_cloud()
    np.testing.assert_allclose(read_points, points, atol=1e-6)
    np.testing.assert_array_equal(read_colors, colors)


def test_a_cloud_without_colours_is_named(tmp_path):
    folder = OutputFolder.create(tmp_path / "out")
    header = "ply\nformat ascii 1.0\nelement vertex 1\n"
    header += "".join(f"property {kind}\n" for kind in ("float x", "float y", "float z", "uchar red"))
    folder.cloud_file.write_text(header + "end_header\n1 2 3 4\n")
    with pytest.raises(InputError, match=r"cloud\.ply.*without green, blue.*thingmap run"):
        folder.read_cloud()


def test_damaged_files_are_named(tmp_path):
    folder = OutputFolder.create(tmp_path)
    folder.cloud_file.write_text("no ply")
    folder.trajectory_file.write_text("1 2 3\n")
    folder.report_file.write_text("{")
    for read, name in ((folder.read_cloud, "cloud.ply"), (folder.read_trajectory, "trajectory.txt")):
        with pytest.raises(InputError, match=name):
            read()
    with pytest.raises(InputError, match="lines of 8 numbers, found a line of 3"):
        folder.read_trajectory()
    with pytest.raises(InputError, match=r"report\.json: expected a report in JSON"):
        folder.read_report()


def test_reports_are_strict_json(tmp_path, report):
    folder = OutputFolder.create(tmp_path)
    folder.write_report(
        {**report.to_dict(), "mapper": {"rates": np.array([1.0, np.nan]), "n": np.int64(3), 7: tmp_path}}
    )
    assert folder.read_report()["frames_per_second"] == 2.0
    assert folder.read_report()["mapper"] == {"rates": [1.0, None], "n": 3, "7": str(tmp_path)}


class LabellingMapper:
    """A mapper that says what its points are, in place of one that does not."""

    def __init__(self, mapper, labels) -> None:
        self._mapper, self._labels = mapper, labels

    def __getattr__(self, name):
        return getattr(self._mapper, name)

    def point_labels(self):
        return self._labels


def mapped(tiny_sequence, fake_mapper):
    mapper = fake_mapper()
    for frame in tiny_sequence(3):
        mapper.process_frame(frame)
    return mapper


def test_labels_of_points_are_read_back_by_the_evaluator(tmp_path, fake_mapper, tiny_sequence, report):
    labels = np.array([1, -1, 0])
    mapper = LabellingMapper(mapped(tiny_sequence, fake_mapper), labels)
    save_run(OutputFolder.create(tmp_path), mapper, report, config="")
    points, found = load_run(tmp_path).cloud()
    np.testing.assert_array_equal(found, labels)
    np.testing.assert_allclose(points, mapper.cloud()[0])
    content = PlyData.read(str(tmp_path / "labels.ply"))
    assert content.comments == ['label 1 "cup"', 'label 2 "bowl"']
    assert content["vertex"]["label"].tolist() == [2, 0, 1] and content["vertex"]["red"].tolist() == [7, 7, 7]


@pytest.mark.parametrize("can_label", [True, False])
def test_labels_of_an_earlier_run_do_not_pass_for_those_of_this_one(
    tmp_path, fake_mapper, tiny_sequence, report, can_label
):
    mapper = mapped(tiny_sequence, fake_mapper)
    (tmp_path / "labels.ply").write_bytes(b"of another cloud")
    folder = OutputFolder.create(tmp_path, overwrite=True)
    save_run(folder, LabellingMapper(mapper, None) if can_label else mapper, report, config="")
    assert not folder.labels_file.exists()
    assert (tmp_path / "labels.earlier.ply").read_bytes() == b"of another cloud"
    assert load_run(tmp_path).cloud()[1] is None

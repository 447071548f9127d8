"""Reading the output of a run: all of it comes back, and every damage is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData, PlyElement

from thingmap.datasets.errors import InputError
from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.evaluation.result import NotEvaluated
from thingmap.mapper.map.store import OutputFolder

GREY = 127


@pytest.fixture
def out(tmp_path: Path, scene_truth, perfect_run) -> Path:
    """The folder of a perfect run, with snapshots after 3 and 7 frames and keyframes."""
    run = perfect_run(scene_truth)
    folder = OutputFolder.create(tmp_path / "out")
    points, _ = run.cloud()
    folder.write_trajectory(run.stamps, run.poses)
    folder.write_cloud(points, np.full((len(points), 3), GREY, dtype=np.uint8))
    folder.write_report(dict(run.report))
    folder.write_map(run.object_map)
    np.savez(
        folder.keyframes_file,
        stamps=run.keyframes.stamps,
        T_world_camera=run.keyframes.poses,
        covariance=run.keyframes.covariances,
    )
    folder.snapshot_folder.mkdir()
    entries = []
    for snapshot in (run.snapshots[6], run.snapshots[2]):
        name = f"{snapshot.frames:06d}.json"
        snapshot.object_map.save(folder.snapshot_folder / name, include_doubtful=True)
        pose = snapshot.T_world_camera.tolist()
        entries.append({"frames": snapshot.frames, "file": name, "stamp": snapshot.stamp, "T_world_camera": pose})
    write_index(folder.path, entries)
    return folder.path


def index_of(out: Path) -> Path:
    return out / "snapshots" / "index.json"


def write_index(out: Path, entries: list[dict], schema: str = "thingmap-snapshots/1") -> None:
    index_of(out).write_text(json.dumps({"schema": schema, "snapshots": entries}))


def read_index(out: Path) -> list[dict]:
    return json.loads(index_of(out).read_text())["snapshots"]


def write_labels(out: Path, labels: list, comments: tuple[str, ...] = (), field: str = "label", kind: str = "<i4"):
    vertices = np.zeros(len(labels), dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), (field, kind)])
    vertices[field] = labels
    PlyData([PlyElement.describe(vertices, "vertex")], comments=list(comments)).write(str(out / "labels.ply"))


def test_everything_comes_back(out: Path, scene_truth, perfect_run) -> None:
    run, loaded = perfect_run(scene_truth), load_run(out)
    np.testing.assert_allclose(loaded.stamps, run.stamps, atol=1e-6)
    np.testing.assert_allclose(loaded.poses, run.poses, atol=2e-6)
    assert [thing.id for thing in loaded.object_map.things] == [thing.id for thing in run.object_map.things]
    assert loaded.report["peak_memory_mb"] == 512.0
    assert [s.frames for s in loaded.snapshots] == [3, 7]
    np.testing.assert_allclose(loaded.snapshots[1].T_world_camera, run.poses[6], atol=1e-9)
    assert len(loaded.snapshots[1].object_map) == 8
    assert loaded.keyframes is not None
    np.testing.assert_allclose(loaded.keyframes.poses, run.keyframes.poses, atol=1e-9)
    points, labels = loaded.cloud()
    np.testing.assert_allclose(points, run.cloud()[0], atol=1e-5)
    assert labels is None


def test_what_is_optional_may_be_absent(out: Path) -> None:
    index_of(out).unlink()
    (out / "keyframes.npz").unlink()
    (out / "cloud.ply").unlink()
    loaded = load_run(out)
    assert loaded.snapshots == () and loaded.keyframes is None
    with pytest.raises(NotEvaluated, match=r"cloud\.ply"):
        loaded.cloud()


@pytest.mark.parametrize(
    ("file", "content", "complaint"),
    [
        ("trajectory.txt", None, "no such file"),
        ("trajectory.txt", "# nothing\n", "the pose of a frame"),
        ("trajectory.txt", "1.0 0 0 0 0 0 0\n", "7 fields"),
        ("trajectory.txt", "1.0 0 0 0 0 0 0 2\n", "length 2"),
        ("trajectory.txt", "1.0 0 0 0 0 0 0 nan\n", "the pose of a frame"),
        ("report.json", None, "report"),
        ("report.json", "{", "report"),
        ("report.json", "[]", "list"),
        ("map.json", "{}", "schema"),
        ("snapshots/000007.json", None, "000007"),
        ("snapshots/000007.json", "[]", "000007"),
        ("snapshots/index.json", "{", "index"),
        ("snapshots/index.json", "{}", "schema"),
        ("keyframes.npz", "PK", "keyframes"),
        ("keyframes.npz", "", "keyframes"),
    ],
)
def test_a_damaged_file_is_named(out: Path, file: str, content: str | None, complaint: str) -> None:
    path = out / file
    if content is None:
        path.unlink()
    else:
        path.write_text(content)
    with pytest.raises(InputError, match=complaint) as caught:
        load_run(out)
    assert caught.value.path == path and caught.value.remedy


def test_a_folder_without_a_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no map\.json"):
        load_run(tmp_path)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"file": "../map.json"}, "beside it"),
        ({"frames": -1}, "whole number"),
        ({"frames": 7}, "two after 7"),
        ({"frames": 0}, "after 0 frames"),
        ({"frames": 4}, "after 4 frames at 100.2"),
        ({"frames": 41}, "40 frames of trajectory"),
        ({"stamp": "now"}, "a number"),
        ({"T_world_camera": [[1.0] * 4] * 4}, "000003"),
        ({"T_world_camera": [[1.0] * 4] * 3}, "4 x 4"),
    ],
)
def test_a_wrong_index_of_snapshots_is_refused(out: Path, change: dict, complaint: str) -> None:
    last, first = read_index(out)
    write_index(out, [last, {**first, **change}])
    with pytest.raises(InputError, match=complaint):
        load_run(out)


def test_snapshots_of_another_schema_are_refused(out: Path) -> None:
    write_index(out, read_index(out), "thingmap-snapshots/2")
    with pytest.raises(InputError, match="thingmap-snapshots/1"):
        load_run(out)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"covariance": None}, "covariance"),
        ({"stamps": np.zeros(3)}, r"\(M, 4, 4\)"),
        ({"stamps": np.full(10, np.nan)}, "finite stamps"),
        ({"stamps": np.array(["a"] * 10)}, "archive"),
        ({"T_world_camera": np.zeros((10, 4, 4))}, "keyframe 0"),
        ({"covariance": np.tile(-np.eye(6), (10, 1, 1))}, "negative eigenvalue"),
        ({"covariance": np.tile(np.triu(np.ones((6, 6))), (10, 1, 1))}, "symmetric"),
        ({"covariance": np.full((10, 6, 6), np.nan)}, "covariances"),
    ],
)
def test_wrong_keyframes_are_refused(out: Path, change: dict, complaint: str) -> None:
    with np.load(out / "keyframes.npz") as content:
        arrays = {**content, **change}
    np.savez(out / "keyframes.npz", **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=complaint):
        load_run(out)


def test_labels_are_indices_into_the_classes_of_the_map(out: Path) -> None:
    write_labels(out, [0, 3, -1, -7])
    points, labels = load_run(out).cloud()
    assert len(points) == 4 and labels is not None
    assert labels.tolist() == [0, 3, NO_OBJECT, NO_OBJECT]
    write_labels(out, [2, 1], field="class", kind="u1")
    labels = load_run(out).cloud()[1]
    assert labels is not None and labels.tolist() == [2, 1]


def test_comments_say_what_a_label_means(out: Path) -> None:
    write_labels(out, [0, 1, 5, 2], comments=('label 1 "Cup"', 'label 5 "soda can"', "made by hand"))
    labels = load_run(out).cloud()[1]
    assert labels is not None and labels.tolist() == [NO_OBJECT, 2, 3, NO_OBJECT]


@pytest.mark.parametrize(
    ("labels", "comments", "options", "complaint"),
    [
        ([0, 4], (), {}, "below 4"),
        ([0, 1], ('label 1 "car"',), {}, "car"),
        ([0, 1], ("label one cup",), {}, "label one cup"),
        ([0, 1], ("label 1 7",), {}, "label 1 7"),
        ([0, 1], (), {"field": "kind"}, "no such property"),
        ([0, 1], (), {"kind": "<f4"}, "float"),
    ],
)
def test_wrong_labels_are_refused(out: Path, labels, comments, options: dict, complaint: str) -> None:
    write_labels(out, labels, comments, **options)
    with pytest.raises(InputError, match=complaint) as caught:
        load_run(out).cloud()
    assert caught.value.path == out / "labels.ply"


def test_a_cloud_cut_short_is_refused(out: Path) -> None:
    for name in ("cloud.ply", "labels.ply"):
        if name == "labels.ply":
            write_labels(out, list(range(4)) * 100)
        content = (out / name).read_bytes()
        (out / name).write_bytes(content[: len(content) // 2])
        with pytest.raises(InputError, match=name):
            load_run(out).cloud()

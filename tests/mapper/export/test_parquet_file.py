"""Parquet tables, read by DuckDB and pandas."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.detectors.detections import Part
from thingmap.mapper.estimation.view_log import Verdict, ViewNote
from thingmap.mapper.export.parquet_file import export_parquet
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.views_file import ThingViews

pytest.importorskip("pyarrow", reason="pyarrow is not installed")


def note(keyframe: int, verdict: Verdict, score: float = np.nan) -> ViewNote:
    found = np.isfinite(score)
    return ViewNote(
        keyframe=keyframe,
        stamp=0.5 * keyframe,
        frame=f"frame-{keyframe:06d}",
        visible=np.linspace(1.0, 0.5, len(Part)),
        score=score,
        part=0 if found else -1,
        class_id=1 if found else -1,
        log_ratio=np.array([0.25, 2.0, -1.0]) if found else np.zeros(3),
        weight=0.5,
        verdict=verdict,
    )


@pytest.fixture
def seen_folder(tmp_path, make_thing, make_map) -> OutputFolder:
    """A cup that two views speak of, and a bowl that one does."""
    classes = ("spoon", "cup", "bowl")
    cup = ThingViews(classes, (note(0, Verdict.SUPPORTED, 0.75), note(3, Verdict.MISSED)), {})
    bowl = ThingViews(classes, (note(3, Verdict.OCCLUDED),), {})
    folder = OutputFolder.create(tmp_path / "seen")
    things = make_thing(1, "cup", views=cup), make_thing(2, "bowl", existence=0.6, views=bowl)
    folder.write_map(make_map(*things, classes=classes))
    return folder


def test_duckdb_reads_things(folder, tmp_path):
    duckdb = pytest.importorskip("duckdb")
    file = tmp_path / "things.parquet"
    assert export_parquet(folder, file) == 2
    rows = duckdb.sql(
        f"select id, class_posterior['cup'] as cup, position[3] as z, position_covariance[2][2] as var_y, "
        f"evidence.supporting as views, len(corners) as corners, points from '{file}' order by id"
    ).fetchall()
    assert rows == [("thing-0001", 0.9, 1.0, 4e-4, 12, 8, None), ("thing-0012", None, 1.2, 4e-4, 12, 8, None)] or (
        rows[1][1] == pytest.approx(0.2)
    )
    best = duckdb.sql(f"select id from '{file}' where label = 'bücher' and existence < 0.7").fetchall()
    assert best == [("thing-0012",)]


def test_pandas_reads_things(folder, tmp_path):
    pandas = pytest.importorskip("pandas")
    export_parquet(folder, tmp_path / "things.parquet")
    frame = pandas.read_parquet(tmp_path / "things.parquet").set_index("id")
    object_map = folder.read_map()
    for thing in object_map.things:
        row = frame.loc[thing.id]
        assert (row.label, row.probability, row.yaw) == (thing.label, thing.probability, thing.yaw)
        np.testing.assert_array_equal(row["size"], thing.size)
        np.testing.assert_array_equal(np.stack(row.position_covariance), thing.position_covariance)
        np.testing.assert_allclose(np.stack(row.corners), thing.corners(object_map.R_world_upright))
        assert dict(row.class_posterior) == pytest.approx(dict(thing.class_posterior))


def test_the_file_says_whose_axes(folder, tmp_path):
    from pyarrow import parquet

    export_parquet(folder, tmp_path / "things.parquet")
    about = {k.decode(): v.decode() for k, v in parquet.read_schema(tmp_path / "things.parquet").metadata.items()}
    assert about["thingmap.frame"] == "first camera" and about["thingmap.units"].startswith("metres")
    assert about["thingmap.source"] == "table"


def test_views_are_rows(seen_folder, tmp_path):
    duckdb = pytest.importorskip("duckdb")
    file = tmp_path / "views.parquet"
    assert export_parquet(seen_folder, file, table="views") == 3
    rows = duckdb.sql(
        f"select thing, keyframe, frame, says, score, found_as, visible.whole, visible.right, log_ratio['cup'] "
        f"from '{file}' order by thing, keyframe"
    ).fetchall()
    assert rows[0] == ("thing-0001", 0, "frame-000000", "supported", 0.75, "cup", 1.0, 0.5, 2.0)
    assert rows[1] == ("thing-0001", 3, "frame-000003", "contradicted", None, None, 1.0, 0.5, 0.0)
    assert rows[2][:4] == ("thing-0002", 3, "frame-000003", "said nothing")
    assert export_parquet(seen_folder, file, table="views", min_existence=0.9) == 2


def test_trajectories_tell_keyframes(folder, tmp_path):
    pandas = pytest.importorskip("pandas")
    file = tmp_path / "path.parquet"
    assert export_parquet(folder, file, table="trajectory") == 5
    frame = pandas.read_parquet(file)
    assert frame.keyframe.tolist() == [True, False, True, False, True]
    stamps, poses = folder.read_trajectory()
    np.testing.assert_allclose(frame.stamp, stamps)
    np.testing.assert_allclose(np.stack(frame.position), poses[:, :3, 3])
    folder.keyframes_file.unlink()
    export_parquet(folder, file, table="trajectory")
    assert pandas.read_parquet(file).keyframe.isna().all()


def test_a_map_of_nothing_keeps_its_columns(empty_folder, tmp_path):
    pandas = pytest.importorskip("pandas")
    for table, column in (("things", "class_posterior"), ("views", "log_ratio")):
        assert export_parquet(empty_folder, tmp_path / "a.parquet", table=table) == 0
        assert column in pandas.read_parquet(tmp_path / "a.parquet").columns


def test_mistakes_are_named(folder, tmp_path, monkeypatch):
    with pytest.raises(UserError, match="things, views, trajectory"):
        export_parquet(folder, tmp_path / "a.parquet", table="cups")
    with pytest.raises(UserError, match="without the views of its things"):
        export_parquet(folder, tmp_path / "a.parquet", table="views")
    monkeypatch.setitem(sys.modules, "pyarrow", None)  # makes its import fail
    with pytest.raises(UserError, match=r"\[parquet\]"):
        export_parquet(folder, tmp_path / "a.parquet")
    assert not list(tmp_path.glob("*.parquet"))

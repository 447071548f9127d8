"""The table of formats."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from thingmap.mapper.export import FORMATS, export_format, exporter, format_of

ELSEWHERE = ("rrd", "html")  # written by the viewers


@pytest.mark.parametrize("one", [one for one in FORMATS if one.name not in ELSEWHERE], ids=lambda one: one.name)
def test_options_are_those_of_the_function(one):
    parameters = inspect.signature(one.load()).parameters
    assert list(parameters)[:2] == ["folder", "file"]
    assert set(parameters) - {"folder", "file"} == set(one.options)
    assert all(parameters[name].default is not inspect.Parameter.empty for name in one.options)


def test_endings_tell_the_format():
    expected = {
        "a.json": "json",
        "a.dsg.json": "dsg",
        "a.coco.json": "coco",
        "A.GLB": "glb",
        "a.usdc": "usd",
        "b.geojson": "geojson",
        "a.parquet": "parquet",
        "page.html": "html",
    }
    for name, wanted in expected.items():
        found = format_of(Path("out") / name)
        assert found is not None and found.name == wanted
    for name in ("poses.txt", "map", "a.jsonl"):
        assert format_of(Path(name)) is None


def test_no_ending_stands_for_two_formats():
    endings = [ending for one in FORMATS for ending in one.endings]
    assert len(endings) == len(set(endings))


def test_names_of_formats():
    assert exporter("glb") is export_format("glb").load()
    with pytest.raises(ValueError, match="there are json, csv, ply, glb"):
        exporter("docx")


def test_the_table_imports_nothing_heavy():
    code = (
        "import sys; from thingmap.mapper.export import FORMATS; "
        "print([name for name in ('numpy', 'pxr', 'pyarrow', 'trimesh', 'spark_dsg', 'rerun') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

"""`thingmap export`."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app


def thingmap(*args: object):
    return CliRunner().invoke(app, [str(arg) for arg in args])


def assert_mistake(result, *parts: str) -> None:
    assert result.exit_code == 2, result.output
    assert len(result.stderr.strip().splitlines()) == 1
    for part in ("error: ", *parts):
        assert part in result.stderr


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("map.glb", "2 things"),
        ("map.gltf", "2 things"),
        ("plan.geojson", "2 things"),
        ("map.dsg.json", "2 things"),
        ("path.tum", "5 poses"),
        ("path.kitti", "5 poses"),
        ("map.csv", "2 things"),
    ],
)
def test_the_ending_is_enough(folder, tmp_path, name, says):
    result = thingmap("export", folder.path, "-o", tmp_path / name)
    assert result.exit_code == 0, result.output
    assert f"{says} are in {tmp_path / name}" in result.stdout
    assert (tmp_path / name).stat().st_size > 100


def test_options_reach_the_format(folder, tmp_path):
    plan = tmp_path / "plan.geojson"
    assert thingmap("export", folder.path, "-o", plan, "--origin", "-33.9,18.4").exit_code == 0
    assert json.loads(plan.read_text())["thingmap"]["origin"]["latitude"] == -33.9
    result = thingmap("export", folder.path, "-o", tmp_path / "k.txt", "--format", "tum", "--keyframes")
    assert "3 poses" in result.stdout
    result = thingmap("export", folder.path, "-o", tmp_path / "sure.csv", "--min-existence", 0.7)
    assert "1 things" in result.stdout


def test_what_is_told_by_the_cloud_is_said(folder, tmp_path):
    result = thingmap("export", folder.path, "-o", tmp_path / "a.coco.json")
    assert result.exit_code == 0, result.output
    assert "boxes are in" in result.stdout and "the map's cloud tells" in result.stderr


def test_mistakes_are_one_line(folder, tmp_path):
    out = folder.path
    assert_mistake(thingmap("export", out, "-o", tmp_path / "path.txt"), "does not tell the format", "'tum', 'kitti'")
    assert_mistake(thingmap("export", out, "-o", tmp_path / "a.csv", "--points", 5), "--points", "glb, gltf, usd")
    assert_mistake(thingmap("export", out, "-o", tmp_path / "a.tum", "--min-existence", 0.5), "--min-existence")
    assert_mistake(thingmap("export", out, "-o", tmp_path / "a.geojson", "--origin", "here"), "LAT,LON")
    assert_mistake(thingmap("export", out, "-o", tmp_path, "--format", "csv"), "a folder")
    assert_mistake(thingmap("export", out, "-o", tmp_path / "x.usd" / "a.glb"), "cannot be written")
    assert_mistake(thingmap("export", out, "-o", tmp_path / "x", "--format", "usd"), ".usda, .usdc")
    assert_mistake(thingmap("export", out, "--format", "csv"), "--output")
    (tmp_path / "a.glb").touch()
    assert_mistake(thingmap("export", out, "-o", tmp_path / "a.glb"), "an existing one", "--overwrite")
    assert not (tmp_path / "a.csv").exists()


def test_formats_are_listed():
    result = thingmap("export", "--formats")
    assert result.exit_code == 0
    lines = {line.split()[0]: line for line in result.stdout.splitlines()}
    assert len(lines) == 14
    assert "needs the extra usd" in lines["usd"] and "--min-visibility" in lines["coco"]
    assert "reads the sequence" in lines["coco"] and "--say" not in result.stdout

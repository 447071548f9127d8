import json
import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.run_report import RunReport


@pytest.fixture
def thingmap():
    """Runs the program in this process."""
    return lambda *arguments: CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def out(tmp_path, make_thing, make_map):
    folder = OutputFolder.create(tmp_path / "out")
    near_bowl = make_thing(2, "bowl", 0.7, position=[0.0, 0.0, 0.5])
    folder.write_map(make_map(make_thing(1, "cup", 0.9), near_bowl, make_thing(3, "cup", 0.8, position=[9.0, 0, 0])))
    skipped = {"unreadable image": ("frame-000003",)}
    folder.write_report(RunReport("table", 10, 9, 4, 3, skipped, "interrupted at frame 10", 2.0, {}, 100.0).to_dict())
    return folder.path


def assert_mistake(result, *parts: str) -> None:
    """Exit code 2 and exactly one line, on stderr, that holds these parts."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1, result.stderr
    for part in parts:
        assert part in result.stderr


def test_help_lists_the_commands(thingmap):
    for arguments in (["--help"], ["-h"], []):
        result = thingmap(*arguments)
        assert result.exit_code == 0 and result.stderr == ""
        for command in ("run", "detect", "query", "export", "info"):
            assert f"\n  {command} " in result.stdout
    described = " ".join(thingmap("run", "--help").stdout.split())
    assert "--odometry SOURCE Camera motion: kiss-icp or small-gicp from depth" in described


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["fly"], "No such command 'fly'; see thingmap --help"),
        (["run"], "Missing argument 'SEQUENCE'; see thingmap run --help"),
        (["run", "here"], "Missing option"),
        (["run", "here", "-o", "there", "--stride", "0"], "--stride"),
        (
            ["run", "sample:tabletop?frames=2", "-o", "there", "--odometry", "wheels"],
            "kiss-icp, small-gicp, poses or a file",
        ),
        (["run", "here", "-o", "there", "--max-frames", "few"], "--max-frames"),
        (["query", "out", "cup", "--near", "1", "2", "c"], "--near"),
        (["query", "out", "cup", "--min-probability", "2"], "--min-probability"),
        (["export", "out", "--format", "docx", "-o", "file"], "'json', 'csv', 'ply'"),
        (["--loud"], "--loud"),
    ],
)
def test_bad_options_are_one_line(arguments, part):
    result = CliRunner().invoke(app, arguments, prog_name="thingmap")
    assert_mistake(result, part)


def test_query_ranks_by_that_label(thingmap, out):
    result = thingmap("query", out, "CUP", "--json")
    answers = json.loads(result.stdout)
    assert [answer["id"] for answer in answers] == ["thing-0001", "thing-0003", "thing-0002"]
    assert answers[2]["answer_probability"] == pytest.approx(0.3 * 0.95) and answers[2]["label"] == "bowl"
    assert answers[0]["position_covariance"][0][0] == 1e-4 and "distance" not in answers[0]
    table = thingmap("query", out, "cup").stdout
    assert table.index("thing-0001") < table.index("thing-0003") < table.index("thing-0002")
    assert "0.100±0.010  0.200±0.020  1.000±0.030" in table and "12/3/1" in table


def test_query_near_sorts_by_distance(thingmap, out):
    result = thingmap("query", out, "cup", "--near", "-0.0", "0", "0", "--min-probability", "0.2", "--json")
    answers = json.loads(result.stdout)
    assert [answer["id"] for answer in answers] == ["thing-0002", "thing-0001", "thing-0003"]
    assert answers[0]["distance"] == pytest.approx(0.5) and answers[0]["distance_std"] == pytest.approx(0.03)
    assert "0.500 ± 0.030" in thingmap("query", out, "cup", "--near", "0", "0", "0").stdout


def test_query_for_what_is_not_there(thingmap, out):
    result = thingmap("query", out, "book")
    assert result.exit_code == 0 and "no book with a probability of at least 0.05 among 3 things" in result.stdout
    assert json.loads(thingmap("query", out, "book", "--json").stdout) == []
    assert_mistake(thingmap("query", out, "bowtie"), "did you mean bowl?", "its labels are: book, bowl, cup")


def test_query_without_a_map(thingmap, tmp_path):
    assert_mistake(thingmap("query", tmp_path / "absent", "cup"), "absent", "expected a map", "thingmap run")


def test_export_writes_a_new_file(thingmap, out, tmp_path):
    for name in ("json", "csv", "ply"):
        file = tmp_path / f"exported.{name}"
        result = thingmap("export", out, "--format", name, "-o", file)
        assert result.exit_code == 0 and f"3 things are in {file}" in result.stdout
        assert file.stat().st_size > 100
        assert_mistake(thingmap("export", out, "--format", name, "-o", file), "expected a new file", "--overwrite")
        assert thingmap("export", out, "--format", name, "-o", file, "--overwrite").exit_code == 0
    assert_mistake(thingmap("export", tmp_path, "--format", "csv", "-o", tmp_path / "x"), "no map.json in it")
    assert_mistake(thingmap("export", out, "--format", "csv", "-o", tmp_path / "no" / "x.csv"), "cannot be written")


def test_info_of_a_map(thingmap, out):
    shown, things = thingmap("info", out).stdout.split("\n\n")
    lines = dict(line.split("  ", 1) for line in shown.splitlines())
    values = {key: value.strip() for key, value in lines.items()}
    assert things.startswith("label") and things.count("thing-000") == 3
    assert values["map of"] == "table" and values["frame"] == "first camera"
    assert values["things"] == "3: 2 cup, 1 bowl"
    assert values["up"].startswith("0.000, -1.000, 0.000 ± 1.1 degrees, from planes") or "-1.000" in values["up"]
    assert values["run"] == "9 of 10 frames, 4 keyframes, 2.0 s, 4.5 frames/s"
    assert values["skipped"] == "1 with unreadable image" and values["stopped"] == "interrupted at frame 10"
    assert "3: 2 cup, 1 bowl" in thingmap("info", out / "map.json").stdout


def test_info_of_nothing(thingmap, tmp_path):
    assert_mistake(thingmap("info", tmp_path / "absent"), "absent")
    (tmp_path / "odd.json").write_text("[3")
    assert_mistake(thingmap("info", tmp_path / "odd.json"), "odd.json")


def test_unexpected_errors_are_not_hidden(thingmap, out, monkeypatch):
    from thingmap.mapper.map.object_map import ObjectMap

    def fail(path):
        raise RuntimeError("a defect")

    monkeypatch.setattr(ObjectMap, "load", fail)
    result = thingmap("query", out, "cup")
    assert result.exit_code == 1 and isinstance(result.exception, RuntimeError)


def test_the_installed_module_runs(out):
    environment = {**os.environ, "COLUMNS": "200"}
    command = [sys.executable, "-m", "thingmap.mapper.cli"]
    shown = subprocess.run([*command, "--help"], capture_output=True, text=True, env=environment)
    assert shown.returncode == 0 and shown.stdout.startswith("Usage: thingmap ")
    wrong = subprocess.run([*command, "query", out, "zebra"], capture_output=True, text=True, env=environment)
    assert wrong.returncode == 2 and wrong.stdout == "" and wrong.stderr.count("\n") == 1


def test_help_imports_nothing_heavy():
    heavy = ["numpy", "cv2", "gtsam", "open3d", "scipy", "numba", "yaml", "rich", "matplotlib", "trimesh", "embreex"]
    code = f"import sys; import thingmap.mapper.cli.main; print([m for m in {heavy} if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert shown.stdout.strip() == "[]", shown.stderr

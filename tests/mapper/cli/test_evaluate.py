import json
import sys
import types
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.truth import FrameTruth, TrueObject
from thingmap.mapper.cli.main import app
from thingmap.mapper.evaluation.evaluate import Evaluation
from thingmap.mapper.evaluation.result import VERSION, Better, Metric, ProtocolResult, WorstCase
from thingmap.mapper.map.store import OutputFolder


@pytest.fixture
def thingmap():
    """Runs the program in this process."""
    return lambda *arguments: CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def out(tmp_path, make_thing, make_map):
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(make_thing(1, "cup", 0.9)))
    folder.write_report({"frames_used": 3})
    return folder.path


class Judge:
    """What the command opens and calls, in place of the real truth and protocols."""

    def __init__(self, sequence) -> None:
        objects = [TrueObject(i, name, [0, 0, i], [1, 1, 1], 0.0) for i, name in enumerate(("cup", "bowl"))]
        empty = FrameTruth([0, 1], [[0, 0, 1, 1]] * 2, [[0, 0, 1, 1]] * 2, [1.0, 1.0])
        self.truth = GroundTruth(
            "scene", ("cup", "bowl"), tuple(objects), sequence=sequence, frame_truth=lambda i: empty
        )
        self.f1, self.version = 0.75, VERSION
        self.opened: tuple = ()
        self.called: dict = {}

    def open_truth(self, spec, poses=None):
        self.opened = (spec, poses)
        return self.truth

    def evaluate_run(self, out, truth, config, detector=None, on_protocol=None):
        self.called = {"out": out, "truth": truth, "config": config, "detector": detector}
        worst = (WorstCase("a cup is missing", 0, (0.0, 0.0, 2.0, 2.0)),)
        metrics = (Metric("joint F1", self.f1), Metric("error", 0.01, "m", Better.LOWER))
        results = {"objects": ProtocolResult("objects", "Objects", "itself", metrics, worst=worst)}
        skipped = {"lai": "the truth has no labelled points"}
        run = {"map": out.name, "source": "table", "frames in common": 3, "notes": []}
        case = SimpleNamespace(config=config, truth=truth)
        return Evaluation(self.version, run, truth.name, {"method": "none"}, results, skipped, case)


@pytest.fixture
def judge(monkeypatch, tiny_sequence):
    judge = Judge(tiny_sequence(3))
    module = types.ModuleType("thingmap.datasets.open_truth")
    module.open_truth = judge.open_truth
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr("thingmap.mapper.evaluation.evaluate.evaluate_run", judge.evaluate_run)
    return judge


def assert_mistake(result, *parts: str) -> None:
    """Exit code 2 and exactly one line, on stderr, that holds these parts."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1, result.stderr
    for part in parts:
        assert part in result.stderr


def test_evaluate_writes_a_report_and_leaves_the_run_alone(thingmap, out, judge, tmp_path):
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    report = tmp_path / "report"
    result = thingmap("evaluate", out, "--truth", "scene", "-o", report)
    assert result.exit_code == 0, result.output
    assert judge.opened == ("scene", None)
    assert judge.called["detector"] is None and judge.called["truth"] is judge.truth
    assert "joint F1" in result.stdout and "0.0100" in result.stdout and f"{report}" in result.stdout
    assert "not evaluated: lai: the truth has no labelled points" in result.stdout
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before
    document = json.loads((report / "report.json").read_text())
    assert document["schema"] == "thingmap-report/1" and document["run"]["map"] == "out"
    assert str(tmp_path) not in (report / "report.json").read_text() + (report / "report.html").read_text()
    assert "data:image/jpeg" in (report / "report.html").read_text()  # the worst case, seen in the sequence


def test_options_reach_the_evaluator(thingmap, out, judge, tmp_path):
    poses = tmp_path / "poses.txt"
    options = ["--poses", poses, "--detector", "none", "--alias", "mug=cup", "--alias", " tin = soda can "]
    result = thingmap("evaluate", out, "--truth", "t", "-o", tmp_path / "r", *options, "--classes", "CUP")
    assert result.exit_code == 0, result.output
    assert judge.opened == ("t", poses) and judge.called["detector"] == "none"
    assert judge.called["config"].aliases == {"mug": "cup", "tin": "soda can"}
    assert judge.called["truth"].classes == ("cup",)
    assert [thing.label for thing in judge.called["truth"].objects] == ["cup"]
    assert json.loads((tmp_path / "r" / "report.json").read_text())["classes"] == ["cup"]


def test_mistakes_are_one_line(thingmap, out, judge, tmp_path):
    base = ["evaluate", out, "--truth", "t", "-o"]
    new = tmp_path / "new"
    assert_mistake(thingmap("evaluate", tmp_path, "--truth", "t", "-o", new), "no map.json in it")
    assert_mistake(thingmap(*base, out, "--overwrite"), "the output of the run")
    assert_mistake(thingmap(*base, new, "--alias", "mug"), "--alias 'mug'", "mug=cup")
    assert_mistake(thingmap(*base, new, "--alias", "mug=cup", "--alias", "mug=can"), "'mug' is 'cup' already")
    assert_mistake(thingmap(*base, new, "--classes", "cup,zebra"), "zebra", "cup, bowl")
    assert_mistake(thingmap(*base, new, "--classes", ","), "--classes ','")
    assert not new.exists()
    assert thingmap(*base, new).exit_code == 0
    judge.called = {}
    assert_mistake(thingmap(*base, new), "not empty", "--overwrite")
    assert judge.called == {}  # refused before the work, not after
    assert thingmap(*base, new, "--overwrite").exit_code == 0


@pytest.fixture
def reports(thingmap, out, judge, tmp_path):
    """Two reports, the second the better one."""
    for name, judge.f1 in (("first", 0.5), ("second", 0.6)):
        assert thingmap("evaluate", out, "--truth", "t", "-o", tmp_path / name).exit_code == 0
    return [tmp_path / "first", tmp_path / "second"]


def test_compare_shows_and_writes(thingmap, reports, tmp_path):
    shown = thingmap("compare", *reports)
    assert shown.exit_code == 0, shown.output
    (row,) = [line.split() for line in shown.stdout.splitlines() if "joint F1" in line]
    assert row == ["joint", "F1", "0.500", "0.600*", "↑"]
    for name, mark in (("table.md", "**0.600**"), ("table.html", '<td class="n best">0.600</td>')):
        file = tmp_path / name
        assert f"the table is in {file}" in thingmap("compare", *reports, "-o", file).stdout
        assert mark in file.read_text()
        assert_mistake(thingmap("compare", *reports, "-o", file), "expected a new file", "--overwrite")
        assert thingmap("compare", *reports, "-o", file, "--overwrite").exit_code == 0


def test_compare_refuses_what_it_cannot_compare(thingmap, reports, out, judge, tmp_path):
    assert_mistake(thingmap("compare", reports[0]), "two reports or more")
    assert_mistake(thingmap("compare", reports[0], out), "the report of a run", "thingmap evaluate")
    assert_mistake(thingmap("compare", reports[0], tmp_path / "absent"), "absent", "found nothing")
    assert_mistake(thingmap("compare", *reports, "-o", tmp_path / "table.docx"), ".md or .html")
    judge.version = "0.9"
    assert thingmap("evaluate", out, "--truth", "t", "-o", tmp_path / "old").exit_code == 0
    assert_mistake(thingmap("compare", *reports, tmp_path / "old"), "0.9 in old", "--across-versions")
    shown = thingmap("compare", *reports, tmp_path / "old", "--across-versions")
    assert shown.exit_code == 0 and "cannot be compared" in shown.stdout and "0.600*" not in shown.stdout


def test_the_sample_from_run_to_report(thingmap, tmp_path):
    """The real truth, the real map and every protocol."""
    scene, out, report = "sample:tabletop?frames=20&width=240", tmp_path / "out", tmp_path / "report"
    options = ["--stride", 2, "--odometry", "poses", "--snapshots", "2,3,4,5,6,7,9"]
    assert thingmap("run", scene, "-o", out, *options).exit_code == 0
    result = thingmap("evaluate", out, "--truth", scene, "-o", report)
    assert result.exit_code == 0, result.stderr
    document = json.loads((report / "report.json").read_text())
    assert document["evaluator"] == VERSION and document["run"]["frames in common"] == 10
    results = {found["protocol"]: found for found in document["results"]}
    assert set(results) | set(document["skipped"]) == {
        *("georgakis", "lai", "meger", "objects", "honesty", "trajectory", "cost")
    }
    (ate,) = [metric["value"] for metric in results["trajectory"]["metrics"] if metric["name"] == "ATE rmse"]
    assert ate < 5e-3  # metres: the poses were given, and boxes move them a little
    page = (report / "report.html").read_text()
    for found in results.values():
        assert found["title"] in page
        assert all(metric["name"] in result.stdout for metric in found["metrics"] if metric["headline"])
    again = tmp_path / "again"
    assert thingmap("evaluate", out, "--truth", scene, "-o", again).exit_code == 0
    assert (again / "report.json").read_bytes() == (report / "report.json").read_bytes()
    assert (again / "report.html").read_text() == page


def test_help_lists_the_commands(thingmap):
    shown = thingmap("--help").stdout
    assert "\n  evaluate " in shown and "\n  compare " in shown
    assert "--alias MAP=TRUTH" in thingmap("evaluate", "--help").stdout
    assert "--across-versions" in thingmap("compare", "--help").stdout

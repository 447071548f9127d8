import json
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_reports import make_protocol, make_report

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.evaluate import Evaluation
from thingmap.mapper.evaluation.reporting.report import (
    SCHEMA,
    check_folder,
    read_report,
    to_report,
    without_folders,
    write_report,
)
from thingmap.mapper.evaluation.reporting.text import number_text
from thingmap.mapper.evaluation.result import VERSION, Metric, ProtocolResult, WorstCase


def make_evaluation(**changes) -> Evaluation:
    case = SimpleNamespace(
        config=EvaluationConfig(aliases={"mug": "cup"}), truth=SimpleNamespace(classes=("cup", "bowl"))
    )
    values = {
        "version": VERSION,
        "run": {"map": "out", "detector": "recorded:/data/a b/boxes.json", "notes": ["odd /data/run/x.json"]},
        "truth": "/data/scenes/kitchen",
        "alignment": {"method": "SE(3) by poses", "error, m": 0.25},
        "results": {"objects": make_protocol()},
        "skipped": {"cost": "/home/me/out/report.json: no stages"},
        "case": case,
    }
    return Evaluation(**(values | changes))


def equal(a: ProtocolResult, b: ProtocolResult) -> bool:
    """Gaps in curves are NaN, which equals nothing."""
    return a.to_dict() == b.to_dict()


def test_a_report_reads_back_as_it_was(tmp_path):
    report = to_report(make_evaluation())
    json_file, page_file = write_report(report, "<p>page</p>", tmp_path / "new" / "report")
    assert page_file.read_text() == "<p>page</p>" and json_file.name == "report.json"
    for place in (json_file.parent, json_file):
        back = read_report(place)
        assert replace(back, results=()) == replace(report, results=())
        assert len(back.results) == 1 and equal(back.results[0], make_protocol())
    series = back.results[0].plots[0].series[0]
    assert math.isnan(series.y[1]) and series.y[2] == 0.25
    assert back.results[0].worst == make_protocol().worst


def test_the_document_says_what_was_evaluated(tmp_path):
    write_report(to_report(make_evaluation()), "", tmp_path)
    document = json.loads((tmp_path / "report.json").read_text())
    assert document["schema"] == SCHEMA == "thingmap-report/1" and document["evaluator"] == VERSION
    assert document["classes"] == ["cup", "bowl"]
    assert document["config"]["aliases"] == {"mug": "cup"} and document["config"]["box_iou"] == 0.5
    assert document["alignment"]["error, m"] == 0.25
    assert document["notes"] == ["odd x.json"] and "notes" not in document["run"]


def test_no_folder_of_the_machine_is_told():
    report = to_report(make_evaluation())
    assert report.truth == "kitchen"
    assert report.skipped["cost"] == "report.json: no stages"
    assert "/data" not in json.dumps(report.to_document()) and "/home" not in json.dumps(report.to_document())


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("/data/scenes/kitchen", "kitchen"),
        ("recorded:/data/boxes.json?label=cup", "recorded:boxes.json?label=cup"),
        (r"C:\maps\out", "out"),
        ("simulated?seed=1", "simulated?seed=1"),
        ("rec/detections.json", "rec/detections.json"),
        ("3 m/s and precision / recall", "3 m/s and precision / recall"),
        ("", ""),
    ],
)
def test_absolute_paths_are_cut(text, kept):
    assert without_folders(text) == kept


def test_a_value_that_is_not_finite_is_absent():
    result = ProtocolResult("a", "A", "", (Metric("x", math.inf), Metric("y", math.nan)))
    box = WorstCase("half a box", 0, (0.0, math.nan, 1.0, 1.0))
    report = to_report(make_evaluation(results={"a": replace(result, worst=(box,))}))
    assert [metric.value for metric in report.results[0].metrics] == [None, None]
    assert report.results[0].worst[0].truth_xyxy is None


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (lambda d: d.pop("truth"), ("a value at truth", "no such key")),
        (lambda d: d["results"][0].pop("follows"), ("results.0.follows", "no such key")),
        (lambda d: d["results"][0]["metrics"][1].update(value="much"), ("results.0.metrics.1.value", "much")),
        (lambda d: d["results"][0]["metrics"][0].update(better="red"), ("one of higher, lower", "red")),
        (lambda d: d["results"][0]["plots"][0].update(limits=[0, 1]), ("limits", "4 values")),
        (lambda d: d.update(results={}), ("a list at results",)),
        (lambda d: d.update(schema="thingmap-report/9"), (SCHEMA, "thingmap-report/9")),
        (lambda d: (d.pop("schema"), d.update(frames_used=3)), (SCHEMA, "the report of a run")),
    ],
)
def test_a_damaged_report_is_named(tmp_path, change, parts):
    document = json.loads(json.dumps(make_report().to_document()))
    change(document)
    (tmp_path / "report.json").write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_report(tmp_path)
    assert caught.value.path == tmp_path / "report.json" and "thingmap evaluate" in caught.value.remedy
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(("text", "found"), [("{", "broken JSON at line 1"), ("[]", "a list"), (None, "nothing")])
def test_what_is_no_report_is_refused(tmp_path, text, found):
    if text is not None:
        (tmp_path / "report.json").write_text(text)
    with pytest.raises(InputError, match=found):
        read_report(tmp_path)


def test_a_folder_is_never_cleared(tmp_path):
    run, folder = tmp_path / "out", tmp_path / "report"
    run.mkdir()
    check_folder(folder, run, overwrite=False)  # absent
    assert not folder.exists()
    write_report(make_report(), "old", folder)
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(UserError, match=r"not empty.*--overwrite"):
        check_folder(folder, run, overwrite=False)
    check_folder(folder, run, overwrite=True)
    write_report(make_report(), "new", folder)
    assert sorted(file.name for file in folder.iterdir()) == ["notes.txt", "report.html", "report.json"]
    assert (folder / "report.html").read_text() == "new" and (folder / "notes.txt").read_text() == "mine"


def test_the_output_of_a_run_is_never_written_into(tmp_path):
    run, other = tmp_path / "out", tmp_path / "other"
    run.mkdir()
    other.mkdir()
    for folder in (run, run / "report", tmp_path / "other" / ".." / "out"):
        with pytest.raises(InputError, match="the output of the run"):
            check_folder(folder, run, overwrite=True)
    (other / "report.json").write_text('{"frames_used": 3}')
    with pytest.raises(InputError, match="the report of a run"):
        check_folder(other, run, overwrite=True)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="a folder to write to"):
        check_folder(tmp_path / "file", run, overwrite=True)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (math.nan, "–"),
        (12345, "12345"),
        (12345.6, "12346"),
        (0.0, "0"),
        (1.0, "1.00"),
        (0.9996, ">0.999"),
        (9.999, "10.0"),
        (-0.25, "-0.250"),
        (0.00012345, "0.000123"),
        (1.2345e-7, "1.23e-07"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert number_text(value) == text


@given(st.floats(1e-12, 1e12))
def test_a_shown_number_is_within_half_of_its_third_digit(value):
    shown = float(number_text(value).lstrip("<>"))
    assert abs(shown - value) <= 0.0051 * value

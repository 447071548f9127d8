import io
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_reports import NASTY, make_protocol, make_report
from rich.console import Console

from thingmap.datasets.errors import UserError
from thingmap.mapper.evaluation.reporting.compare import best_of, compare, unique_names
from thingmap.mapper.evaluation.reporting.compare_files import to_markdown, to_page
from thingmap.mapper.evaluation.reporting.terminal import print_comparison
from thingmap.mapper.evaluation.result import Better, Metric


def make_objects(f1: float | None, error: float, count: float):
    return make_protocol(
        "objects",
        Metric("joint F1", f1),
        Metric("centre error", error, "m", Better.LOWER),
        Metric("count ratio", count, "", Better.NEAR_ONE),
    )


@pytest.mark.parametrize(
    ("values", "better", "best"),
    [
        ((0.5, 0.7, 0.6), Better.HIGHER, (False, True, False)),
        ((0.5, 0.7, 0.6), Better.LOWER, (True, False, False)),
        ((0.8, 1.1, 1.4), Better.NEAR_ONE, (False, True, False)),
        ((0.7, 0.7, 0.6), Better.HIGHER, (True, True, False)),
        ((0.7, 0.7), Better.HIGHER, (False, False)),
        ((0.7, 0.7 + 1e-12), Better.HIGHER, (False, False)),
        ((0.5, 0.7), Better.NEITHER, (False, False)),
        ((None, 0.7), Better.HIGHER, (False, False)),
        ((None, 0.7, 0.6, float("nan")), Better.HIGHER, (False, True, False, False)),
        ((3, 2), Better.LOWER, (False, True)),
    ],
)
def test_the_best_is_marked(values, better, best):
    assert best_of(values, better) == best


@given(st.lists(st.none() | st.floats(-10, 10), max_size=6), st.sampled_from(Better))
def test_nothing_beats_what_is_marked(values, better):
    marks = best_of(values, better)
    loss = {Better.HIGHER: lambda v: -v, Better.LOWER: lambda v: v, Better.NEAR_ONE: lambda v: abs(v - 1)}.get(better)
    chosen = [v for v, mark in zip(values, marks, strict=True) if mark]
    assert loss is not None or not chosen
    for value in chosen:
        assert value is not None and all(loss(value) <= loss(v) + 1e-7 for v in values if v is not None)
    assert len(chosen) < max(len([v for v in values if v is not None]), 1)


def test_rows_and_columns():
    extra = make_protocol("cost", Metric("frames per second", 7.5))
    comparison = compare(
        {"a": make_report(make_objects(0.5, 0.02, 1.2)), "b": make_report(make_objects(0.6, 0.03, 1.0), extra)}
    )
    assert comparison.names == ("a", "b") and comparison.warnings == ()
    rows = {row.name: row for group in comparison.groups for row in group.rows}
    assert [group.title for group in comparison.groups] == ["Title of objects", "Title of cost"]
    assert rows["joint F1"].values == (0.5, 0.6) and rows["joint F1"].best == (False, True)
    assert rows["centre error"].best == (True, False) and rows["count ratio"].best == (False, True)
    assert rows["frames per second"].values == (None, 7.5) and rows["frames per second"].best == (False, False)
    assert comparison.skipped == ("lai: the truth has no labelled points",)


def test_what_differs_is_named():
    a = make_report()
    b = make_report(
        truth="kitchen", classes=("cup",), config=a.config | {"frame_step": 1, "aliases": {"mug": "cup"}}, skipped={}
    )
    comparison = compare({"a": a, "b": b})
    assert comparison.warnings == (
        "Different truth: sample:tabletop in a; kitchen in b.",
        "Different classes: cup, bowl in a; cup in b.",
        "Different aliases of the evaluator: none in a; mug = cup in b.",
        "Different frame_step of the evaluator: 5 in a; 1 in b.",
    )
    assert comparison.skipped == ("lai: the truth has no labelled points (a)",)


def test_other_evaluators_are_refused():
    reports = {
        "a": make_report(make_objects(0.5, 0.02, 1.2)),
        "b": make_report(make_objects(0.6, 0.03, 1.0), evaluator="0.9"),
    }
    with pytest.raises(UserError, match=r"1\.0 in a; 0\.9 in b.*--across-versions"):
        compare(reports)
    comparison = compare(reports, across_versions=True)
    assert "0.9 in b" in comparison.warnings[0] and "cannot be compared" in comparison.warnings[0]
    assert not any(any(row.best) for group in comparison.groups for row in group.rows)
    with pytest.raises(UserError, match="two reports or more"):
        compare({"a": reports["a"]})


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["/r/one", "/r/two/report.json"], ("one", "two")),
        (["/a/report", "/b/report"], ("a/report", "b/report")),
        (["/a/report", "/b/report", "/b/other"], ("a/report", "b/report", "other")),
        (["/a/x/report", "/b/x/report"], ("a/x/report", "b/x/report")),
        (["/r/one", "/r/one"], ("one", "one (2)")),
        (["/", "/"], ("report", "report (2)")),
    ],
)
def test_names_are_unique_and_short(paths, names):
    assert unique_names([Path(path) for path in paths]) == names


@given(st.lists(st.sampled_from(["/a", "/b", "/a/b", "/b/b", "/a/b/a", "/b/b/a", "/b/a/a/report.json"]), min_size=1))
def test_names_are_always_unique(paths):
    names = unique_names([Path(path) for path in paths])
    assert len(set(names)) == len(paths)


@pytest.fixture
def comparison():
    a, b = make_report(make_objects(0.5, 0.02, 1.2)), make_report(make_objects(0.6, 0.03, 1.0), truth=NASTY)
    return compare({"a|b": a, NASTY: b})


def test_markdown_marks_the_best(comparison):
    text = to_markdown(comparison)
    assert "| joint F1 | ↑ | 0.500 | **0.600** |" in text
    assert "| centre error, m | ↓ | **0.0200** | 0.0300 |" in text
    assert "a\\|b" in text and "<script" not in text
    assert text.index("Different truth") < text.index("| joint F1")
    widths = {len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines() if line.startswith("|")}
    assert widths == {5}


def test_the_page_marks_the_best(comparison):
    text = to_page(comparison)
    assert '<td class="n best">0.600</td>' in text and '<td class="n best">0.500</td>' not in text
    assert "<script" not in text and not re.search(r"https?://", text)
    assert text.index("Different truth") < text.index("joint F1") and to_page(comparison) == text


@pytest.mark.parametrize("width", [40, 120])
def test_the_terminal_marks_the_best(width):
    out = io.StringIO()
    a, b = make_report(make_objects(0.5, 0.02, 1.2)), make_report(make_objects(0.6, None, 1.0))
    print_comparison(compare({"first": a, "second": replace(b, truth="other")}), Console(file=out, width=width))
    text = out.getvalue()
    assert max(map(len, text.splitlines())) <= width
    assert "0.600*" in text and "0.500*" not in text and "0.0200*" not in text
    assert text.index("Different truth") < text.index("joint F1")

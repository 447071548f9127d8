"""`thingmap query --why`: which views spoke for an answer, in the terminal and in JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app
from thingmap.mapper.estimation.view_log import Verdict, ViewNote
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.views_file import ThingViews

CLASSES = ("cup", "bowl", "book")


def views(count: int) -> ThingViews:
    """Of every three views one supports, one is hidden and one misses; later ones are stronger."""
    notes = []
    for k in range(count):
        verdict = (Verdict.SUPPORTED, Verdict.OCCLUDED, Verdict.MISSED)[k % 3]
        ratio = (1.0, 0.0, -0.5)[k % 3] * k
        visible, score = np.full(5, 0.0 if k % 3 == 1 else 0.9), 0.75 if k % 3 == 0 else np.nan
        found = 0 if k % 3 == 0 else -1
        notes.append(
            ViewNote(k, 0.5 * k, f"frame-{k:06d}", visible, score, found, found, [ratio, -ratio, 0.0], 1.0, verdict)
        )
    return ThingViews(CLASSES, tuple(notes), {**dict.fromkeys(Verdict, 0), Verdict.OCCLUDED: 100})


@pytest.fixture
def out(tmp_path, make_thing, make_map):
    near, far = (
        make_thing(1, "cup", 0.8, views=views(30)),
        make_thing(2, "cup", 0.9, position=[9, 0, 0], views=views(3)),
    )
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(near, far))
    return folder.path


@pytest.fixture
def query(monkeypatch):
    def run(out, *arguments: object, columns: int = 100):
        monkeypatch.setenv("COLUMNS", str(columns))
        return CliRunner().invoke(app, ["query", str(out), *map(str, arguments)])

    return run


def test_the_strongest_views_follow_their_answer(query, out):
    lines = query(out, "cup", "--why").stdout.splitlines()
    places = {name: [k for k, line in enumerate(lines) if line.strip().endswith(name)] for name in ("0001", "0002")}
    assert places["0002"][0] < places["0001"][0]  # the likelier answer first, each with its own views
    second = lines[places["0001"][0] :]
    assert "  130 views: 10 supported, 10 contradicted (10 missed), 110 said nothing (110 hidden)" in second
    rows = [line for line in second if line.startswith("  frame-")]
    assert len(rows) == 12 and rows[0].split()[0] == "frame-000027"
    assert rows[0].split()[1:] == ["13.50", *["90%"] * 5, "0.75", "+27.00", "supported"]
    assert rows[2].endswith("- -14.50 contradicted: missed") or rows[2].endswith("+21.00 supported")
    assert "  and 118 more views, 110 of them hidden" in second
    assert any("said nothing: hidden" in line for line in lines[: places["0001"][0]])


@pytest.mark.parametrize("columns", [100, 80])
def test_views_fit_the_terminal(query, out, columns):
    result = query(out, "cup", "--why", columns=columns)
    rows = [line for line in result.stdout.splitlines() if line.startswith("  frame-")]
    assert len(rows) == 15 and max(map(len, rows)) <= columns
    assert "\x1b" not in result.stdout


def test_why_with_near_and_for_another_label(query, out):
    lines = query(out, "cup", "--why", "--near", 9, 0, 0).stdout.splitlines()
    assert "distance" in lines[0] and lines[2].split()[-1] == "thing-0002"
    bowl = query(out, "bowl", "--why").stdout
    assert "thing-0001 as bowl (0.19)" in bowl and "-27.00 supported as cup" in bowl


def test_json_has_every_view(query, out):
    answers = json.loads(query(out, "cup", "--why", "--json").stdout)
    assert [answer["id"] for answer in answers] == ["thing-0002", "thing-0001"]
    why = answers[1]["why"]
    assert (why["label"], why["left_out"], len(why["views"])) == ("cup", 100, 30)
    assert why["totals"] == {"supported": 10, "occluded": 110, "missed": 10, "seen_through": 0, "unclear": 0}
    assert why["views"][0] == {
        "says": "supported",
        "keyframe": 27,
        "stamp": 13.5,
        "frame": "frame-000027",
        "visible": {"whole": 0.8999, "top": 0.8999, "bottom": 0.8999, "left": 0.8999, "right": 0.8999},
        "score": 0.75,
        "template": "whole",
        "found_as": "cup",
        "log_ratio": 27.0,
        "weight": 1.0,
        "verdict": "supported",
        "text": "supported: found as cup with a score of 0.75, 90 % of it visible",
    }
    assert why["views"][-1]["score"] is None
    assert "why" not in json.loads(query(out, "cup", "--json").stdout)[0]


def test_a_map_without_evidence_answers_and_says_why_it_cannot_explain(query, out):
    (out / "evidence.npz").unlink()
    assert query(out, "cup").exit_code == 0
    result = query(out, "cup", "--why")
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr.startswith("error: ") and "evidence.npz" in result.stderr and "thingmap run" in result.stderr
    assert query(out, "book", "--why").stdout.startswith("no book")

"""Questions of `thingmap query` beyond a label: relations, regions, sentences, sightings."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app
from thingmap.mapper.cli.query_sentence import FORMS, Kind, parse_sentence
from thingmap.mapper.cli.tables import print_table
from thingmap.mapper.edits.editor import MapEditor
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.up_direction import UpDirection


@pytest.fixture
def ask(tmp_path, make_thing, make_map):
    """`ask(*arguments)` of a map of a table, a mug and a book on it, and a bottle elsewhere."""

    def thing(number, label, position, size):
        known = {"existence": 1.0, "class_posterior": {label: 1.0}, "yaw": 0.0, "size_std": [0.005] * 3}
        place = {"position": position, "position_covariance": 2.5e-5 * np.eye(3), "size": size}
        return make_thing(number, label, 1.0, **known, **place)

    out = OutputFolder.create(tmp_path / "out")
    things = (
        thing(1, "dining table", [0, 0, 0.375], [1.2, 0.8, 0.75]),
        thing(2, "mug", [0.3, 0.1, 0.80], [0.08, 0.08, 0.1]),
        thing(3, "book", [-0.2, 0.0, 0.765], [0.25, 0.2, 0.03]),
        thing(4, "bottle", [3.0, 1.0, 0.1], [0.07, 0.07, 0.2]),
    )
    up = UpDirection(np.array([0.0, 0.0, 1.0]), 0.0, "planes")
    out.write_map(make_map(*things, classes=("dining table", "mug", "book", "bottle", "lamp"), up=up))
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 1, 3] = [0.0, 1.0, 2.0]
    out.write_trajectory(np.array([0.0, 0.05, 0.1]), poses)
    return lambda *arguments: CliRunner().invoke(app, ["query", str(out.path), *map(str, arguments)])


def ids(result):
    assert result.exit_code == 0, result.output
    return [answer["id"] for answer in json.loads(result.stdout)]


def assert_mistake(result, *parts):
    assert result.exit_code == 2, result.output
    assert result.stdout == "" and result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
    for part in parts:
        assert part in result.stderr


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--on", "table"], ["thing-0002", "thing-0003"]),
        (["--on", "thing-0001"], ["thing-0002", "thing-0003"]),
        (["books", "--on", "table"], ["thing-0003"]),
        (["--supports-of", "mug"], ["thing-0001"]),
        (["--inside", "mug"], []),
        (["--under", "mug"], ["thing-0001"]),
        (["--next-to", "bottle"], []),
        (["what is on the table?"], ["thing-0002", "thing-0003"]),
        (["What's on top of the table"], ["thing-0002", "thing-0003"]),
        (["which mugs are on the table?"], ["thing-0002"]),
        (["what is the mug on?"], ["thing-0001"]),
        (["what does thing-0003 stand on?"], ["thing-0001"]),
        (["where is the mug?"], ["thing-0002"]),
        (["where are my books?"], ["thing-0003"]),
        (["when was the bottle last seen?"], ["thing-0004"]),
        (["--last-seen", "the bottle"], ["thing-0004"]),
        (["--within-ball", "3", "1", "0", "0.3"], ["thing-0004"]),
        (["--within-box", "2", "0", "0", "4", "2", "1"], ["thing-0004"]),
        (["--within-box", "4", "2", "1", "2", "0", "0"], ["thing-0004"]),
        (["--within-polygon", "2,0 4,0 4,2 2,2"], ["thing-0004"]),
        (["--within-polygon", "2,0 4,0 4,2 2,2", "--heights", "0.5", "1"], []),
        (["mug", "--within-polygon", "-1,-1 1,-1 1,1 -1,1"], ["thing-0002"]),
    ],
)
def test_questions(ask, arguments, expected):
    assert sorted(ids(ask(*arguments, "--json", "--min-probability", "0.3"))) == expected


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["my mug"], ["thing-0004"]),  # somebody calls a bottle so
        (["where is my mug?"], ["thing-0004"]),
        (["where is the mug?"], ["thing-0002"]),
        (["where is MY  MUG"], ["thing-0004"]),
        (["when was my mug last seen?"], ["thing-0004"]),
        (["thing-0003"], ["thing-0003"]),
        (["where is thing-0003?"], ["thing-0003"]),
        (["my mug", "--near", "0", "0", "0"], ["thing-0004"]),
        (["my mug", "--within-ball", "3", "1", "0", "0.3"], ["thing-0004"]),
        (["my mug", "--within-ball", "0", "0", "0", "0.3"], []),
        (["my mug", "--within-polygon", "2,0 4,0 4,2 2,2"], ["thing-0004"]),
        (["my mug", "--on", "table"], []),
        (["thing-0002", "--on", "table"], ["thing-0002"]),
        (["where is Tom's book?"], ["thing-0003"]),
        (["what does Tom's book stand on?"], ["thing-0001"]),
    ],
)
def test_names_and_ids(ask, tmp_path, arguments, expected):
    editor = MapEditor(tmp_path / "out", "ann")
    editor.name("thing-0004", "my mug")
    editor.name("thing-0003", "Tom's book")
    assert ids(ask(*arguments, "--json", "--min-probability", "0.3")) == expected


def test_tables_are_for_people(ask):
    shown = ask("--on", "table").stdout
    assert "P(asked for)" in shown and shown.index("thing-0002") > 0 and "thing-0004" not in shown
    assert "no thing next to mug with a probability of at least 0.05 among 4 things" in ask("--next-to", "mug").stdout
    assert "last seen" in ask("--last-seen", "mug").stdout
    assert "it may stand on the floor" in ask("--supports-of", "bottle").stdout
    assert "no mug inside table" in ask("mug", "--inside", "table").stdout


def test_how_words_were_taken_is_said_beside_the_answer(ask):
    result = ask("cups", "--json")
    assert ids(result) == ["thing-0002"] and "'cups' is taken as mug" in result.stderr
    assert "knows nothing of 'red'" in ask("the red mug").stderr
    assert ask("mug").stderr == ""


def test_a_table_that_nobody_named_is_told_by_the_cloud(ask, tmp_path):
    grid = np.stack(np.meshgrid(np.arange(2.6, 3.4, 0.02), np.arange(0.6, 1.4, 0.02), [0.0]), axis=-1).reshape(-1, 3)
    OutputFolder(tmp_path / "out").write_cloud(grid, np.full(grid.shape, 128, dtype=np.uint8))
    result = ask("what is on the worktop?", "--json")
    assert ids(result) == ["thing-0004"]
    assert result.stderr == "no worktop in the map: taken as the level surface as high as a table in its cloud\n"
    assert ask("--on", "table").stderr == ""  # the map has one


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ([], "say what to look for"),
        (["--on", "lamp"], "no lamp in the map"),
        (["--on", "sofa"], "no label 'sofa' in this map"),
        (["--on", "thing-0077"], "thing-0077"),
        (["--on", "mug", "--under", "mug"], "ask one at a time"),
        (["--within-ball", "0", "0", "0", "1", "--within-polygon", "0,0 1,0 1,1"], "ask one at a time"),
        (["--within-ball", "0", "0", "0", "-1"], "at least 0"),
        (["--within-polygon", "0,0 1,0"], "at least three corners"),
        (["--within-polygon", "here"], "at least three corners"),
        (["mug", "--heights", "0", "1"], "goes with --within-polygon"),
        (["--on", "table", "--near", "0", "0", "0"], "--near goes with a LABEL alone"),
        (["mug", "--last-seen", "book"], "takes no LABEL"),
        (["--last-seen", "mug", "--why"], "--why"),
        (["what colour is the mug?"], "where is X?"),
        (["thing-0077"], "no such thing; it has thing-0001, thing-0002"),
        (["--where-to-look", "thing-0077"], "no such thing"),
        (["--visible-from", "up there"], "tx ty tz qx qy qz qw"),
        (["--expected-at", "77"], "no pose at 77 s; its stamps go from 0.000 to 0.100"),
        (["--visible-from", "0 0 0 0 0 0 1"], "does not know its camera"),
    ],
)
def test_mistakes_are_one_line(ask, arguments, part):
    assert_mistake(ask(*arguments), part)


def test_a_question_needs_no_quotes_and_may_ask_whether_there_is_one(ask):
    for words in (["where", "is", "the", "mug?"], ["is there a mug?"], ["are there any mugs"]):
        assert ids(ask(*words, "--json")) == ["thing-0002"]


def test_a_narrow_terminal_gets_fewer_columns_and_is_told(capsys, monkeypatch):
    headers, rows = ("label", "P", "size, m", "for/hidden/against", "id"), [("mug", "0.99", "1", "1/0/0", "thing-0001")]
    print_table(headers, rows)
    whole = capsys.readouterr().out
    assert all(header in whole for header in headers) and "left out" not in whole
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "33")
    print_table(headers, rows)
    shown, said = capsys.readouterr().out.strip().rsplit("\n", 1)
    _, line, row = shown.splitlines()
    assert len(line) <= 33 and row.split() == ["mug", "0.99", "1", "thing-0001"]
    assert said == "left out, as the terminal is narrow: for/hidden/against"


def test_every_form_is_understood():
    kinds = [parse_sentence(form.replace("X", "the red mug")) for form in FORMS]
    assert all(found is not None and found.subject == "red mug" for found in kinds)
    assert len({found.kind for found in kinds if found}) == len(FORMS)
    assert parse_sentence("WHERE IS THE MUG").kind is Kind.FIND
    assert parse_sentence("where did I leave it") is None and parse_sentence("mug") is None

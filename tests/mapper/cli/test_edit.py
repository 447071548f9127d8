"""`thingmap edit`: what is said is done, recorded and told, and mistakes are one line."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder


@pytest.fixture
def out(tmp_path, make_thing, make_map):
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(make_thing(1), make_thing(2), make_thing(3, "bowl", position=[2, 0, 1])))
    return folder.path


def pending_in(out) -> list[str]:
    return [str(pending) for pending in ObjectMap.load(out).edits.pending]


@pytest.fixture
def edit(out):
    return lambda *arguments: CliRunner().invoke(app, ["edit", str(out), *map(str, arguments)])


def test_every_edit_is_done_and_told(out, edit):
    said = [
        edit("relabel", "thing-0001", "mug", "--why", "it has a handle", "--who", "Ann"),
        edit("move", "thing-0003", "--to", -1, 0.5, 2, "--std", 0.1, "--who", "Ann"),
        edit("name", "thing-0001", "my mug", "--who", "Ann"),
        edit("merge", "thing-0001", "thing-0002", "--who", "Ann"),
        edit("delete", "thing-0003", "--who", "Ben"),
        edit("undo", "--why", "it is there", "--who", "Ann"),
    ]
    assert [result.exit_code for result in said] == [0] * 6
    assert said[0].stdout == "1: relabel thing-0001 from cup to mug (P 0.99)\n"
    object_map = ObjectMap.load(out)
    assert object_map.thing("thing-0002").name == "my mug" and object_map.thing("thing-0001").label == "mug"
    assert object_map.thing("thing-0003").position.tolist() == [-1.0, 0.5, 2.0]
    lines = edit("log").stdout.splitlines()
    assert "Ann: [done] relabel thing-0001 from cup to mug (P 0.99), because: it has a handle" in lines[0]
    assert "Ben: [undone] delete thing-0003" in lines[4] and "undo of 5, because: it is there" in lines[5]
    assert edit("redo", "--who", "Ann").exit_code == 0 and len(ObjectMap.load(out)) == 1


def test_a_size_and_an_edit_of_long_ago(out, edit):
    assert edit("resize", "thing-0003", "--to", 0.1, 0.2, 0.3).stdout == (
        "1: resize thing-0003 to 0.100±0.010, 0.200±0.010, 0.300±0.010 m\n"
    )
    edit("delete", "thing-0002"), edit("name", "thing-0001", "my mug")
    assert ObjectMap.load(out).thing("thing-0003").size.tolist() == [0.1, 0.2, 0.3]
    assert edit("undo", 2).stdout == "4: undo of 2\n"
    object_map = ObjectMap.load(out)
    assert object_map.thing("thing-0002") and object_map.thing("thing-0001").name == "my mug"
    assert edit("undo", 1).exit_code == 0 and ObjectMap.load(out).thing("thing-0003").edits == ()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("undo", 7), "no edit 7 that stands"),
        (("undo", 1, "-n", 2), "give the NUMBER of one edit"),
        (("resize", "thing-0001", "--to", 0.1, 0, 0.1), "above 0"),
        (("resize", "thing-0001", "--to", 0.1, 0.1, 0.1, "--std", 0), "nothing is known exactly"),
        (("relabel", "thing-0009", "mug"), "no such thing"),
        (("undo",), "0 edits to undo"),
        (("merge", "thing-0001"), "at least two things"),
        (("relabel", "thing-0001", "mug", "--probability", "1"), "below 1"),
    ],
)
def test_mistakes_are_one_line(edit, arguments, message):
    result = edit(*arguments)
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr.startswith("error: ") and message in result.stderr and result.stderr.count("\n") == 1


def test_what_waits_is_told_after_mapping_anew(out, edit, make_map, make_thing):
    assert edit("log").stdout == "nothing was edited\n" and pending_in(out) == []
    edit("relabel", "thing-0003", "plate", "--who", "Ann")
    OutputFolder.create(out, overwrite=True).write_map(make_map(make_thing(1)))
    (line,) = pending_in(out)
    assert line.startswith("edit 1 waits (relabel thing-0003 from bowl to plate")
    assert "[waits]" in edit("log").stdout

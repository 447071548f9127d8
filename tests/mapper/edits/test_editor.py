"""Edits: what they do to things, who said so, undo and redo, and mistakes."""

from __future__ import annotations

import json
import re
from multiprocessing import get_context

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.edits.edit import Action
from thingmap.mapper.edits.editor import MapEditor, State
from thingmap.mapper.map.object_map import ObjectMap


def test_relabel_states_a_probability_and_the_others_share_the_rest(out):
    MapEditor(out, who="Ann").relabel("thing-0001", "mug", why="it has a handle")
    thing = ObjectMap.load(out).thing("thing-0001")
    assert (thing.label, thing.probability, thing.existence) == ("mug", 0.99, 0.95)
    assert thing.class_posterior == {"mug": 0.99, "cup": pytest.approx(0.009), "bowl": pytest.approx(0.001)}
    (edit,) = thing.edits
    assert (edit.number, edit.action, edit.who, edit.why) == (1, Action.RELABEL, "Ann", "it has a handle")
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", edit.when)
    assert ObjectMap.load(out).knows("mug")


def test_the_estimate_stays_in_the_maps_file(out):
    before = (out / "map.json").read_bytes()
    editor = MapEditor(out, who="Ann")
    editor.relabel("thing-0001", "mug")
    editor.delete("thing-0003")
    assert (out / "map.json").read_bytes() == before
    raw = ObjectMap.load(out, edits=False)
    assert (raw.thing("thing-0001").label, len(raw), raw.edits.changed) == ("cup", 4, False)
    assert raw.thing("thing-0003").edits == ()


def test_move_has_the_stated_covariance(out):
    MapEditor(out, who="Ann").move("thing-0004", [0.5, 0.6, 0.7], std=(0.01, 0.02, 0.03))
    thing = ObjectMap.load(out).thing("thing-0004")
    np.testing.assert_array_equal(thing.position, [0.5, 0.6, 0.7])
    np.testing.assert_allclose(thing.position_covariance, np.diag([1e-4, 4e-4, 9e-4]))
    assert (thing.label, thing.existence) == ("book", 0.95)


def test_a_deleted_thing_is_remembered(out):
    MapEditor(out, who="Ann").delete("thing-0002", why="a reflection")
    object_map = ObjectMap.load(out)
    assert [thing.id for thing in object_map.things] == ["thing-0001", "thing-0003", "thing-0004"]
    with pytest.raises(UserError, match=r"thing-0002: Ann deleted it on .* \(a reflection\); .*undo"):
        object_map.thing("thing-0002")


def test_merge_fuses_and_the_other_id_stays_a_name_of_the_thing(out, things):
    MapEditor(out, who="Ann").merge(["thing-0001", "thing-0002"])
    object_map = ObjectMap.load(out)
    thing = object_map.thing("thing-0002")
    assert thing.id == "thing-0001" and object_map.thing(things[1]) is thing and len(object_map) == 3
    # equal covariances: the middle; the two lie 4 sigma apart in x, so that chi-square is 8 on 3 degrees of freedom
    np.testing.assert_allclose(thing.position, [0.02, 0.0, 1.0])
    np.testing.assert_allclose(thing.position_covariance, np.diag([1e-4, 4e-4, 9e-4]) / 2.0 * 8.0 / 3.0, rtol=1e-5)
    np.testing.assert_allclose(thing.size_std, things[0].size_std / np.sqrt(2.0))  # sizes agree
    assert thing.probability == pytest.approx(0.9 * 0.8 / (0.9 * 0.8 + 0.1 * 0.2))
    assert thing.existence == pytest.approx(1.0 - 0.05 * 0.05)
    assert (thing.evidence.supporting, thing.evidence.occluded, thing.evidence.contradicting) == (24, 6, 2)


def test_merging_what_was_merged(out):
    editor = MapEditor(out, who="Ann")
    editor.merge(["thing-0001", "thing-0002"])
    editor.merge(["thing-0003", "thing-0002"])  # by the id that it had before
    object_map = ObjectMap.load(out)
    assert {object_map.thing(f"thing-000{k}").id for k in (1, 2, 3)} == {"thing-0003"}
    assert [edit.number for edit in object_map.thing("thing-0001").edits] == [1, 2]
    with pytest.raises(UserError, match="not one already"):
        editor.merge(["thing-0001", "thing-0003"])
    editor.undo()
    assert ObjectMap.load(out).thing("thing-0002").id == "thing-0001"


def test_a_name_is_of_one_thing(out):
    editor = MapEditor(out, who="Ann")
    editor.name("thing-0001", "  my   mug ")
    object_map = ObjectMap.load(out)
    assert object_map.thing("thing-0001").name == "my mug"
    assert [thing.id for thing in object_map.index.named("My Mug")] == ["thing-0001"]
    with pytest.raises(UserError, match="thing-0001 has it already"):
        editor.name("thing-0002", "My mug")
    editor.name("thing-0001", "")
    assert ObjectMap.load(out).thing("thing-0001").name is None
    editor.name("thing-0002", "My mug")


def test_undo_and_redo_are_records_and_nothing_leaves_the_journal(out):
    editor = MapEditor(out, who="Ann")
    editor.relabel("thing-0001", "mug")
    editor.relabel("thing-0001", "jug")
    editor.delete("thing-0003")
    lines = (out / "edits.jsonl").read_text().splitlines()
    editor.undo(2)
    assert ObjectMap.load(out).thing("thing-0001").label == "mug" and len(ObjectMap.load(out)) == 4
    editor.redo()
    assert ObjectMap.load(out).thing("thing-0001").label == "jug" and len(ObjectMap.load(out)) == 4
    editor.redo()
    assert len(ObjectMap.load(out)) == 3
    editor.undo(3)
    assert ObjectMap.load(out).thing("thing-0001").label == "cup"
    now = (out / "edits.jsonl").read_text().splitlines()
    assert now[:3] == lines and len(now) == 7
    assert all(json.loads(line)["schema"] == "thingmap-edits/1" for line in now)
    assert [line.state for line in editor.history()] == [State.UNDONE] * 3 + [State.NOTE] * 4
    with pytest.raises(UserError, match="0 edits to undo"):
        editor.undo()
    editor.name("thing-0001", "it")
    with pytest.raises(UserError, match="0 edits to redo"):  # a new edit came between
        editor.redo()


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda e: e.relabel("thing-0009", "mug"), "thing-0009: the map of table has no such thing"),
        (lambda e: e.relabel("thing-0001", " "), "label is empty"),
        (lambda e: e.relabel("thing-0001", "mug", probability=1.0), "probability 1: give one of at least 0.5"),
        (lambda e: e.relabel("thing-0001", "mug", probability=0.4), "probability 0.4"),
        (lambda e: e.move("thing-0001", [1, 2]), "position: expected three finite numbers"),
        (lambda e: e.move("thing-0001", [1, 2, np.inf]), "position: expected three finite numbers"),
        (lambda e: e.move("thing-0001", [1, 2, 3], std=0.0), "std .*: give metres above 0"),
        (lambda e: e.merge(["thing-0001"]), "at least two things"),
        (lambda e: e.merge(["thing-0001", "thing-0001"]), "at least two things"),
        (lambda e: e.undo(), "0 edits to undo, but asked for 1"),
    ],
)
def test_mistakes_are_named_and_nothing_is_written(out, ask, message):
    editor = MapEditor(out, who="Ann")
    with pytest.raises(UserError, match=message):
        ask(editor)
    assert editor.history() == () and len(ObjectMap.load(out)) == 4


def test_an_editor_needs_a_map_and_a_name(out, tmp_path):
    with pytest.raises(InputError, match="a map"):
        MapEditor(tmp_path / "nowhere")
    with pytest.raises(UserError, match="who is empty"):
        MapEditor(out, who=" ")
    assert not (out / "edits.jsonl").exists()


def name_it(out, number, count):
    for k in range(count):
        MapEditor(out, who=f"writer {number}").name(f"thing-000{number}", f"name {number} {k}")


def test_several_programs_may_edit_at_once(out):
    context = get_context("fork")
    writers = [context.Process(target=name_it, args=(out, number, 8)) for number in (1, 2, 3)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    editor = MapEditor(out, who="Ann")
    assert [line.entry.number for line in editor.history()] == list(range(1, 25))
    assert {thing.name for thing in ObjectMap.load(out).things} == {"name 1 7", "name 2 7", "name 3 7", None}


def test_half_a_line_never_was_an_edit_and_the_next_one_takes_its_place(out):
    editor = MapEditor(out, who="Ann")
    editor.relabel("thing-0001", "mug")
    journal = out / "edits.jsonl"
    whole = journal.read_bytes()
    journal.write_bytes(whole + whole[: len(whole) // 2])  # the power went
    assert ObjectMap.load(out).thing("thing-0001").label == "mug"
    assert editor.delete("thing-0002").number == 2
    assert journal.read_bytes().startswith(whole) and len(journal.read_bytes().splitlines()) == 2


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("{", "JSON in line 2"),
        ("[]", "an object at line 2"),
        ('{"schema": "thingmap-edits/9"}', "thingmap-edits/1"),
        ('{"schema": "thingmap-edits/1", "action": "paint"}', "line 2.action"),
        ('{"schema": "thingmap-edits/1", "action": "undo", "number": 2, "who": "", "when": "", "why": ""}', "edits"),
    ],
)
def test_a_damaged_journal_is_named(out, line, message):
    MapEditor(out, who="Ann").relabel("thing-0001", "mug")
    with (out / "edits.jsonl").open("a") as file:
        file.write(line + "\n")
    with pytest.raises(InputError, match=message) as caught:
        ObjectMap.load(out)
    assert str(caught.value).startswith(str(out / "edits.jsonl"))
    assert len(ObjectMap.load(out, edits=False)) == 4


def test_an_edited_map_saved_elsewhere_keeps_what_people_said(out, tmp_path):
    editor = MapEditor(out, who="Ann")
    editor.relabel("thing-0001", "mug", why="handle")
    editor.name("thing-0001", "my mug")
    editor.merge(["thing-0001", "thing-0002"])
    editor.delete("thing-0003")
    edited = ObjectMap.load(out)
    read = ObjectMap.load(edited.save(tmp_path / "other.json"))
    thing = read.thing("thing-0002")
    assert (thing.id, thing.label, thing.name) == ("thing-0001", "mug", "my mug")
    assert [(edit.number, edit.who) for edit in thing.edits] == [(1, "Ann"), (2, "Ann"), (3, "Ann")]
    with pytest.raises(UserError, match="Ann deleted it"):
        read.thing("thing-0003")
    with pytest.raises(UserError, match=r"would pass for what was estimated.*elsewhere"):
        edited.save(out)

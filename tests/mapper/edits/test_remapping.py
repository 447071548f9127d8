"""A sequence is mapped again into an edited folder: edits find their things or wait, and ids stay what they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper.edits.edit import Target
from thingmap.mapper.edits.editor import MapEditor, State
from thingmap.mapper.edits.identity import keep_ids
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder


@pytest.fixture
def remap(out, make_map):
    """Maps again: these things are found now."""

    def run(*things):
        OutputFolder.create(out, overwrite=True).write_map(make_map(*things))
        return ObjectMap.load(out)

    return run


def test_edits_are_done_again_on_a_slightly_other_estimate(out, remap, things, make_thing):
    MapEditor(out, who="Ann").relabel("thing-0001", "mug")
    moved = make_thing(1, "cup", 0.97, position=[0.01, 0.0, 1.01])
    object_map = remap(moved, *things[1:])
    assert object_map.thing("thing-0001").label == "mug" and object_map.edits.pending == ()
    assert object_map.thing("thing-0001").position[0] == 0.01


def test_an_edit_whose_thing_is_gone_waits_and_comes_back_with_it(out, remap, things):
    editor = MapEditor(out, who="Ann")
    editor.relabel("thing-0003", "plate")
    object_map = remap(things[0], things[1], things[3])
    (pending,) = object_map.edits.pending
    assert pending.reason == "the map has no thing-0003 any more" and "waits" in str(pending)
    assert [line.state for line in editor.history()] == [State.WAITS, State.NOTE]
    assert remap(*things).thing("thing-0003").label == "plate"


def test_an_edit_is_never_done_on_something_else_nor_does_that_get_the_id(out, remap, things, make_thing):
    editor = MapEditor(out, who="Ann")
    editor.delete("thing-0003")
    stranger = make_thing(3, "book", 0.9, position=[3.0, 3.0, 1.0])
    object_map = remap(things[0], things[1], things[3], stranger)
    ids = {thing.id: thing for thing in object_map.things}
    assert set(ids) == {"thing-0001", "thing-0002", "thing-0004", "thing-0005"}
    assert ids["thing-0005"].position.tolist() == [3.0, 3.0, 1.0]
    (pending,) = object_map.edits.pending
    assert pending.edit.thing_id == "thing-0003"
    # and for ever: the next time the mapper counts anew, the number is still not given away
    object_map = remap(things[0], make_thing(3, "cup", 0.9, position=[5.0, 5.0, 1.0]))
    assert {thing.id for thing in object_map.things} == {"thing-0001", "thing-0006"}
    object_map = remap(make_thing(5, "cup", 0.9, position=[7.0, 7.0, 1.0]))  # 5 was the stranger's
    assert [thing.id for thing in object_map.things] == ["thing-0007"]


def test_a_thing_that_the_mapper_numbers_anew_keeps_its_id_and_its_edits(out, remap, things, make_thing):
    MapEditor(out, who="Ann").name("thing-0004", "the atlas")
    again = make_thing(2, "book", 0.9, position=[0.0, 1.0, 1.0])
    cup = make_thing(4, "cup", 0.9, position=[9.0, 0.0, 1.0])
    object_map = remap(again, cup)
    (atlas,) = object_map.index.named("the atlas")
    assert atlas.id == "thing-0004" and atlas.label == "book"
    assert {thing.id for thing in object_map.things} == {"thing-0004", "thing-0005"}


def test_another_class_at_the_place_is_another_thing(out, remap, things, make_thing):
    MapEditor(out, who="Ann").relabel("thing-0004", "atlas")
    object_map = remap(*things[:3], make_thing(4, "bowl", 0.999, position=[0.0, 1.0, 1.0]))
    assert "atlas" not in {thing.label for thing in object_map.things}
    assert len(object_map.edits.pending) == 1


def test_without_edits_a_map_is_written_as_it_is(out, make_map, make_thing):
    stranger = make_thing(3, "book", 0.9, position=[3.0, 3.0, 1.0])
    OutputFolder.create(out, overwrite=True).write_map(make_map(stranger))
    assert [thing.id for thing in ObjectMap.load(out).things] == ["thing-0003"]


def test_a_merge_waits_as_a_whole(out, remap, things):
    MapEditor(out, who="Ann").merge(["thing-0001", "thing-0002"])
    object_map = remap(things[0], things[3])
    assert object_map.thing("thing-0001").edits == () and len(object_map.edits.pending) == 1
    assert remap(*things).thing("thing-0002").id == "thing-0001"


@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_ids_are_unique_and_known_things_keep_theirs(make_thing, make_map, data):
    """Things on a wide grid; the mapper numbers them as it likes, and finds some of them and some new ones."""
    count = data.draw(st.integers(1, 6))
    cells = data.draw(st.lists(st.integers(0, 20), min_size=count, max_size=count, unique=True))
    known = {f"thing-{k:04d}": Target.of(make_thing(k, "cup", position=[cell, 0, 0])) for k, cell in enumerate(cells)}
    found = data.draw(st.lists(st.integers(0, 20), min_size=1, max_size=6, unique=True))
    numbers = data.draw(st.permutations(range(len(found))))
    things = [make_thing(n, "cup", position=[cell, 0, 0]) for n, cell in zip(numbers, found, strict=True)]
    kept = keep_ids(make_map(*things), known)
    owner = {float(target.position[0]): name for name, target in known.items()}
    for before, after in zip(things, kept.things, strict=True):
        place = float(after.position[0])
        np.testing.assert_array_equal(before.position, after.position)
        assert after.id == owner[place] if place in owner else after.id not in known

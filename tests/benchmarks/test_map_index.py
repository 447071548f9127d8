"""The benchmark of the index: what it measures is right, and it tells of every question."""

from __future__ import annotations

import map_index
import pytest


def test_every_question_has_its_row(capsys):
    assert map_index.main(["--sizes", "60", "--calls", "4"]) == 0
    text = capsys.readouterr().out
    assert "## Index of a map" in text and "R*Tree" in text
    for question in map_index.QUESTIONS:
        assert f"| 60     | {question.name}" in text or f"| {question.name}" in text


def test_a_wrong_answer_is_told():
    object_map = map_index.made_up_map(40)
    answers = object_map.find(map_index.CLASSES[3])
    wanted = [(answer.thing.id, answer.probability) for answer in answers]
    map_index._compare(answers, wanted)
    with pytest.raises(AssertionError):
        map_index._compare(answers, [(name, p + 0.1) for name, p in wanted])


def test_things_lie_as_dense_as_is_said():
    object_map = map_index.made_up_map(500)
    places = [thing.position for thing in object_map.things]
    side = max(max(place[:2]) for place in places)
    assert 500 / side**2 == pytest.approx(map_index.DENSITY, rel=0.1)

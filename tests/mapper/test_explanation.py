"""Why a thing is in the map: in memory, as text, and from the file beside a map."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.edits.edit import Action, Edit, Target
from thingmap.mapper.edits.effects import relabelled
from thingmap.mapper.estimation.view_log import Verdict, ViewNote
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.views_file import ThingViews

CLASSES = ("cup", "bowl", "book")
NOTHING_LEFT_OUT = dict.fromkeys(Verdict, 0)


def view(keyframe: int, verdict: Verdict, ratios: list[float], **changes: object) -> ViewNote:
    found = verdict is Verdict.SUPPORTED
    values: dict = {
        "keyframe": keyframe,
        "stamp": 1305031452.25 + keyframe,  # seconds since 1970 do not fit into half the bits
        "frame": f"frame-{keyframe:06d}",
        "visible": [0.75, 1.0, 0.5, 0.25, 0.0],
        "score": 0.75 if found else np.nan,
        "part": 2 if found else -1,
        "class_id": 0 if found else -1,
        "log_ratio": ratios,
        "weight": 0.5,
        "verdict": verdict,
    }
    return ViewNote(**{**values, **changes})


NOTES = (
    view(1, Verdict.SUPPORTED, [2.0, -0.5, -1.0]),
    view(2, Verdict.OCCLUDED, [0.0, 0.0, 0.0], visible=[0.0] * 5),
    view(3, Verdict.MISSED, [-0.5, -0.5, -0.25]),
    view(4, Verdict.SEEN_THROUGH, [-3.0, -3.0, -3.0]),
    view(5, Verdict.UNCLEAR, [0.0, 0.0, 0.0], visible=[0.5] * 5),
    view(6, Verdict.SUPPORTED, [-0.25, 1.5, -1.0], class_id=1),
)


@pytest.fixture
def views() -> ThingViews:
    return ThingViews(CLASSES, NOTES, {**NOTHING_LEFT_OUT, Verdict.OCCLUDED: 40})


@pytest.fixture
def seen(make_thing, make_map, views) -> ObjectMap:
    """A map of a cup with views, a bowl with one, and a doubtful book with none."""
    one = ThingViews(CLASSES, NOTES[:1], NOTHING_LEFT_OUT)
    none = ThingViews(CLASSES, (), NOTHING_LEFT_OUT)
    bowl, book = make_thing(2, "bowl", 0.7, views=one), make_thing(3, "book", 0.6, existence=0.4, views=none)
    return make_map(make_thing(1, views=views), bowl, book)


def test_the_strongest_view_for_the_label_comes_first_or_the_earliest(make_thing, views):
    thing = make_thing(views=views)
    assert [v.keyframe for v in thing.explain()] == [4, 1, 3, 6, 5, 2]  # of equal ones what was in sight
    assert [v.keyframe for v in thing.explain("bowl")] == [4, 6, 1, 3, 5, 2]
    assert [v.keyframe for v in thing.explain(in_time_order=True)] == [1, 2, 3, 4, 5, 6]
    assert thing.explain().probability == pytest.approx(0.95 * 0.9)


def test_a_view_says_what_was_seen_and_what_it_means(make_thing, views):
    by_keyframe = {v.keyframe: v for v in make_thing(views=views).explain("cup")}
    first = by_keyframe[1]
    assert first.visible == {"whole": 0.75, "top": 1.0, "bottom": 0.5, "left": 0.25, "right": 0.0}
    assert (first.frame, first.found_as, first.template) == ("frame-000001", "cup", "bottom")
    assert first.text == "supported: found as cup with a score of 0.75 by its bottom, 75 % of it visible"
    assert (by_keyframe[2].score, by_keyframe[2].template, by_keyframe[2].found_as) == (None, None, None)
    assert by_keyframe[2].text == "said nothing: hidden, 0 % of it visible"
    assert by_keyframe[3].text == "contradicted: not found although 75 % of it visible"
    assert by_keyframe[4].text == "contradicted: the camera looked through its volume"
    assert by_keyframe[5].text.startswith("said nothing: not found, nor was that to be expected")
    assert by_keyframe[6].text.endswith("75 % of it visible; all in all it speaks against cup")
    agreeing = ThingViews(CLASSES, (view(1, Verdict.MISSED, [0.25, 0.0, 0.0]),), NOTHING_LEFT_OUT)
    assert (
        make_thing(views=agreeing).explain().views[0].text.endswith("75 % of it visible; all in all it speaks for cup")
    )
    said = {"supported": 2, "contradicted": 2, "said nothing": 2}
    assert {word: sum(v.says == word for v in by_keyframe.values()) for word in said} == said


def test_views_that_are_only_counted_are_in_the_totals(make_thing, views):
    explanation = make_thing(views=views).explain()
    assert explanation.totals[Verdict.OCCLUDED] == 41 and explanation.left_out == 40 and len(explanation) == 6
    assert explanation.summary() == (
        "46 views: 2 supported, 2 contradicted (1 missed, 1 seen through), 42 said nothing (41 hidden, 1 unclear)"
    )


def test_as_text_it_is_a_short_table(make_thing, views):
    lines = str(make_thing(views=views).explain("bowl")).splitlines()
    assert lines[0] == "thing-0001 as bowl (0.09)"
    assert " ".join(lines[4].split()) == (
        "frame-000004 1305031456.25 75% 100% 50% 25% 0% - -3.00 contradicted: seen through"
    )
    assert lines[5].endswith("0.75 +1.50 supported") and lines[6].endswith("-0.50 supported as cup")
    assert lines[-2] == "and 40 more views, 40 of them hidden"
    assert len(lines) == 12


def test_a_table_is_cut_to_the_strongest_and_to_the_width(make_thing):
    notes = tuple(view(k, Verdict.MISSED, [-0.01 * k, 0.0, 0.0], stamp=k, frame="x" * 30 + str(k)) for k in range(30))
    explanation = make_thing(views=ThingViews(CLASSES, notes, NOTHING_LEFT_OUT)).explain()
    for width, last in ((100, "contradicted: missed"), (80, "missed")):
        lines = explanation.table(limit=5, width=width).splitlines()
        assert [line.split()[0][-2:] for line in lines[4:9]] == ["29", "28", "27", "26", "25"]
        assert all(line.endswith(f" {last}") and len(line) <= width for line in lines[4:9])
        assert lines[9] == "and 25 more views, 0 of them hidden"
    assert "more" not in explanation.table(limit=30)


def test_without_views_or_with_a_strange_label_it_says_so(make_thing, views):
    with pytest.raises(UserError, match="thing-0001: nothing is on record of its views"):
        make_thing().explain()
    with pytest.raises(UserError, match=r"no class 'zebra' was looked for.*choose one of: cup, bowl, book"):
        make_thing(views=views).explain("zebra")
    empty = make_thing(views=ThingViews(CLASSES, (), NOTHING_LEFT_OUT)).explain()
    assert str(empty).splitlines()[1] == "0 views: 0 supported, 0 contradicted, 0 said nothing"
    with pytest.raises(ValueError, match="log_ratio must have 2 values, but got 3"):
        ThingViews(("cup", "bowl"), NOTES, NOTHING_LEFT_OUT)


def test_a_map_keeps_its_explanations(seen, tmp_path):
    file = seen.save(tmp_path, include_doubtful=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["evidence.npz", "map.json"]
    for written, read in zip(seen.things, ObjectMap.load(file).things, strict=True):
        assert str(read.explain("bowl")) == str(written.explain("bowl"))
        for a, b in zip(written.explain(in_time_order=True), read.explain(in_time_order=True), strict=True):
            assert (a.keyframe, a.stamp, a.frame, a.verdict) == (b.keyframe, b.stamp, b.frame, b.verdict)
            assert (a.visible, a.score, a.log_ratio, a.text) == (b.visible, b.score, b.log_ratio, b.text)
    again = pickle.loads(pickle.dumps(ObjectMap.load(file)))
    assert len(again.things[0].explain()) == 6


def test_numbers_are_kept_to_three_digits_and_the_impossible_stays_impossible(make_thing, make_map, tmp_path):
    rng = np.random.default_rng(0)
    ratios = np.array([[-np.inf, np.inf, 0.0], *rng.normal(0.0, 20.0, (200, 3))])
    notes = tuple(
        view(k, Verdict.SUPPORTED, r, visible=rng.random(5), score=rng.random()) for k, r in enumerate(ratios)
    )
    made = make_map(make_thing(views=ThingViews(CLASSES, notes, NOTHING_LEFT_OUT)))
    read = ObjectMap.load(made.save(tmp_path)).things[0].explain("cup", in_time_order=True)
    assert read.views[0].log_ratio < -6e4
    np.testing.assert_allclose([v.log_ratio for v in read.views[1:]], ratios[1:, 0], rtol=1e-3)
    np.testing.assert_allclose([v.score for v in read], [n.score for n in notes], rtol=1e-6)
    np.testing.assert_allclose([v.visible["right"] for v in read], [n.visible[4] for n in notes], atol=5e-4)
    assert (tmp_path / "evidence.npz").stat().st_size < 60 * len(notes)  # bytes a view with three classes


def test_a_map_of_another_name_has_evidence_of_its_name(seen, tmp_path):
    first, second = seen.save(tmp_path / "kitchen.json"), replace(seen, things=seen.things[:1])
    second.save(tmp_path / "hall.json")
    assert {path.name for path in tmp_path.glob("*.npz")} == {"kitchen.evidence.npz", "hall.evidence.npz"}
    assert json.loads(first.read_text())["evidence"]["file"] == "kitchen.evidence.npz"
    assert len(ObjectMap.load(first).things[1].explain()) == 1


def test_the_map_says_the_same_bytes_every_time_and_nothing_else_new(seen, tmp_path):
    texts = [seen.save(tmp_path / name).read_text() for name in ("a", "b")]
    assert texts[0] == texts[1]
    plain = seen.save(tmp_path / "plain", evidence=False)
    assert [path.name for path in plain.parent.iterdir()] == ["map.json"]
    document = json.loads(texts[0])
    named = document.pop("evidence")
    assert document == json.loads(plain.read_text())
    assert named["sha256"] == hashlib.sha256((tmp_path / "a" / "evidence.npz").read_bytes()).hexdigest()


def test_a_map_without_the_file_is_a_map_that_cannot_explain(seen, tmp_path):
    seen.save(tmp_path)
    (tmp_path / "evidence.npz").unlink()
    lone = ObjectMap.load(tmp_path)
    assert len(lone) == 2 and lone.find("cup")
    with pytest.raises(InputError, match=r"evidence\.npz: expected the views .* found no such file; .*thingmap run"):
        lone.things[0].explain()
    lone.save(tmp_path / "copy")  # nothing is lost that was there
    with pytest.raises(UserError, match=r"map\.json: .*without the views.*evidence\.npz.*thingmap run"):
        ObjectMap.load(tmp_path / "copy").things[0].explain()


def test_a_loaded_map_is_saved_with_its_explanations(seen, tmp_path):
    seen.save(tmp_path)
    ObjectMap.load(tmp_path).save(tmp_path / "copy")
    ObjectMap.load(tmp_path).save(tmp_path)  # onto itself
    for place in (tmp_path / "copy", tmp_path):
        assert str(ObjectMap.load(place).things[0].explain()) == str(seen.things[0].explain())


def test_an_old_run_s_evidence_never_stands_for_a_new_map(seen, make_map, make_thing, tmp_path):
    OutputFolder.create(tmp_path).write_map(seen)
    old = (tmp_path / "evidence.npz").read_bytes()
    folder = OutputFolder.create(tmp_path, overwrite=True)
    folder.write_map(replace(seen, things=seen.things[1:]))
    assert folder.evidence_file.read_bytes() != old
    assert len(folder.read_map().things[0].explain()) == 1
    folder.evidence_file.write_bytes(old)  # as if put back by hand
    with pytest.raises(InputError, match="that of another map"):
        folder.read_map().things[0].explain()
    folder.write_map(make_map(make_thing(1)))  # of whose views nobody knows anything
    assert folder.evidence_file.read_bytes() != old
    with pytest.raises(UserError, match="written without the views"):
        folder.read_map().things[0].explain()


def test_a_thing_whose_views_nobody_knows_is_named(seen, make_thing, tmp_path):
    mixed = replace(seen, things=(seen.things[0], make_thing(9)))
    read = ObjectMap.load(mixed.save(tmp_path))
    assert len(read.things[0].explain()) == 6
    with pytest.raises(UserError, match="holds no views of thing-0009"):
        read.things[1].explain()


def rename(file: Path, content: bytes) -> None:
    """Puts `content` in the place of a map's evidence, and has the map name it."""
    (file.parent / "evidence.npz").write_bytes(content)
    document = json.loads(file.read_text())
    document["evidence"]["sha256"] = hashlib.sha256(content).hexdigest()
    file.write_text(json.dumps(document))


def changed(content: bytes, **changes: object) -> bytes:
    with np.load(io.BytesIO(content)) as file:
        arrays = {**{name: file[name] for name in file.files}, **changes}
    out = io.BytesIO()
    np.savez(out, **{name: np.asarray(array) for name, array in arrays.items() if array is not None})
    return out.getvalue()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda c: b"", "No data|empty"),
        (lambda c: c[:-40], "not a zip"),
        (lambda c: changed(c, meta=json.dumps({"schema": "thingmap-ledger/1"})), "schema 'thingmap-ledger/1'"),
        (lambda c: changed(c, meta=np.array([{"schema": 1}], dtype=object)), "allow_pickle=False"),
        (lambda c: changed(c, log_ratio=np.zeros((7, 2), np.float16)), "in log_ratio instead of"),
        (lambda c: changed(c, keyframe=np.zeros(7)), "float64 .* in keyframe"),
        (lambda c: changed(c, weight=None), "weight"),
        (lambda c: changed(c, verdict=np.full(7, 9, np.int8)), "values in verdict outside 0..4"),
        (lambda c: changed(c, frame=np.full(7, 99, np.int32)), "values in frame outside"),
        (lambda c: changed(c, first=np.array([0, 9, 7])), "rows that do not belong"),
        (lambda c: changed(c, visible=np.full((7, 5), np.nan, np.float16)), "visible that are not finite"),
    ],
)
def test_a_damaged_or_foreign_file_is_a_clear_mistake(seen, tmp_path, damage, message):
    file = seen.save(tmp_path)
    whole = (tmp_path / "evidence.npz").read_bytes()
    rename(file, changed(whole))  # rewritten as it was, it is read
    assert len(ObjectMap.load(file).things[0].explain()) == 6
    rename(file, damage(whole))
    with pytest.raises(InputError, match=message) as caught:
        ObjectMap.load(file).things[0].explain()
    assert caught.value.path == tmp_path / "evidence.npz" and "thingmap run" in str(caught.value)


def test_a_flipped_byte_is_found(seen, tmp_path):
    file = seen.save(tmp_path)
    content = bytearray((tmp_path / "evidence.npz").read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / "evidence.npz").write_bytes(content)
    with pytest.raises(InputError, match="damaged file or that of another map"):
        ObjectMap.load(file).things[0].explain()


def test_a_map_that_names_no_file_properly_is_refused(seen, tmp_path):
    file = seen.save(tmp_path)
    document = json.loads(file.read_text())
    for named in ({"file": "../evidence.npz", "sha256": "0"}, {"file": "evidence.npz"}, "evidence.npz"):
        file.write_text(json.dumps({**document, "evidence": named}))
        with pytest.raises(InputError, match="evidence"):
            ObjectMap.load(file)


class TestWhatPeopleSaid:
    """A thing that a person gave a label."""

    @pytest.fixture
    def edited(self, make_thing, views):
        def edit(label: str, why: str = ""):
            thing = make_thing(1, "cup", 0.9, views=views)
            change = Edit(3, Action.RELABEL, (Target.of(thing),), "ann", "2026-03-01T09:30:00Z", why, label, 0.99)
            return relabelled(thing, change)

        return edit

    def test_a_label_that_no_view_was_asked_about(self, edited):
        explanation = edited("mug", "it has a handle").explain()
        assert (explanation.label, explanation.views_label) == ("mug", "cup")
        assert explanation.probability == edited("mug").belief("mug") > 0.9
        same = edited("mug").explain("CUP")
        assert [view.to_dict() for view in explanation] == [view.to_dict() for view in same] and len(explanation) > 0
        lines = str(explanation).splitlines()
        assert lines[0].startswith("thing-0001 as mug (0.9")
        assert lines[1] == (
            "ann said on 2026-03-01T09:30:00Z: relabel thing-0001 from cup to mug (P 0.99) (it has a handle)"
        )
        assert lines[2] == "no view was asked about mug, which only people said; they speak of cup"
        assert "supported as cup" not in str(explanation)  # that is what they were asked
        values = json.loads(json.dumps(explanation.to_dict()))
        assert (values["label"], values["views_label"], values["edits"][0]["who"]) == ("mug", "cup", "ann")

    def test_a_label_that_views_know_too(self, edited):
        explanation = edited("bowl").explain()
        assert explanation.views_label == explanation.label == "bowl" and "ann said on" in str(explanation)
        assert "no view was asked" not in str(explanation)

    def test_a_label_that_nobody_said(self, edited):
        with pytest.raises(UserError, match="no class 'zebra' was looked for"):
            edited("mug").explain("zebra")

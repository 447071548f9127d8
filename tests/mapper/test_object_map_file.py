import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError
from thingmap.mapper.map.map_file import format_document, from_document, to_document
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection

labels = st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=12)
reals = st.floats(-1e6, 1e6)
positive = st.floats(0.0, 1e3)
shares = st.floats(0.0, 1.0)


def vector(element):
    return st.tuples(element, element, element)


@st.composite
def things(draw, number: int) -> Thing:
    weights = draw(st.dictionaries(labels, st.floats(1e-3, 1.0), min_size=1, max_size=5))
    posterior = {label: weight / sum(weights.values()) for label, weight in weights.items()}
    label = max(posterior, key=posterior.__getitem__)
    factor = np.array(draw(st.tuples(*[st.floats(-1.0, 1.0)] * 9))).reshape(3, 3)
    covariance = factor @ factor.T
    return Thing(
        id=f"thing-{number:04d}",
        label=label,
        probability=posterior[label],
        existence=draw(shares),
        class_posterior=posterior,
        position=np.array(draw(vector(reals))),
        position_covariance=(covariance + covariance.T) / 2,
        size=np.array(draw(vector(positive))),
        size_std=np.array(draw(vector(positive))),
        yaw=draw(st.floats(-np.pi, np.pi)),
        first_seen=draw(reals),
        last_seen=draw(reals),
        evidence=Evidence(*draw(vector(st.integers(0, 10**6)))),
    )


@st.composite
def maps(draw) -> ObjectMap:
    count = draw(st.integers(0, 3))
    up = np.array(draw(vector(st.floats(-1.0, 1.0)).filter(lambda v: np.linalg.norm(v) > 0.1)))
    return ObjectMap(
        things=tuple(draw(things(number)) for number in range(count)),
        classes=tuple(draw(st.lists(labels, max_size=4))),
        source=draw(st.text(st.characters(exclude_categories=("Cs",)), max_size=10)),
        frame=draw(st.sampled_from(MapFrame)),
        up=UpDirection(up / np.linalg.norm(up), draw(st.floats(0.0, 3.0)), draw(labels)),
    )


@given(maps())
@settings(max_examples=80, deadline=None)
def test_what_is_read_is_what_was_written(tmp_path_factory, written):
    file = written.save(tmp_path_factory.mktemp("map"), include_doubtful=True)
    read = ObjectMap.load(file)
    assert (read.classes, read.source, read.frame) == (written.classes, written.source, written.frame)
    np.testing.assert_allclose(read.up.direction, written.up.direction, atol=1e-15)
    assert read.up.std_rad == pytest.approx(written.up.std_rad)
    assert len(read.things) == len(written.things)
    for a, b in zip(read.things, written.things, strict=True):
        for name in ("id", "label", "probability", "existence", "class_posterior", "yaw", "first_seen", "last_seen"):
            assert getattr(a, name) == getattr(b, name)
        for name in ("position", "position_covariance", "size", "size_std"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        assert a.evidence == b.evidence


def test_document_is_the_published_schema(make_thing, make_map):
    thing = make_thing(7, "cup", 0.97, class_posterior={"bowl": 0.02995, "cup": 0.97, "book": 5e-5})
    document = json.loads(format_document(to_document(make_map(thing))))
    assert {key: document[key] for key in ("schema", "source", "frame", "classes")} == {
        "schema": "thingmap/1",
        "source": "table",
        "frame": "first camera",
        "classes": ["cup", "bowl", "book"],
    }
    assert document["up"] == {"direction": [0, -1, 0], "std_deg": pytest.approx(1.1459, abs=1e-4), "source": "planes"}
    assert document["things"] == [
        {
            "id": "thing-0007",
            "label": "cup",
            "probability": 0.97,
            "existence": 0.95,
            "class_posterior": {"cup": 0.97, "bowl": 0.02995},  # the book is negligible; the others are not scaled
            "position": [pytest.approx(0.7), 0.2, 1.0],
            "position_covariance": [[1e-4, 0, 0], [0, 4e-4, 0], [0, 0, 9e-4]],
            "size": [0.08, 0.09, 0.1],
            "size_std": [0.01, 0.01, 0.02],
            "yaw": 0.3,
            "first_seen": 0.0,
            "last_seen": 2.5,
            "evidence": {"supporting": 12, "occluded": 3, "contradicting": 1},
        }
    ]
    assert list(document["things"][0]["class_posterior"]) == ["cup", "bowl"]  # likeliest first


def test_doubtful_things_are_written_only_when_asked_for(make_map, tmp_path):
    object_map = make_map()  # the third exists with 0.4
    object_map.save(tmp_path / "sure")
    object_map.save(tmp_path / "all", include_doubtful=True)
    assert [len(ObjectMap.load(tmp_path / name)) for name in ("sure", "all")] == [2, 3]


def test_save_and_load_take_a_folder_or_a_file(make_map, tmp_path):
    assert make_map().save(tmp_path / "deep" / "out") == tmp_path / "deep" / "out" / "map.json"
    assert make_map().save(tmp_path / "other.json") == tmp_path / "other.json"
    for path in ("deep/out", "deep/out/map.json", "other.json"):
        assert len(ObjectMap.load(tmp_path / path)) == 2


def test_a_map_without_things_is_a_map(make_map, tmp_path):
    empty = make_map()
    empty = ObjectMap((), empty.classes, empty.source, empty.frame, empty.up)
    assert ObjectMap.load(empty.save(tmp_path)).things == ()


def broken(document, change):
    change(document)
    return document


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda d: d.update(schema="thingmap/9"),
            "expected the schema \"thingmap/1\", found 'thingmap/9'; open it with",
        ),
        (lambda d: d.pop("up"), "expected the key up, found no such key"),
        (lambda d: d["things"][1].pop("yaw"), r"expected the key things\[1\].yaw"),
        (
            lambda d: d["things"][0].update(position=[1, 2]),
            r"expected 3 numbers at things\[0\].position, found \[1, 2\]",
        ),
        (lambda d: d["things"][0].update(position=[1, [2], 3]), r"expected 3 numbers at things\[0\].position"),
        (lambda d: d["things"][0].update(existence="high"), r"a number at things\[0\].existence, found .high."),
        (lambda d: d["things"][0].update(existence=True), r"a number at things\[0\].existence, found true"),
        (lambda d: d["things"][0].update(yaw=10**400), r"valid values at things\[0\], found int too large"),
        (lambda d: d["things"][0].update(existence=7), r"valid values at things\[0\], found existence must be in"),
        (lambda d: d["things"][0]["evidence"].update(occluded=-1), r"number >= 0 at things\[0\].evidence.occluded"),
        (lambda d: d["things"][0]["class_posterior"].update(cup=None), r"things\[0\].class_posterior.cup, found null"),
        (lambda d: d["things"][1].update(id="thing-0001"), "ids of things must be unique"),
        (lambda d: d.update(frame="moon"), 'one of "first camera", "gravity-aligned", "dataset" at frame'),
        (lambda d: d["up"].update(direction=[0, 0, 3]), "valid values at up, found up direction must be"),
        (lambda d: d.update(classes=[1]), "a list of strings at classes"),
        (lambda d: d.update(things={}), "a list at things"),
    ],
)
def test_every_mistake_in_a_document_is_named(make_map, tmp_path, change, message):
    document = broken(json.loads(format_document(to_document(make_map()))), change)
    file = tmp_path / "map.json"
    with pytest.raises(InputError, match=message) as caught:
        from_document(document, file)
    assert str(caught.value).startswith(f"{file}: expected ")
    assert caught.value.remedy


def test_files_that_are_no_maps(tmp_path):
    with pytest.raises(InputError, match="found nothing; give the output folder"):
        ObjectMap.load(tmp_path)
    (tmp_path / "map.json").write_text('{"schema": ')
    with pytest.raises(InputError, match="broken JSON at line 1"):
        ObjectMap.load(tmp_path)
    (tmp_path / "map.json").write_text("[1, 2]")
    with pytest.raises(InputError, match=r"an object at the top, found \[1, 2\]"):
        ObjectMap.load(tmp_path)
    (tmp_path / "map.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="a readable text file"):
        ObjectMap.load(tmp_path)

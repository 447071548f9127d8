"""Embeddings of things: from the detector through the mappers into the map's file and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sample_maps import GIVEN_POSES, feed
from typer.testing import CliRunner

from thingmap.datasets.errors import InputError
from thingmap.detectors.detections import Detections
from thingmap.detectors.recorded.thingmap_json import write_detections
from thingmap.mapper.cli.main import app
from thingmap.mapper.edits.editor import MapEditor
from thingmap.mapper.map.appearance import Appearance
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.multiview.track_mapper import TrackMapper


def look(count: int, k: int) -> np.ndarray:
    """What the k-th class looks like."""
    return np.eye(count, dtype=np.float32)[k]


@pytest.fixture(scope="module")
def seen(sample_detections) -> list[Detections]:
    """Every box looks like its class, with some noise, and as long as it likes."""
    rng, found = np.random.default_rng(0), []
    for detections in sample_detections:
        count = len(detections.classes)
        clean = np.array([look(count, k) for k in detections.class_id]).reshape(-1, count)
        noisy = clean + 0.05 * rng.normal(size=clean.shape)
        found.append(replace(detections, embedding=noisy * rng.uniform(0.5, 20.0, (len(clean), 1))))
    return found


@pytest.mark.parametrize("mapper_class", [SemanticMapper, TrackMapper])
def test_things_look_as_their_detections(mapper_class, sample_frames, seen):
    object_map = feed(mapper_class(config=GIVEN_POSES), sample_frames, seen).object_map()
    assert len(object_map) >= 5
    for thing in object_map.things:
        assert thing.embedding is not None and thing.embedding.dtype == np.float32
        assert np.linalg.norm(thing.embedding) == pytest.approx(1.0, abs=1e-6)
        assert not thing.embedding.flags.writeable
        assert 1 <= thing.appearance.read().views <= len(sample_frames)
    looks_right = [t.embedding[object_map.classes.index(t.label)] > 0.9 for t in object_map.things]
    assert np.mean(looks_right) > 0.9


def test_what_a_detector_saw_is_found_by_words_after_a_run(tmp_path, sample_frames, seen):
    """Embeddings in a file of detections, a run of the command, the map read again, and a text encoder."""
    names = [frame.name for frame in sample_frames]
    file, classes = tmp_path / "seen.json", seen[0].classes
    write_detections(file, classes, zip(names, seen, strict=True))
    arguments = [
        "run",
        "sample:tabletop?frames=80&width=320",
        "--detector",
        f"recorded:{file}",
        "-o",
        str(tmp_path / "out"),
    ]
    options = ["--stride", "4", "--odometry", "poses"]
    result = CliRunner().invoke(app, [*arguments, *options])
    assert result.exit_code == 0, result.output
    object_map = ObjectMap.load(tmp_path / "out")
    meant = {"something to drink from": "cup", "breakfast in a carton": "cereal box"}

    def encoder(text: str) -> np.ndarray:
        return look(len(classes), classes.index(meant[text]))

    for text, label in meant.items():
        answers = object_map.find(text, 0.1, encoder=encoder)
        assert answers and {answer.thing.label for answer in answers} == {label}
        assert sum(answer.probability for answer in answers) <= 1.0


def test_detections_without_embeddings_make_things_without(sample_frames, sample_detections):
    object_map = feed(SemanticMapper(config=GIVEN_POSES), sample_frames[:6], sample_detections[:6]).object_map()
    assert len(object_map) and all(thing.embedding is None for thing in object_map.things)


@pytest.fixture
def written(tmp_path, make_thing, make_map):
    """Two things with embeddings, one without."""
    things = (
        make_thing(1, appearance=Appearance(np.array([3.0, 4.0]), 5)),
        make_thing(2, appearance=Appearance(np.array([0.0, 1.0]), 3)),
        make_thing(3, position=[5, 5, 5]),
    )
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(*things))
    return folder


def test_what_is_read_is_what_was_written(written):
    object_map = written.read_map()
    written.embeddings_file.rename(written.path / "aside")
    assert object_map.things[0].label == "cup"  # read only when it is asked for
    (written.path / "aside").rename(written.embeddings_file)
    one, two, three = object_map.things
    np.testing.assert_array_equal(one.embedding, np.array([0.6, 0.8], dtype=np.float32))
    assert one.appearance.read().views == 5 and two.appearance.read().views == 3 and three.embedding is None
    again = ObjectMap.load(object_map.save(written.path / "deep" / "copy.json"))
    assert (written.path / "deep" / "copy.embeddings.npz").exists()
    np.testing.assert_array_equal(again.things[0].embedding, one.embedding)


@pytest.mark.parametrize("content", [None, b"", b"PK\x03\x04 no archive"])
def test_a_file_that_is_not_the_maps_is_named(written, content):
    written.embeddings_file.unlink()
    if content is not None:
        written.embeddings_file.write_bytes(content)
    with pytest.raises(InputError, match=r"embeddings.npz: expected the embeddings of the things in map.json"):
        _ = written.read_map().things[0].embedding


def test_a_merged_thing_looks_like_the_mean_over_all_views(written):
    MapEditor(written.path, who="Ann").merge(["thing-0001", "thing-0002"])
    thing = written.read_map().thing("thing-0001")
    total = 5 * np.array([0.6, 0.8]) + 3 * np.array([0.0, 1.0])
    np.testing.assert_allclose(thing.embedding, total / np.linalg.norm(total), rtol=1e-6)
    assert thing.appearance.read().views == 8


def test_appearances_that_are_none():
    for embedding, views in ((np.zeros(3), 1), (np.ones((2, 2)), 1), (np.array([np.nan, 1.0]), 1), (np.ones(2), 0)):
        with pytest.raises(ValueError, match=r"embedding must be|views must be"):
            Appearance(embedding, views)

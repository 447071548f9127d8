"""The model's file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.detectors.hog.model import shipped_model
from thingmap.detectors.model_file import schema_of
from thingmap.detectors.shape_context.calibration import FEATURES, Calibration
from thingmap.detectors.shape_context.codebook import Codebook
from thingmap.detectors.shape_context.config import LENGTH, Context, VotingConfig
from thingmap.detectors.shape_context.model import REMEDY, ShapeContextModel, load_model


def make_model(classes: tuple[str, ...] = ("can", "mug")) -> ShapeContextModel:
    rng = np.random.default_rng(0)
    books = []
    for k in range(len(classes)):
        bins = rng.random((7 + k, LENGTH)) * (rng.random((7 + k, LENGTH)) < 0.3)
        bins /= bins.sum(axis=1, keepdims=True)
        books.append(Codebook(bins, rng.normal(size=(7 + k, 2)), rng.random((7 + k, 2)) + 0.1, 0.05, 90.0, 9.0, 2e-3))
    count = len(classes)
    rivals = {0.05: books[0].descriptors[::-1]}
    calibration = Calibration(np.ones((count, len(FEATURES))), np.zeros(count))
    voting = VotingConfig(context=Context.IMAGE)
    return ShapeContextModel(classes, tuple(books), rivals, calibration, voting, {"seed": 3})


def test_what_was_saved_is_loaded(tmp_path: Path):
    model, path = make_model(), tmp_path / "m.npz"
    model.save(path)
    again = load_model(path)
    assert again.classes == model.classes and again.voting == model.voting and again.about == {"seed": 3}
    for one, other in zip(model.codebooks, again.codebooks, strict=True):
        # half a level of a row's largest bin
        assert np.abs(one.descriptors - other.descriptors).max() <= 0.6 / 255 * one.descriptors.max()
        np.testing.assert_array_equal(one.offsets, other.offsets)
        np.testing.assert_array_equal(one.sizes, other.sizes)
        assert (one.radius, one.edge_mean, one.edge_std, one.depth) == (
            other.radius, other.edge_mean, other.edge_std, other.depth,
        )  # fmt: skip
    assert list(again.rivals) == [0.05] and np.abs(again.rivals[0.05] - model.rivals[0.05]).max() < 1e-3
    np.testing.assert_array_equal(again.calibration.weights, model.calibration.weights)


def test_saving_what_was_loaded_gives_the_same_file(tmp_path: Path):
    make_model().save(tmp_path / "a.npz")
    load_model(tmp_path / "a.npz").save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_model_of_another_detector_is_refused():
    with pytest.raises(InputError, match="expected a shape-context model") as error:
        load_model(shipped_model())
    assert error.value.found == "'thingmap-hog/1'" and error.value.remedy == REMEDY


@pytest.mark.parametrize(
    "spoil",
    [
        lambda document, arrays: arrays.pop("descriptors_1"),
        lambda document, arrays: document.pop("calibration"),
        lambda document, arrays: arrays.update(rivals_0=arrays["rivals_0"][:, :9]),
        lambda document, arrays: document["codebooks"][0].pop("radius"),
        lambda document, arrays: document["voting"].update(context="nowhere"),
        lambda document, arrays: document["voting"].update(unheard_of=1),
        lambda document, arrays: arrays.update(descriptors_0=arrays["descriptors_0"].astype(np.float32)),
    ],
)
def test_a_damaged_model_is_told_not_raised(tmp_path: Path, spoil):
    from thingmap.detectors.model_file import read_document, write_document
    from thingmap.detectors.shape_context.model import SCHEMA

    path = tmp_path / "m.npz"
    make_model().save(path)
    document, arrays = read_document(path, SCHEMA, "", "")
    spoil(document, arrays)
    write_document(path, document, arrays)
    with pytest.raises(InputError) as error:
        load_model(path)
    assert error.value.path == path and error.value.remedy == REMEDY


def test_parts_must_fit():
    model = make_model()
    with pytest.raises(ValueError, match="must be as many"):
        replace(model, classes=("can",))
    with pytest.raises(ValueError, match="rivals must be of the codebooks' radii"):
        replace(model, rivals={0.07: model.rivals[0.05]})
    book = model.codebooks[0]
    for name, value in (("offsets", book.offsets[:3]), ("descriptors", -book.descriptors), ("radius", 0.0)):
        with pytest.raises(ValueError):
            replace(book, **{name: value})


def test_files_say_what_they_are_for(tmp_path: Path):
    make_model().save(tmp_path / "m.npz")
    assert schema_of(tmp_path / "m.npz").startswith("thingmap-shape-context/")
    assert schema_of(shipped_model()).startswith("thingmap-hog/")
    np.savez(tmp_path / "other.npz", a=np.zeros(2))
    (tmp_path / "text.npz").write_text("no archive")
    assert [schema_of(tmp_path / name) for name in ("other.npz", "text.npz", "absent.npz")] == ["", "", ""]

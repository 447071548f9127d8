"""Templates, and the file they are kept in."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.detectors.detections import Part
from thingmap.detectors.hog import model as hog_model
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.config import PyramidConfig
from thingmap.detectors.hog.model import SCHEMA, HogModel, HogTemplate, load_model, shipped_model


def template(seed: int = 0, part: Part = Part.WHOLE, class_id: int = 0, rows: int = 6) -> HogTemplate:
    weights = np.random.default_rng(seed).normal(scale=0.01, size=(rows, 4, 51))
    return HogTemplate(class_id, part, weights, 0.25, -1.1, (-2.3, 0.7), (0.1, 0.0, 0.9, 1.0))


@pytest.fixture
def model() -> HogModel:
    templates = (template(0), template(1, Part.TOP, rows=3), template(2, class_id=1))
    about = {"seed": 0, "sources": ["a", "b"], "counts": {"mug": 3}}
    return HogModel(("mug", "bowl"), Channels.DEPTH, templates, PyramidConfig(levels_per_octave=5), about)


def test_there_and_back(model: HogModel, tmp_path: Path):
    model.save(tmp_path / "m.npz")
    back = load_model(tmp_path / "m.npz")
    assert (back.classes, back.channels, back.pyramid) == (model.classes, model.channels, model.pyramid)
    assert back.about == model.about
    for old, new in zip(model.templates, back.templates, strict=True):
        for name in ("class_id", "part", "scale_weight", "bias", "platt", "box"):
            assert getattr(new, name) == getattr(old, name), name
        assert new.weights.dtype == np.float32
        assert np.abs(new.weights - old.weights).max() <= np.abs(old.weights).max() * 2.0**-11


def test_saving_what_was_loaded_gives_the_same_bytes(model: HogModel, tmp_path: Path):
    model.save(tmp_path / "a.npz")
    load_model(tmp_path / "a.npz").save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.npz", "b.npz"]


def test_rounding_hardly_moves_a_score(model: HogModel, tmp_path: Path):
    model.save(tmp_path / "m.npz")
    rounded = load_model(tmp_path / "m.npz").templates[0].weights
    features = np.random.default_rng(0).uniform(0.0, 0.2, size=(200, 6, 4, 51))
    moved = np.tensordot(features, rounded - model.templates[0].weights, 3)
    assert 0.0 < np.abs(moved).max() < 1e-3


def test_tiny_and_absent_weights_survive(tmp_path: Path):
    weights = np.zeros((2, 2, 31))
    weights[0, 0, 0] = 1e-12
    for w in (weights, 0.0 * weights):
        flat = HogTemplate(0, Part.WHOLE, w, 0.0, 0.0, (-1.0, 0.0), (0.0, 0.0, 1.0, 1.0))
        HogModel(("x",), Channels.RGB, (flat,), PyramidConfig(), {}).save(tmp_path / "m.npz")
        assert load_model(tmp_path / "m.npz").templates[0].weights == pytest.approx(flat.weights, rel=1e-6, abs=0)


def test_a_model_that_cannot_be_written_leaves_the_old_one(model: HogModel, tmp_path: Path):
    path = tmp_path / "m.npz"
    model.save(path)
    before = path.read_bytes()
    with pytest.raises(TypeError):
        replace(model, about={"when": object()}).save(path)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
    with pytest.raises(UserError, match=r"m\.npz: cannot be written"):
        model.save(tmp_path / "nowhere" / "m.npz")


def changed(path: Path, **entries: np.ndarray | None) -> None:
    with np.load(path) as file:
        content = {name: file[name] for name in file.files} | entries
    np.savez(path, allow_pickle=False, **{name: value for name, value in content.items() if value is not None})


def edited(path: Path, **keys) -> None:
    with np.load(path) as file:
        document = json.loads(str(file["document"]))
    changed(path, document=np.array(json.dumps({k: v for k, v in {**document, **keys}.items() if v is not ...})))


ROW = {"class_id": 0, "part": "whole", "scale_weight": 0, "bias": 0, "largest_weight": 1, "platt": [-1, 0]}


@pytest.mark.parametrize(
    ("spoil", "found"),
    [
        (lambda p: p.unlink(), "no such file"),
        (lambda p: p.write_text("no model at all"), "expected a HOG model"),
        (lambda p: p.write_bytes(b""), "expected a HOG model"),
        (lambda p: p.write_bytes(p.read_bytes()[:-200]), "expected a HOG model"),
        (lambda p: np.save(p.open("wb"), np.zeros(3)), "a single array"),
        (lambda p: np.savez(p, x=np.zeros(3)), "no 'document'"),
        (lambda p: np.savez(p, document=np.array([{}], dtype=object), allow_pickle=True), "allow_pickle=False"),
        (lambda p: changed(p, document=np.array("[1]")), "expected a HOG model"),
        (lambda p: changed(p, document=np.array("{")), "expected a HOG model"),
        (lambda p: changed(p, weights_1=None), "no 'weights_1'"),
        (lambda p: changed(p, weights_0=np.zeros((2, 51), np.float16)), r"weights must have shape .* \(2, 51\)"),
        (lambda p: changed(p, weights_0=np.zeros((2, 2, 31), np.float16)), "51 channels, but a template has 31"),
        (lambda p: changed(p, weights_0=np.full((2, 2, 51), np.nan, np.float16)), "finite"),
        (lambda p: changed(p, weights_0=np.array("text")), "weights of type"),
        (lambda p: edited(p, schema="thingmap-hog/9"), f"{SCHEMA}.*found 'thingmap-hog/9'"),
        (lambda p: edited(p, schema=...), "no 'schema'"),
        (lambda p: edited(p, pyramid=...), "no 'pyramid'"),
        (lambda p: edited(p, pyramid={"octaves": 3}), "octaves"),
        (lambda p: edited(p, pyramid={"levels_per_octave": 0}), "levels_per_octave"),
        (lambda p: edited(p, channels="thermal"), "thermal"),
        (lambda p: edited(p, classes=["a", "a"]), "'a' twice"),
        (lambda p: edited(p, classes=["a"]), "class_id 1"),
        (lambda p: edited(p, templates=[ROW]), "no 'box'"),
        (lambda p: edited(p, templates=[{**ROW, "box": [0, 0, 1]}]), "not enough values"),
        (lambda p: edited(p, templates=[{**ROW, "box": [0, 0, 0, 1]}]), "x0 < x1"),
        (lambda p: edited(p, templates=[{**ROW, "box": [0, 0, 1, 1], "platt": [1, 0]}]), "u <= 0"),
        (lambda p: edited(p, templates=[{**ROW, "box": [0, 0, 1, 1], "part": "lid"}]), "LID"),
        (lambda p: edited(p, templates=3), "not iterable"),
        (lambda p: edited(p, templates=[]), "at least one template"),
    ],
)
def test_files_that_are_no_models(model: HogModel, tmp_path: Path, spoil, found: str):
    path = tmp_path / "m.npz"
    model.save(path)
    spoil(path)
    with pytest.raises(InputError, match=found) as error:
        load_model(path)
    assert error.value.path == path and error.value.remedy == hog_model.REMEDY


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": np.zeros((2, 31))}, r"\(2, 31\)"),
        ({"weights": np.zeros((0, 3, 31))}, r"\(0, 3, 31\)"),
        ({"bias": np.nan}, "finite"),
        ({"platt": (-1.0,)}, "platt"),
        ({"platt": (0.5, 0.0)}, "u <= 0"),
        ({"box": (0.0, 0.5, 1.0, 0.5)}, "y0 < y1"),
    ],
)
def test_templates_without_sense(change: dict, message: str):
    with pytest.raises(ValueError, match=message):
        replace(template(), **change)


def test_the_shipped_model_lies_in_the_package():
    assert shipped_model().name == "synthetic.npz"
    assert shipped_model().parent.parent == Path(hog_model.__file__).parent

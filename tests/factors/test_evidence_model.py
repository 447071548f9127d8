"""Files of learned evidence: what is written is read back, and every mistake in one is named."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError, UserError
from thingmap.factors.detection_model import DetectionModel
from thingmap.factors.evidence_file import SCHEMA
from thingmap.factors.evidence_model import (
    EvidenceModel,
    default_evidence_model,
    generic_evidence_model,
    load_evidence_model,
)
from thingmap.factors.existence import ExistenceModel
from thingmap.factors.score_model import BIN_CENTRES, ScoreModel

CLASSES = ("mug", "cereal box", "Teekännchen")
SCORE_ARRAYS = [field.name for field in fields(ScoreModel) if field.name != "classes"]


def learned(seed: int = 0) -> EvidenceModel:
    """A model in which every number differs from every other."""
    rng = np.random.default_rng(seed)
    scores = ScoreModel(
        CLASSES,
        mean=rng.uniform(0.2, 0.8, (4, 5, 10)),
        sigma=rng.uniform(0.1, 0.3, (4, 5, 10)),
        background_mean=rng.uniform(0.05, 0.2, (4, 5)),
        background_sigma=rng.uniform(0.1, 0.2, (4, 5)),
        other_sigma=rng.uniform(0.03, 0.1, 5),
        confusion=rng.uniform(0.05, 0.3, 5),
        platt_ab=rng.uniform((-12.0, 2.0), (-8.0, 4.0), (5, 2)),
        linear_range=rng.uniform((0.1, 0.4), (0.2, 0.6), (5, 2)),
    )
    detection = DetectionModel(CLASSES, rng.normal(size=(4, 5)), rng.normal(size=(5, 7)), rng.normal(size=(5, 8)))
    root = rng.normal(size=(3, 3))
    size = rng.normal(-2.5, 0.5, 3), root @ root.T + 0.1 * np.eye(3)
    existence = replace(ExistenceModel(), null_prior=0.37, object_rate=(3.1, 1.7))
    return EvidenceModel(scores, detection, existence, 'two sequences of a "made-up" world\nand a detector', size)


def assert_same(a: EvidenceModel, b: EvidenceModel) -> None:
    """To the digits that a file keeps."""
    assert a.classes == b.classes and a.learned_from == b.learned_from and a.existence == b.existence
    for name in SCORE_ARRAYS:
        np.testing.assert_allclose(getattr(a.scores, name), getattr(b.scores, name), rtol=1e-4, err_msg=name)
    for name in ("intercept", "visible", "side"):
        np.testing.assert_allclose(getattr(a.detection, name), getattr(b.detection, name), rtol=1e-4, err_msg=name)
    assert (a.background_size is None) == (b.background_size is None)
    for one, other in zip(a.background_size or (), b.background_size or (), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4)


@pytest.mark.parametrize("model", [learned(), replace(learned(1), background_size=None), generic_evidence_model()])
def test_what_is_written_is_read_back(tmp_path, model):
    path = tmp_path / "model.json"
    model.save(path)
    again = load_evidence_model(path)
    assert_same(model, again)
    again.save(tmp_path / "again.json")
    assert path.read_bytes() == (tmp_path / "again.json").read_bytes()  # five digits stay as they are


def test_people_find_a_row_of_numbers_on_a_line(tmp_path):
    model = learned()
    model.save(tmp_path / "model.json")
    lines = (tmp_path / "model.json").read_text(encoding="utf-8").splitlines()
    assert '   "name": "Teekännchen",' in lines
    row = ", ".join(f"{float(f'{x:.5g}')}" for x in model.scores.mean[1, 2])
    assert any(line.strip() == f"[{row}]," for line in lines)


def test_a_file_that_cannot_be_written_is_the_users_to_solve(tmp_path):
    with pytest.raises(UserError, match="cannot be written"):
        learned().save(tmp_path / "nowhere" / "model.json")


def test_scores_and_detection_are_bound_together():
    bound = learned().bind(["Cereal_Box", "sofa"])
    assert bound.classes == bound.scores.classes == bound.detection.classes == ("Cereal_Box", "sofa")
    np.testing.assert_array_equal(bound.scores.mean, learned().scores.mean[[1, 3, 3]])
    np.testing.assert_array_equal(bound.detection.intercept, learned().detection.intercept[[1, 3, 3]])


def test_the_shipped_model_tells_objects_from_false_boxes():
    model = load_evidence_model()
    pooled = model.scores.own_parameters(0, 0.0)[0][-1]
    assert pooled > model.scores.background_mean[-1, 0] + 0.1
    assert model.detection.probability(1.0, 128.0) > 2.0 * model.detection.probability(0.15, 128.0)
    assert model.detection.relative(1.0, 128.0) > 0.8
    assert model.background_size is not None and model.existence != ExistenceModel()


def test_a_detector_of_other_classes_gets_the_generic_model():
    shipped = load_evidence_model()
    assert len(shipped.classes) >= 5
    assert default_evidence_model(shipped.classes).learned_from == shipped.learned_from
    assert default_evidence_model([name.upper() for name in shipped.classes] + ["sofa"]).classes == shipped.classes
    strangers = ["sofa", "person", "car", shipped.classes[0]]
    assert default_evidence_model(strangers).learned_from == generic_evidence_model().learned_from


def document_of(tmp_path: Path, model: EvidenceModel) -> tuple[Path, dict[str, Any]]:
    path = tmp_path / "model.json"
    model.save(path)
    return path, json.loads(path.read_text(encoding="utf-8"))


def put(value: Any, *place: str | int):
    """A change of the document that puts a value at a place."""

    def change(document: Any) -> None:
        for key in place[:-1]:
            document = document[key]
        document[place[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (put("thingmap-evidence/9", "schema"), [SCHEMA, "thingmap-evidence/9"]),
        (lambda d: d.pop("schema"), ["schema", "none"]),
        (lambda d: d.pop("pooled"), ["pooled", "no such key"]),
        (lambda d: d.pop("background_size"), ["background_size", "no such key"]),
        (put(3, "learned_from"), ["a string at learned_from"]),
        (put("mug", "classes"), ["a list at classes"]),
        (put("", "classes", 1, "name"), ["a name at classes[1].name"]),
        (put("MUG", "classes", 1, "name"), ["'mug' twice"]),
        (put(-0.2, "classes", 1, "sigma", 2, 3), ["classes[1]", "sigma[2, 3] = -0.2", "from 0.001"]),
        (put(0, "classes", 0, "sigma", 0, 0), ["classes[0]", "sigma[0, 0] = 0"]),
        (put(1.2, "pooled", "mean", 4, 9), ["pooled", "mean[4, 9] = 1.2", "from 0 to 1"]),
        (put(float("nan"), "pooled", "mean", 4, 9), ["pooled", "mean[4, 9] = nan"]),
        (put(float("inf"), "templates", "platt_ab", 1, 0), ["templates", "platt_ab[1, 0] = inf"]),
        (put([0.5] * 5, "pooled", "mean"), ["5 x 10 numbers at pooled.mean"]),
        (put([[0.5] * 10] * 4 + [[0.5]], "pooled", "mean"), ["5 x 10 numbers at pooled.mean"]),
        (put("high", "templates", "confusion", 0), ["5 numbers at templates.confusion"]),
        (put(1.5, "templates", "confusion", 0), ["templates", "confusion[0] = 1.5"]),
        (put([0.6, 0.5], "templates", "linear_range", 3), ["linear_range"]),
        (put(99.0, "templates", "detection_side", 0, 0), ["detection_side[0, 0] = 99"]),
        (put(1.0, "templates", "sharpness"), ["templates", "the key 'sharpness'"]),
        (put(1.0, "classes", 2, "colour"), ["classes", "the key 'colour'"]),
        (put(1.0, "existence", "hope"), ["existence", "the key 'hope'"]),
        (lambda d: d["existence"].pop("object_rate"), ["existence.object_rate", "no such key"]),
        (put([1.0], "existence", "object_rate"), ["2 numbers at existence.object_rate"]),
        (put("even", "existence", "null_prior"), ["a number at existence.null_prior"]),
        (put(float("nan"), "existence", "object_rate", 0), ["existence", "object_rate[0] = nan"]),
        (put([0.0] * 4, "background_size", "mean"), ["3 numbers at background_size.mean"]),
        (put(9.0, "background_size", "covariance", 0, 1), ["background_size", "symmetric"]),
        (put([[0.0] * 3] * 3, "background_size", "covariance"), ["background_size", "positive definite"]),
    ],
)
def test_mistakes_in_a_file_are_named(tmp_path, change, says):
    path, document = document_of(tmp_path, learned())
    change(document)
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_evidence_model(path)
    for text in (str(path), "thingmap learn", *says):
        assert text in str(error.value)


@pytest.mark.parametrize(("text", "found"), [("", "empty"), ("{", "no JSON"), ("[1]", "[1]"), ('{"a": 1}', "none")])
def test_files_of_something_else_are_refused(tmp_path, text, found):
    path = tmp_path / "model.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="expected") as error:
        load_evidence_model(path)
    assert found in error.value.found


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nothing\.json"):
        load_evidence_model(tmp_path / "nothing.json")


def places(value: Any, here: tuple = ()) -> list[tuple]:
    """Where every value inside a document is."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, item in items for place in ((*here, key), *places(item, (*here, key)))]


@settings(
    deadline=None, derandomize=True, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.data(), st.sampled_from(["remove", 1e9, -1e9, "many", [], {}, None, float("nan"), 10**400]))
def test_no_damage_goes_unnoticed_or_unexplained(tmp_path, data, damage):
    path, document = document_of(tmp_path, learned())
    harmless = {("learned_from",), ("classes",), ("background_size",)}  # any text; fewer classes; none
    harmless |= {("classes", k) for k in range(3)} | {("classes", k, "name") for k in range(3)}
    harmless |= {place for place in places(document) if place[0] == "existence"}  # any finite numbers
    place = data.draw(st.sampled_from([place for place in places(document) if place not in harmless]))
    parent = document
    for key in place[:-1]:
        parent = parent[key]
    if damage == "remove":
        del parent[place[-1]]
    else:
        parent[place[-1]] = damage
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError):
        load_evidence_model(path)


def test_models_of_different_classes_do_not_go_together():
    model = learned()
    with pytest.raises(ValueError, match="but detection of"):
        replace(model, detection=model.detection.bind(["mug"]))


def test_the_generic_scores_fall_with_occlusion_and_halves_score_less():
    scores = generic_evidence_model().scores
    whole = [scores.own_parameters(0, o)[0][0] for o in BIN_CENTRES]
    assert whole[0] == pytest.approx(0.52, abs=0.02)
    assert scores.own_parameters(0, 0.7)[0][0] == pytest.approx(0.28)
    assert (np.diff(whole) <= 0.0).all()
    assert all(
        scores.own_parameters(part, o)[0][0] < m
        for part in (1, 2, 3, 4)
        for o, m in zip(BIN_CENTRES, whole, strict=True)
    )


def test_the_generic_p_d_needs_a_view_and_some_pixels():
    detection = generic_evidence_model().detection
    assert detection.probability(1.0, 100.0) == pytest.approx(0.67, abs=0.01)
    assert (detection.probability(np.array([0.0, 0.3, 1.0]), np.array([100.0, 100.0, 8.0])) < 0.02).all()
    along_visible = detection.probability(np.linspace(0.0, 1.0, 50), 100.0)
    along_side = detection.probability(1.0, np.geomspace(2.0, 800.0, 50))
    assert (np.diff(along_visible) >= 0.0).all() and (np.diff(along_side) >= 0.0).all()
    assert all(detection.probability(1.0, 100.0, part) < 0.6 for part in (1, 2, 3, 4))


def test_generic_platt_scaling_is_what_the_generic_densities_say():
    """Probability of an object among as many false boxes, at the mean scores of both."""
    scores = generic_evidence_model().scores.bind(["thing", "other"])
    for s in (0.12, 0.52):
        evidence = scores.evidence(np.array([s, 0.0]), 0.0)
        log_odds = evidence.own[0] - evidence.background[0]
        assert np.log(scores.platt(s) / (1.0 - scores.platt(s))) == pytest.approx(log_odds, abs=0.4)

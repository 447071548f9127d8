"""Which evidence model is taken: the configuration's, the detector's own, or one by the classes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from shutil import copyfile

import pytest

from thingmap.datasets.errors import InputError
from thingmap.detectors.detector import find_nothing
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.model import load_model, shipped_model
from thingmap.factors.evidence_model import SHIPPED, SHIPPED_HOG, generic_evidence_model, load_evidence_model
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.evidence_choice import evidence_model, with_evidence_of
from thingmap.mapper.mapper import SemanticMapper


def test_the_shipped_detector_brings_what_was_learned_of_it():
    detector = HogDetector()
    assert with_evidence_of(detector, MapperConfig()).evidence.model == "hog"
    assert SemanticMapper(detector).config.evidence.model == "hog"
    known, usual = evidence_model("hog"), load_evidence_model(SHIPPED)
    assert known is not None and known.learned_from == load_evidence_model(SHIPPED_HOG).learned_from
    assert set(known.classes) == set(usual.classes) and known.learned_from != usual.learned_from


def test_the_configuration_comes_first():
    config = MapperConfig()
    generic = replace(config, evidence=replace(config.evidence, model="generic"))
    assert with_evidence_of(HogDetector(), generic) == generic
    chosen = evidence_model("generic")
    assert chosen is not None and chosen.learned_from == generic_evidence_model().learned_from


def test_a_detector_of_which_nothing_is_known_changes_nothing():
    config = MapperConfig()
    assert with_evidence_of(find_nothing, config) is config and with_evidence_of(None, config) is config
    assert with_evidence_of(HogDetector(load_model(shipped_model())), config) is config
    assert evidence_model("") is None


def test_what_was_learned_of_a_file_lies_beside_it(tmp_path: Path):
    file, beside = tmp_path / "mine.npz", tmp_path / "mine.evidence.json"
    copyfile(shipped_model(), file)
    assert HogDetector(file).evidence_model == ""
    copyfile(SHIPPED, beside)
    assert HogDetector(str(file)).evidence_model == str(beside)
    found = evidence_model(str(beside))
    assert found is not None and found.learned_from == load_evidence_model(SHIPPED).learned_from
    with pytest.raises(InputError, match=r"nothing\.json"):
        evidence_model(str(tmp_path / "nothing.json"))

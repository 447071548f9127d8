"""The script that learns the second stage of the shipped HOG model, on a few frames."""

from __future__ import annotations

import hog_evidence
import hog_second_stage
import numpy as np
import pytest
from hog_model import scene_configs as scenes_of_templates
from suite import FIRST_SEED

from thingmap.detectors.hog.model import load_model, shipped_model


def test_it_writes_the_shipped_templates_with_another_second_stage(tmp_path, capsys):
    before, output = shipped_model().read_bytes(), tmp_path / "model.npz"
    assert hog_second_stage.main(["--quick", "--folder", str(tmp_path), "-o", str(output)]) == 0
    shipped, made = load_model(shipped_model()), load_model(output)
    assert "looking at windows" in capsys.readouterr().err
    for old, new in zip(shipped.templates, made.templates, strict=True):
        np.testing.assert_array_equal(new.weights, old.weights)
    assert made.second_stage is not None and shipped.second_stage is not None
    assert made.second_stage.weights[0].shape != shipped.second_stage.weights[0].shape
    assert shipped_model().read_bytes() == before


def test_what_is_shipped_is_of_all_its_scenes():
    about = load_model(shipped_model()).about["second_stage"]
    names = [hog_second_stage.scene_name(config) for config, _ in hog_second_stage.scene_configs()]
    assert about["settings"]["sources"] == names
    assert all(count > 500 for count in about["windows"].values())


def test_no_scene_is_one_of_a_benchmark_or_of_anything_else_that_is_learned():
    seeds = {(config.preset, config.seed) for config, _ in hog_second_stage.scene_configs()}
    of_templates = {(config.preset, config.seed) for config, _, _ in scenes_of_templates()}
    of_evidence = {(preset, seed) for preset, _, its in hog_evidence.SCENES for seed in its}
    assert seeds.isdisjoint(of_templates | of_evidence) and all(0 < seed < FIRST_SEED for _, seed in seeds)


@pytest.mark.parametrize("arguments", [[], ["--write", "-o", "x.npz"], ["--write", "--quick"]])
def test_it_asks_where_to_write(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        hog_second_stage.main(arguments)
    assert stopped.value.code == 2

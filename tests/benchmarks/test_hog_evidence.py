"""The script that learns what to know of the shipped HOG model, on three tables of a few frames."""

from __future__ import annotations

import hog_evidence
import pytest
from hog_model import scene_configs
from suite import FIRST_SEED

from thingmap.datasets.synthetic.config import ClutterLevel
from thingmap.detectors.hog.model import load_model, shipped_model
from thingmap.factors.evidence_model import SHIPPED_HOG, load_evidence_model


def test_it_writes_a_model_of_the_detectors_classes(tmp_path, capsys):
    shipped, output = SHIPPED_HOG.read_bytes(), tmp_path / "model.json"
    assert hog_evidence.main(["--quick", "--folder", str(tmp_path), "-o", str(output)]) == 0
    model = load_evidence_model(output)
    assert set(model.classes) == set(load_model(shipped_model()).classes)
    assert model.learned_from.startswith("3 sequences") and model.learned_from.endswith(hog_evidence.NAME)
    assert str(output) in capsys.readouterr().err
    assert SHIPPED_HOG.read_bytes() == shipped


def test_what_is_shipped_is_of_all_its_scenes():
    scenes = len(ClutterLevel) * sum(len(seeds) for _, _, seeds in hog_evidence.SCENES)
    learned_from = load_evidence_model(SHIPPED_HOG).learned_from
    assert learned_from.startswith(f"{scenes} sequences") and learned_from.endswith(hog_evidence.NAME)


def test_no_scene_is_one_of_a_benchmark_or_of_the_templates():
    of_templates = {(config.preset, config.seed) for config, _, _ in scene_configs()}
    seeds = {(preset, seed) for preset, _, seeds in hog_evidence.SCENES for seed in seeds}
    assert seeds.isdisjoint(of_templates) and all(0 < seed < FIRST_SEED for _, seed in seeds)


@pytest.mark.parametrize("arguments", [[], ["--write", "-o", "x.json"], ["--write", "--quick"]])
def test_it_asks_where_to_write(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        hog_evidence.main(arguments)
    assert stopped.value.code == 2

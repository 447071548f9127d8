"""The script that learns the shipped model, on two scenes of a few small frames."""

from __future__ import annotations

from pathlib import Path

import default_model
import pytest
from suite import FIRST_SEED

from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.factors.evidence_model import SHIPPED, load_evidence_model


def tiny(seed: int) -> SyntheticConfig:
    return SyntheticConfig(Preset.SURVEY, objects=8, clutter=ClutterLevel.LOW, seed=seed, frames=12, width=240)


@pytest.fixture
def small_scenes(monkeypatch) -> None:
    monkeypatch.setattr(default_model, "_configs", lambda: iter([tiny(3), tiny(4)]))


def test_it_writes_a_model_and_keeps_its_scenes(small_scenes, tmp_path, capsys):
    shipped = SHIPPED.read_bytes()
    folder, output = tmp_path / "scenes", tmp_path / "model.json"
    assert default_model.main(["--folder", str(folder), "-o", str(output)]) == 0
    said = capsys.readouterr().err
    # two scenes, one of them with two detectors, mapped twice
    assert said.count("mapped") == 6 and "mapped 72 frames" in said
    assert "records of landmarks" in said and str(output) in said
    model = load_evidence_model(output)
    assert model.learned_from.startswith("2 sequences") and model.learned_from.endswith(default_model.NAME)
    assert "24 frames" in model.learned_from  # of the detectors that have parts
    assert model.background_size is not None
    assert (model.scores.own_parameters(1, 0.0)[0] > 0.1).all()  # halves were learned
    assert SHIPPED.read_bytes() == shipped

    made = times(folder)
    for config in default_model._configs():
        default_model._render(folder, config)
    assert times(folder) == made


def times(folder: Path) -> dict[str, float]:
    return {str(file): file.stat().st_mtime for file in sorted(folder.rglob("*")) if file.is_file()}


def test_it_learns_from_every_level_of_clutter_and_from_no_seed_of_a_benchmark():
    configs = list(default_model._configs())
    assert {config.clutter for config in configs if config.preset is Preset.SURVEY} == set(ClutterLevel)
    assert {config.preset for config in configs} == {Preset.SURVEY, Preset.TABLETOP}
    assert all(0 < config.seed < FIRST_SEED for config in configs)
    names = [(config.preset, config.clutter, config.seed) for config in configs]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("arguments", [[], ["--write", "-o", "x.json"]])
def test_it_asks_where_to_write(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        default_model.main(arguments)
    assert stopped.value.code == 2 and "--write" in capsys.readouterr().err

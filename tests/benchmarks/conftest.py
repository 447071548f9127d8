"""Benchmarks are scripts that import one another from their own folder; tests find them the same way.

`tiny_hog` is beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import hog
import hog_model
import tiny_hog

from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence


@pytest.fixture(scope="session")
def hog_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One small scene, by the name of the suite's scene and by that of its configuration."""
    folder = tmp_path_factory.mktemp("hog")
    write_sequence(SyntheticSequence(tiny_hog.CONFIG), folder / "scenes" / hog_model.scene_name(tiny_hog.CONFIG))
    return folder


@pytest.fixture(scope="session")
def hog_models(hog_folder: Path) -> dict[str, Path]:
    """One for each kind of channels, hardly trained."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hog_model, "scene_configs", lambda quick: iter([(tiny_hog.CONFIG, 1, 2)]))
        config = replace(hog_model.QUICK_CONFIG, views=6, held_out_views=3, cells=24, random_windows=5)
        patch.setattr(hog_model, "QUICK_CONFIG", config)
        table = replace(hog_model.TURNTABLE, elevations=(20.0,), distances=(1.0,), azimuths=2)
        patch.setattr(hog_model, "TURNTABLE", table)
        return {name: hog_model.train_model(hog_folder, kind, quick=True) for kind, name in hog.MODELS.items()}

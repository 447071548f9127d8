"""The cabinet's cuboid beside its truth, made up and real."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cabinet import compare, main, run

from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.truth import TrueObject
from thingmap.mapper.config import OdometrySource
from thingmap.mapper.evaluation.inputs.case import Alignment

TRUTH = TrueObject(0, "cabinet", np.array([1.0, 2.0, 0.3]), np.array([0.8, 0.4, 0.6]), np.pi / 2)


def made_up(position: list[float], size: list[float]):
    thing = SimpleNamespace(position=np.array(position), size=np.array(size), yaw=0.0)
    return SimpleNamespace(things=[thing], up=SimpleNamespace(direction=np.array([0.0, 0.0, 1.0])))


def test_a_cuboid_turned_by_a_quarter_is_the_same_box_with_its_sides_exchanged() -> None:
    aligned = Alignment(np.eye(3), np.array([1.0, 1.0, 0.0]), "made up")
    found = compare(made_up([0.0, 1.0, 0.3], [0.4, 0.8, 0.6]), TRUTH, aligned)  # type: ignore[arg-type]
    assert found is not None and found.centre_error == pytest.approx(0.0) and found.overlap == pytest.approx(1.0)
    assert found.true_size == pytest.approx([0.4, 0.8, 0.6])


def test_half_a_cuboid_overlaps_by_half() -> None:
    found = compare(made_up([1.0, 1.8, 0.3], [0.4, 0.4, 0.6]), TRUTH, Alignment(np.eye(3), np.zeros(3), ""))  # type: ignore[arg-type]
    assert (
        found is not None and found.centre_error == pytest.approx(0.2) and found.overlap == pytest.approx(0.5, abs=0.05)
    )


def test_the_real_cabinet_under_its_own_poses(real_data: Path) -> None:
    folder = real_data / "tum_fr3_cabinet"
    (truth,) = open_truth(str(folder)).objects
    outcome = run(open_sequence(folder), folder, OdometrySource.POSES, truth)
    assert outcome.ate < 0.03 and outcome.volume is not None and outcome.labelled is not None
    assert outcome.volume.centre_error < 0.08 and outcome.volume.overlap > 0.2
    assert outcome.labelled.centre_error < 0.03 and outcome.labelled.overlap > 0.7


def test_a_folder_without_keyframes_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--sequence", str(tmp_path)]) == 2
    assert "error: " in capsys.readouterr().err

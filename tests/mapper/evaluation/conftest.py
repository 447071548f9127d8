"""A scene known exactly and runs over it, for tests of all protocols; `worlds` holds the functions behind them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))  # tests import `worlds` from their own folder

from worlds import make_perfect_run, make_truth, perfect_detections, with_things

from thingmap.datasets.ground_truth import GroundTruth
from thingmap.detectors.detections import Detections
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.inputs.case import Case, MappedRun


@pytest.fixture
def scene_truth() -> GroundTruth:
    """Eight objects of four classes on a table, seen from 40 poses; see `worlds`."""
    return make_truth()


@pytest.fixture(scope="session")
def perfect_run() -> Callable[..., MappedRun]:
    """`perfect_run(truth, labelled=False)`: a run whose map is the truth, in the first camera's axes."""
    return make_perfect_run


@pytest.fixture(scope="session")
def change_things() -> Callable[..., MappedRun]:
    """`change_things(run, things)`: the run with other things in its map and all its snapshots."""
    return with_things


@pytest.fixture(scope="session")
def find_everything() -> Callable[..., Callable[[int], Detections]]:
    """`find_everything(truth, score=1.0)`: detections of every visible box."""
    return perfect_detections


@pytest.fixture(scope="session")
def make_case() -> Callable[..., Case]:
    """`make_case(run, truth, detections=None, config=EvaluationConfig())`."""

    def make(
        run: MappedRun,
        truth: GroundTruth,
        detections: Callable[[int], Detections] | None = None,
        config: EvaluationConfig = EvaluationConfig(),  # noqa: B008
    ) -> Case:
        from thingmap.mapper.evaluation.inputs.build_case import build_case

        return build_case(run, truth, config, detections)

    return make

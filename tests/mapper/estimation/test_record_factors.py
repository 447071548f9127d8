"""Which factors a record of the ledger becomes."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, S, X

from thingmap.datasets.frame import Intrinsics
from thingmap.detectors.parts import part_box
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import SmootherConfig
from thingmap.mapper.estimation.record_factors import UP, FactorContext, record_factors, site_factor
from thingmap.mapper.estimation.records import (
    Box,
    DepthCentre,
    DropLoop,
    Gauge,
    Look,
    Loop,
    Merge,
    Motion,
    NewLandmark,
    Retire,
    Scores,
    Site,
    Up,
    UpPrior,
    Visual,
)
from thingmap.mapper.estimation.size_site import SizeSite

KINECT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
R_LEANING = gtsam.Rot3.Rx(0.3).matrix()
PLACE, LOG_SIZE = np.array([0.1, -0.05, 2.0]), np.log([0.1, 0.15, 0.2])


def context(owner=lambda j: j, R: np.ndarray | None = None, **config) -> FactorContext:
    return FactorContext(SmootherConfig(**config), KINECT, np.eye(3) if R is None else R, owner)


def values(place: np.ndarray = PLACE) -> gtsam.Values:
    result = gtsam.Values()
    for t in range(2):
        result.insert(X(t), gtsam.Pose3())
    result.insert(UP, gtsam.Unit3(np.array([0.0, -1.0, 0.0])))
    for j in (1, 2):
        result.insertPoint3(L(j), place)
        result.insert(S(j), LOG_SIZE)
    return result


@pytest.mark.parametrize(
    ("record", "keys"),
    [
        (Gauge(np.eye(4), np.full(6, 0.01)), [[X(0)]]),
        (Motion(0, 1, np.eye(4), np.eye(6)), [[X(0), X(1)]]),
        (Visual(0, 1, np.eye(4), np.eye(6)), [[X(0), X(1)]]),
        (Loop(0, 1, np.eye(4), np.eye(6)), [[X(0), X(1)]]),
        (DropLoop(4), []),
        (UpPrior(np.array([0.0, -1.0, 0.0]), 0.5), [[UP]]),
        (Up(1, np.array([0.0, -1.0, 0.0]), 0.1), [[X(1), UP]]),
        (NewLandmark(1, PLACE, LOG_SIZE), [[L(1)], [S(1)]]),
        (DepthCentre(1, 2, PLACE, 0.02, 0.05, 1.0), [[X(1), L(2)]]),
        (Box(1, 2, np.array([300.0, 200.0, 340.0, 260.0]), np.ones(4, bool), 2.0), [[X(1), L(2), S(2)]]),
        (Look(0, 1, 1.0, 0.0, 0.0), []),
        (Scores(0, 1, np.zeros(3), 0.0, 1.0), []),
        (Site(1, LOG_SIZE, np.eye(3)), []),
        (Merge(1, 2), []),
        (Retire(1), []),
    ],
    ids=lambda value: type(value).__name__ if not isinstance(value, list) else "",
)
def test_records_and_the_variables_they_tie(record, keys):
    assert [list(factor.keys()) for factor in record_factors(record, context())] == keys


def test_a_measurement_ties_the_landmark_that_its_own_was_merged_into():
    into_one = context(owner=lambda j: 1)
    (centre,) = record_factors(DepthCentre(0, 2, PLACE, 0.02, 0.05, 1.0), into_one)
    box_record = Box(0, 2, np.array([300.0, 200.0, 340.0, 260.0]), np.ones(4, bool), 2.0)
    (box,) = record_factors(box_record, into_one)
    assert list(centre.keys()) == [X(0), L(1)] and list(box.keys()) == [X(0), L(1), S(1)]


def test_exact_measurements_cost_nothing():
    box = project_solids(np.eye(4), R_LEANING, PLACE[None], LOG_SIZE[None], KINECT)[0][0]
    for record in (
        Gauge(np.eye(4), np.full(6, 0.01)),
        Motion(0, 1, np.eye(4), np.eye(6)),
        Up(1, np.array([0.0, -1.0, 0.0]), 0.1),
        NewLandmark(1, PLACE, LOG_SIZE),
        DepthCentre(0, 1, PLACE, 0.02, 0.05, 0.5),
        Box(0, 1, box, np.ones(4, bool), 2.0),
    ):
        for factor in record_factors(record, context(R=R_LEANING)):
            assert factor.error(values()) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("part", range(1, 5))
def test_the_box_of_a_half_is_compared_with_that_half(part):
    whole = project_solids(np.eye(4), R_LEANING, PLACE[None], LOG_SIZE[None], KINECT)[0][0]
    half = part_box(whole, part)
    for named in range(5):
        (factor,) = record_factors(Box(0, 1, half, np.ones(4, bool), 2.0, named), context(R=R_LEANING))
        assert (factor.error(values()) < 1e-12) == (named == part)


def test_boxes_are_read_in_the_upright_frame():
    box = project_solids(np.eye(4), R_LEANING, PLACE[None], LOG_SIZE[None], KINECT)[0][0]
    (straight,) = record_factors(Box(0, 1, box, np.ones(4, bool), 2.0), context())
    assert straight.error(values()) > 0.3


def test_visual_motions_and_loops_are_robust_and_odometry_is_not_unless_told_so():
    far = np.eye(4)
    far[0, 3] = 10.0
    plain, robust = Motion(0, 1, far, np.eye(6)), (Visual(0, 1, far, np.eye(6)), Loop(0, 1, far, np.eye(6)))
    assert record_factors(plain, context())[0].error(values()) == pytest.approx(50.0)
    huber = 1.345 * 10.0 - 0.5 * 1.345**2
    for record in robust:
        assert record_factors(record, context())[0].error(values()) == pytest.approx(huber)
    assert record_factors(plain, context(robust_odometry=True))[0].error(values()) == pytest.approx(huber)


def test_guards_take_their_widths_from_the_configuration():
    record = NewLandmark(1, PLACE - [2.0, 0.0, 0.0], LOG_SIZE - [1.0, 0.0, 0.0])
    position, size = record_factors(record, context(guard_position=4.0, guard_size=0.5))
    assert position.error(values()) == pytest.approx(0.5 * (2.0 / 4.0) ** 2)
    assert size.error(values()) == pytest.approx(0.5 * (1.0 / 0.5) ** 2)


def test_a_site_is_a_gaussian_on_the_size():
    information = np.diag([1.0, 4.0, 9.0])
    factor = site_factor(1, SizeSite(LOG_SIZE - [0.1, 0.2, 0.3], information))
    assert list(factor.keys()) == [S(1)]
    assert factor.error(values()) == pytest.approx(0.5 * (0.1**2 + 4 * 0.2**2 + 9 * 0.3**2))

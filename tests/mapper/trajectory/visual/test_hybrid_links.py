"""Degenerate keyframes measured by whole images: which, when it enters the graph, and where it cannot be done."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import LoopConfig, MapperConfig, SmootherConfig
from thingmap.mapper.estimation.records import Motion, Visual
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.trajectory.twist import exp, log
from thingmap.mapper.trajectory.visual.hybrid_links import HybridLinks

from .painted_wall import CAMERA, wall_view

try:
    import open3d
except (ImportError, OSError) as error:
    open3d, WHY_NOT = None, f"open3d cannot be loaded: {error}"
else:
    WHY_NOT = "open3d is older than 0.20"
needs_open3d = pytest.mark.skipif(open3d is None or not hasattr(open3d.utility, "set_max_threads"), reason=WHY_NOT)

LAG = 2
STEP = exp(np.array([[0.0, 0.0, 0.01, 0.03, 0.01, 0.0]]))[0]
OPEN = np.diag(np.square([0.002, 0.002, 0.1, 0.1, 0.1, 0.002]))  # of an odometry step along a bare wall


class Walk:
    """Keyframes along a wall, whose odometry says nothing about the way along it: it takes the camera to stand."""

    def __init__(self, process: bool = False) -> None:
        config = replace(MapperConfig(), loops=LoopConfig(process=process, lag=LAG))
        self.smoother = Smoother(SmootherConfig(), CAMERA)
        self.links = HybridLinks(config, self.smoother)
        self.truth = [np.eye(4)]
        self.smoother.add_first(np.eye(4), np.repeat([1e-3, 1e-3], 3), np.array([0.0, -1.0, 0.0]), 0.6)
        self.links.add_keyframe(0, self._frame(True), None, True)
        self.smoother.update()

    def step(self, degenerate: bool = True, painted: bool = True) -> None:
        self.truth.append(self.truth[-1] @ STEP)
        self.links.collect(self.smoother.keyframes)
        number = self.smoother.add_keyframe(np.eye(4), OPEN)
        self.links.add_keyframe(number, self._frame(painted), np.eye(4), degenerate)
        self.smoother.update()

    def measured(self) -> list[Visual]:
        return [record for record in self.smoother.ledger if isinstance(record, Visual)]

    def _frame(self, painted: bool) -> Frame:
        view, index = wall_view(self.truth[-1], painted), len(self.truth) - 1
        return Frame(index, f"frame-{index:06d}", index / 30.0, view.color, view.depth, CAMERA)


@needs_open3d
def test_degenerate_keyframes_are_measured_and_others_are_not():
    walk, degenerate = Walk(), [True, False, True, True, False, False]
    for each in degenerate:
        walk.step(each)
    walk.links.finish()
    walk.smoother.update()
    assert [(v.a, v.b) for v in walk.measured()] == [(0, 1), (2, 3), (3, 4)]
    assert walk.links.outcomes == {"whole image": 3} and walk.links.unavailable == ""
    for visual in walk.measured():
        gap = log((np.linalg.inv(visual.T_a_b) @ STEP)[None])[0]
        assert np.linalg.norm(gap[:3]) < 0.004 and np.linalg.norm(gap[3:]) < 0.004
        step = np.linalg.inv(walk.smoother.pose(visual.a)) @ walk.smoother.pose(visual.b)
        assert np.linalg.norm(step[:3, 3] - STEP[:3, 3]) < 0.006  # the graph believes it: odometry said it stands


@needs_open3d
def test_results_enter_so_many_keyframes_later_with_and_without_another_process():
    ledgers = []
    for process in (False, True):
        walk = Walk(process)
        for _ in range(5):
            walk.step()
        keyframes, entered = 1, {}
        for record in walk.smoother.ledger:
            keyframes += isinstance(record, Motion)
            if isinstance(record, Visual):
                entered[record.b] = keyframes
        assert entered == {b: b + LAG for b in (1, 2, 3)}
        ledgers.append(walk.measured())
    for one, other in zip(*ledgers, strict=True):
        np.testing.assert_array_equal(one.T_a_b, other.T_a_b)
        np.testing.assert_array_equal(one.covariance, other.covariance)


@needs_open3d
def test_finishing_twice_changes_nothing():
    walk = Walk()
    walk.step()
    assert not walk.measured()
    for _ in range(2):
        walk.links.finish()
        assert [(v.a, v.b) for v in walk.measured()] == [(0, 1)] and walk.links.outcomes.total() == 1


@needs_open3d
def test_images_that_do_not_fit_are_counted():
    walk = Walk()
    walk.step(painted=False)  # painted before, bare now
    walk.links.finish()
    assert not walk.measured() and walk.links.outcomes == {"whole image, none": 1}


def test_where_open3d_is_not_there_it_is_tried_once_and_said(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    walk = Walk()
    for _ in range(LAG + 4):
        walk.step()
    walk.links.finish()
    assert not walk.measured()
    assert "Open3D cannot be loaded" in walk.links.unavailable
    # what was submitted before the first answer; nothing after it
    assert walk.links.outcomes == {"whole image, unavailable": LAG}

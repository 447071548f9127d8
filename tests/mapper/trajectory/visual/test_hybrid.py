"""Motion from brightness and depth together: a painted wall, a rendered table-top, and what it must refuse."""

from __future__ import annotations

import pickle
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import HybridConfig
from thingmap.mapper.trajectory.twist import exp, inverses, log
from thingmap.mapper.trajectory.visual.feature_motion import RelativePose
from thingmap.mapper.trajectory.visual.hybrid import HybridUnavailable, RgbdView, hybrid_motion

from .painted_wall import wall_view

try:
    import open3d
except (ImportError, OSError) as error:
    open3d, WHY_NOT = None, f"open3d cannot be loaded: {error}"
else:
    WHY_NOT = "open3d is older than 0.20"
needs_open3d = pytest.mark.skipif(open3d is None or not hasattr(open3d.utility, "set_max_threads"), reason=WHY_NOT)

TWISTS = [
    np.array([0.0, 0.0, 0.0, 0.05, 0.0, 0.0]),
    np.array([0.01, -0.02, 0.05, 0.01, -0.04, 0.02]),
    np.array([0.03, 0.03, -0.02, -0.03, 0.02, -0.03]),
]


def motion(twist: np.ndarray) -> np.ndarray:
    return exp(twist[None])[0]


def error(found: RelativePose, truth: np.ndarray) -> np.ndarray:
    """(6,) right tangent [rad, m] from the estimate to the truth."""
    return log((np.linalg.inv(found.T_a_b) @ truth)[None])[0]


def found_motion(a: RgbdView, b: RgbdView, T_guess: np.ndarray) -> RelativePose:
    result = hybrid_motion(a, b, T_guess)
    assert result is not None
    return result


@needs_open3d
@pytest.mark.parametrize("twist", TWISTS)
def test_a_painted_wall_holds_all_directions(twist: np.ndarray):
    T_a_b = motion(twist)
    a, b = wall_view(np.eye(4)), wall_view(T_a_b)
    there, back = found_motion(a, b, np.eye(4)), found_motion(b, a, np.eye(4))
    for found, truth in ((there, T_a_b), (back, inverses(T_a_b[None])[0])):
        e = error(found, truth)
        assert np.linalg.norm(e[:3]) < 0.004 and np.linalg.norm(e[3:]) < 0.004
        assert np.linalg.norm(e[3:]) < 0.1 * np.linalg.norm(twist[3:])
        assert e @ np.linalg.solve(found.covariance, e) < 22.5  # chi-square, 6 degrees of freedom, 99.9 %
        assert np.sqrt(np.diag(found.covariance)[3:]).max() < 0.02
        assert found.inliers > 0.5 * a.depth.size


@needs_open3d
def test_a_bare_wall_leaves_directions_open_and_says_so():
    T_a_b = motion(TWISTS[1])
    found = hybrid_motion(wall_view(np.eye(4), painted=False), wall_view(T_a_b, painted=False), T_a_b)
    if found is not None:  # a singular system is an answer too
        sigma = np.sqrt(np.diag(found.covariance))
        assert sigma[2] > 0.05 and sigma[3:5].min() > 0.1 and sigma[5] < 0.02


@needs_open3d
@pytest.mark.parametrize("later", [3, 6])
def test_keyframes_of_a_table_top(tabletop: tuple[Frame, ...], later: int):
    frames = tabletop[0], tabletop[later]
    T_a, T_b = (f.T_world_camera for f in frames)
    assert T_a is not None and T_b is not None
    a, b = (RgbdView.of(f) for f in frames)
    found = found_motion(a, b, np.eye(4))
    e = error(found, np.linalg.inv(T_a) @ T_b)
    assert np.linalg.norm(e[3:]) < 0.003 and np.linalg.norm(e[:3]) < 0.003
    assert e @ np.linalg.solve(found.covariance, e) < 22.5


@needs_open3d
def test_two_runs_agree_exactly_and_leave_threads_as_they_were():
    a, b = wall_view(np.eye(4)), wall_view(motion(TWISTS[1]))
    threads = open3d.utility.get_max_threads()
    first = found_motion(a, b, np.eye(4))
    assert open3d.utility.get_max_threads() == threads
    for _ in range(3):
        a, b = pickle.loads(pickle.dumps((a, b)))
        again = found_motion(a, b, np.eye(4))
        assert np.array_equal(again.T_a_b, first.T_a_b) and np.array_equal(again.covariance, first.covariance)
        assert again.inliers == first.inliers


@needs_open3d
def test_what_does_not_fit_is_refused():
    a, b = wall_view(np.eye(4)), wall_view(motion(TWISTS[0]))
    nothing = RgbdView(b.color, np.zeros_like(b.depth), b.intrinsics)
    assert hybrid_motion(a, nothing, np.eye(4)) is None
    assert hybrid_motion(nothing, b, np.eye(4)) is None
    assert hybrid_motion(a, b, motion(np.array([0.0, 0.0, 0.0, 5.0, 0.0, 0.0]))) is None  # nothing overlaps
    other = wall_view(np.eye(4), seed=1)  # as flat, but another painting
    assert hybrid_motion(a, other, np.eye(4)) is None
    assert hybrid_motion(a, b, np.eye(4), replace(HybridConfig(), max_correction=(0.3, 0.02))) is None
    assert hybrid_motion(a, b, np.eye(4), replace(HybridConfig(), min_share=0.999)) is None


def test_without_open3d_it_says_so(monkeypatch: pytest.MonkeyPatch):
    view = wall_view(np.eye(4))
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(HybridUnavailable, match=r"Open3D cannot be loaded.*apt install libusb"):
        hybrid_motion(view, view, np.eye(4))
    monkeypatch.setitem(sys.modules, "open3d", SimpleNamespace(__version__="0.19.0", utility=SimpleNamespace()))
    with pytest.raises(HybridUnavailable, match=r"0\.19\.0 .* install 0\.20"):
        hybrid_motion(view, view, np.eye(4))

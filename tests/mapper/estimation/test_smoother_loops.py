"""Loop closures in the joint graph: they enter, bend it to the batch optimum, and leave when found wrong."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, S, X

from thingmap.mapper.config import SmootherConfig
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.records import DropLoop, Loop, Motion, Visual
from thingmap.mapper.estimation.size_site import SizeSite
from thingmap.mapper.estimation.smoother import Smoother

HALF_AXES = (0.12, 0.12, 0.2)  # round: upright volumes with corners would tell the heading, and there were no drift
TIGHT = np.diag(np.repeat([0.002**2, 0.005**2], 3))
LOOSE = np.diag(np.repeat([0.02**2, 0.03**2], 3))
DRIFT = np.array([0.0, np.radians(10.3), 0.0, -0.93, 0.0, 0.0])  # rad, m; leaves the last pose off by 10 deg, 30 cm


class Lap:
    """A camera goes around things. Odometry drifts where there are none: what it sees again it takes for new."""

    def __init__(self, tools, keyframes: int = 40, config: SmootherConfig | None = None) -> None:
        self.tools, self.room, rng = tools, tools.Room(config or SmootherConfig()), np.random.default_rng(3)
        self.smoother: Smoother = self.room.smoother
        bearings = np.radians([-60.0, -35.0, 0.0, 20.0, 50.0, 90.0])
        for t, angle in enumerate(np.linspace(0.0, 2.0 * np.pi, keyframes)):
            T = tools.look_at((3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.3))
            drifts = 0.4 * np.pi < angle < 1.6 * np.pi
            error = drifts * DRIFT / (0.6 * keyframes) + rng.normal(0.0, np.repeat([5e-4, 1e-3], 3))
            self.room.add_camera(T, error, LOOSE if drifts else TIGHT)
            for j, bearing in enumerate(bearings, 1):
                if np.cos(bearing - angle) > np.cos(0.6) and not drifts:
                    place = np.array([np.cos(bearing), np.sin(bearing), 0.1 * np.sin(3.0 * bearing)])
                    self._see(t, j if angle < np.pi else j + 10, place, rng.normal(0.0, 1.0, 4))
        self.smoother.update()

    def _see(self, t: int, number: int, place: np.ndarray, error: np.ndarray) -> None:
        if number not in self.smoother.sites:
            self.smoother.update()
            in_camera = np.linalg.inv(self.room.cameras[t]) @ [*place, 1.0]
            start, log_size = (self.smoother.pose(t) @ in_camera)[:3], np.log(HALF_AXES)
            self.room.objects[number] = place, log_size
            self.smoother.add_landmark(number, start, log_size + 0.1, SizeSite(log_size, 4.0 * np.eye(3)))
        self.room.see(t, number, sides=error)

    @property
    def last(self) -> int:
        return len(self.room.cameras) - 1

    def close(self, error: np.ndarray | None = None, covariance: np.ndarray = TIGHT) -> int:
        """Adds the loop from the last keyframe to the first, off by the (6,) tangent `error`; returns its number."""
        T = gtsam.Pose3(np.linalg.inv(self.room.cameras[0]) @ self.room.cameras[-1])
        T_a_b = T if error is None else T.retract(error)
        return self.smoother.add(Loop(0, self.last, T_a_b.matrix(), covariance))

    def end_error(self) -> tuple[float, float]:
        """Rotation (degrees) and translation (m) of the last pose from the truth."""
        gap = np.linalg.inv(self.room.cameras[-1]) @ self.smoother.pose(self.last)
        return np.degrees(np.arccos((np.trace(gap[:3, :3]) - 1.0) / 2.0)), float(np.linalg.norm(gap[:3, 3]))

    def worst_place(self) -> float:
        """Metres of the landmark that is furthest off."""
        return max(float(np.linalg.norm(self.smoother.position(j) - p)) for j, (p, _) in self.room.objects.items())


def assert_at_batch_optimum(smoother: Smoother, tools, metres: float = 1e-3) -> None:
    """Against Levenberg-Marquardt to the last digit on the same graph (the ledger's, nothing of it dropped)."""
    _, best = tools.solve_batch(smoother)
    for t, T in enumerate(smoother.poses()):
        assert np.linalg.norm(T[:3, 3] - best.atPose3(X(t)).translation()) < metres
        assert np.linalg.norm(gtsam.Rot3.Logmap(best.atPose3(X(t)).rotation().between(gtsam.Rot3(T[:3, :3])))) < metres
    for j in smoother.sites:
        assert np.linalg.norm(smoother.position(j) - best.atPoint3(L(j))) < metres
        np.testing.assert_allclose(smoother.log_size(j), best.atVector(S(j)), atol=5.0 * metres)


def assert_alike(a: Smoother, b: Smoother, atol: float) -> None:
    np.testing.assert_allclose(a.poses(), b.poses(), atol=atol)
    assert a.sites.keys() == b.sites.keys()
    for j in a.sites:
        np.testing.assert_allclose(a.position(j), b.position(j), atol=atol)


def converged_cost(smoother: Smoother) -> float:
    """Of the whole graph, solved beyond the thresholds, as a closed loop is."""
    smoother._graph.converge(30, 1e-4)
    smoother._forget()
    return smoother._graph.isam.getFactorsUnsafe().error(smoother._graph.isam.calculateEstimate())


def assert_as_without_loops(lap: Lap, twin: Lap) -> None:
    """Without its loop the lap's end is known so badly that Gauss-Newton walks up and down there long before the
    optimum: what the walk costs is the same, and it stays within the uncertainty."""
    sigma = np.sqrt(np.trace(twin.smoother.pose_covariance(twin.last)[3:, 3:]))
    assert sigma > 0.1
    assert converged_cost(lap.smoother) == pytest.approx(converged_cost(twin.smoother), abs=0.05)
    assert_alike(lap.smoother, twin.smoother, sigma)


@pytest.fixture
def lap(tools) -> Lap:
    return Lap(tools)


def test_a_correction_of_30_cm_and_10_degrees_ends_at_the_batch_optimum(lap, tools):
    degrees, metres = lap.end_error()
    assert degrees > 9.0 and metres > 0.28
    lap.close()
    lap.smoother.update()  # once
    degrees, metres = lap.end_error()
    assert degrees < 0.5 and metres < 0.03
    assert_at_batch_optimum(lap.smoother, tools)
    assert lap.smoother.rebuilds == 0


def test_landmarks_follow_the_poses_they_were_seen_from(lap):
    """At the end of the lap things were taken for new ones, or are new, where odometry had drifted."""
    assert lap.worst_place() > 0.15
    lap.close()
    lap.smoother.update()
    assert lap.worst_place() < 0.03
    assert np.linalg.norm(lap.smoother.position(3) - lap.smoother.position(13)) < 0.03  # the same thing


def test_what_comes_after_a_closed_loop_is_cheap_again(lap):
    """Thresholds are the configured ones again: a step that changes nothing relinearises nothing."""
    lap.close()
    lap.smoother.update()
    thresholds = lap.smoother._graph.isam.update(force_relinearize=True)
    assert thresholds.getVariablesRelinearized() == 0
    assert not lap.smoother._loops_changed


def test_loops_are_known_by_the_number_that_add_returned(lap):
    number = lap.close()
    assert isinstance(lap.smoother.ledger[number], Loop)
    assert list(lap.smoother.loops()) == [number] and lap.smoother.loops()[number] is lap.smoother.ledger[number]
    lap.smoother.drop_loops([number])
    assert lap.smoother.loops() == {}
    lap.smoother.drop_loops([number])  # as a check that ran meanwhile may ask for
    dropped = [r.record for r in lap.smoother.ledger if isinstance(r, DropLoop)]
    assert dropped == [number]


def test_a_dropped_loop_leaves_no_trace(lap, tools):
    twin = Lap(tools)
    number = lap.close(np.array([0.5, -1.0, 0.3, 2.0, 1.0, -1.0]))  # as wrong as can be
    lap.smoother.update()
    assert np.linalg.norm(lap.smoother.poses()[:, :3, 3] - twin.smoother.poses()[:, :3, 3], axis=1).max() > 0.3
    lap.smoother.drop_loops([number])
    lap.smoother.update()
    assert_as_without_loops(lap, twin)


def test_a_loop_dropped_before_it_was_solved_does_no_harm(lap, tools):
    lap.smoother.drop_loops([lap.close(np.full(6, 0.5))])
    lap.smoother.update()
    assert_as_without_loops(lap, Lap(tools))


def test_visual_motions_can_be_dropped_and_odometry_cannot(tools):
    smoother = Smoother(tools.exact, tools.kinect)
    smoother.add_first(np.eye(4), np.full(6, 1e-6), np.array([0.0, -1.0, 0.0]), 0.01)
    smoother.update()
    motion, wrong = np.eye(4), np.eye(4)
    motion[0, 3], wrong[0, 3] = 0.5, 0.4
    smoother.add_keyframe(motion, TIGHT)
    visual = smoother.add(Visual(0, 1, wrong, TIGHT))
    smoother.update()
    assert smoother.pose(1)[0, 3] < 0.495
    odometry = next(i for i, record in enumerate(smoother.ledger) if isinstance(record, Motion))
    with pytest.raises(ValueError, match="is a Motion, which cannot be dropped"):
        smoother.drop_loops([visual, odometry])
    smoother.drop_loops([visual])
    smoother.update()
    assert smoother.pose(1)[0, 3] == pytest.approx(0.5, abs=1e-9)


def test_loops_and_drops_survive_a_rebuild_and_a_saved_ledger(lap, tools, tmp_path):
    smoother = lap.smoother
    right = lap.close()
    wrong = smoother.add(Loop(3, lap.last - 2, np.eye(4), TIGHT))
    smoother.update()
    smoother.drop_loops([wrong])
    smoother.update()
    before = smoother.poses()
    smoother._rebuild()
    np.testing.assert_allclose(smoother.poses(), before, atol=2e-3)
    smoother.ledger.save(tmp_path / "ledger.npz")
    loaded = Smoother.from_ledger(Ledger.load(tmp_path / "ledger.npz")[0], SmootherConfig(), tools.kinect)
    assert list(loaded.loops()) == [right]
    assert len(loaded.ledger) == len(smoother.ledger)
    assert_alike(loaded, smoother, 5e-3)
    loaded.update()
    assert_alike(loaded, smoother, 5e-3)


def test_where_objects_do_not_move_cameras_they_follow_them_all_the_same(tools):
    lap = Lap(tools, config=replace(SmootherConfig(), joint=False))
    assert lap.worst_place() > 0.15
    lap.close()
    lap.smoother.update()
    assert lap.end_error()[1] < 0.03 and lap.worst_place() < 0.05
    loaded = Smoother.from_ledger(lap.smoother.ledger, replace(SmootherConfig(), joint=False), tools.kinect)
    assert_alike(loaded, lap.smoother, 0.02)

"""Links across an unmeasured stretch wait for a second one that asks for the same correction."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest

from thingmap.mapper.trajectory.loops.link_jobs import LinkFound, LinkKind
from thingmap.mapper.trajectory.loops.unconfirmed import KEPT, Unconfirmed
from thingmap.mapper.trajectory.rigid import inverse
from thingmap.mapper.trajectory.visual.feature_motion import RelativePose

DRIFT = gtsam.Pose3.Expmap(np.array([0.02, 0.5, -0.03, 2.0, -0.4, 1.0])).matrix()  # of the part after the gap


def way(count: int = 60) -> np.ndarray:
    """(M, 4, 4) poses of a walk in a curve."""
    return np.array(
        [gtsam.Pose3.Expmap(np.array([0.0, 0.03 * t, 0.0, 0.06 * t, 0.0, 0.02 * t])).matrix() for t in range(count)]
    )


TRUE = way()
ESTIMATED = np.concatenate([TRUE[:30], DRIFT @ TRUE[30:]])


def link(a: int, b: int, off: np.ndarray | None = None, kind: LinkKind = LinkKind.ALIKE) -> LinkFound:
    """What is measured between keyframes, from the true way, `off` (6,) beside it."""
    T = inverse(TRUE[a]) @ TRUE[b] @ gtsam.Pose3.Expmap(np.zeros(6) if off is None else off).matrix()
    return LinkFound(a, b, kind, RelativePose(T, 1e-4 * np.eye(6), 100))


def test_a_link_alone_waits_and_a_second_one_confirms_both():
    waiting = Unconfirmed()
    first, second = link(3, 40), link(8, 44, 0.02 * np.ones(6))
    assert waiting.confirmed(first, ESTIMATED) == []
    assert waiting.confirmed(second, ESTIMATED) == [first, second]
    assert waiting.confirmed(link(9, 45), ESTIMATED) == []  # what was confirmed no longer waits


def test_two_links_of_one_keyframe_do_not_confirm_each_other():
    """They come from one image: what misled one misled the other."""
    waiting = Unconfirmed()
    assert waiting.confirmed(link(3, 40), ESTIMATED) == []
    assert waiting.confirmed(link(5, 40), ESTIMATED) == []


@pytest.mark.parametrize("off", [[0.0, 0.3, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5, 0.0, 0.0]])
def test_links_that_ask_for_different_corrections_all_wait(off):
    waiting = Unconfirmed()
    assert waiting.confirmed(link(3, 40, np.array(off)), ESTIMATED) == []
    right = link(8, 44)
    assert waiting.confirmed(right, ESTIMATED) == []
    assert waiting.confirmed(link(9, 46), ESTIMATED)[0] is right


def test_neighbours_by_depth_need_no_second():
    near = link(50, 55, kind=LinkKind.NEAR)
    assert Unconfirmed().confirmed(near, ESTIMATED) == [near]


def test_only_the_latest_are_kept():
    waiting = Unconfirmed()
    waiting.confirmed(link(3, 40), ESTIMATED)
    for n in range(KEPT):
        assert waiting.confirmed(link(4, 41, np.array([0.0, 0.0, 0.0, 1.0 + n, 0.0, 0.0])), ESTIMATED) == []
    assert waiting.confirmed(link(8, 44), ESTIMATED) == []

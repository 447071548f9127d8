"""Things that a jump of the camera lands on the places of others: they are told apart when a loop is closed."""

from __future__ import annotations

import numpy as np
import pytest
from jumping_camera import FIRST, JUMPS, SECOND, TABLE, TIGHT, Drive, at, drive_across, worst_pose
from lasting_world import CLASSES

from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.records import DropMeasurement, Loop, Merge, Revive
from thingmap.mapper.estimation.smoother import Smoother

COLLISIONS = [(1.0, 45.0), (1.0, 315.0), (-1.0, 225.0), (1.0, 270.0)]  # a thing counts for another
ACROSS = [(yaw, bearing) for yaw in (1.0, -1.0) for bearing in np.arange(0.0, 360.0, 45.0)]


@pytest.mark.parametrize(("yaw", "bearing"), ACROSS)
def test_every_jump_across_the_table_ends_with_every_thing_once(yaw, bearing):
    drive = drive_across(yaw, bearing)
    drive.close_loop(0, len(drive.truth) - 1)
    assert worst_pose(drive) < 0.03
    assert not drive.scene.retired and not drive.scene.tracks and len(drive.landmarks) == len(TABLE)
    off = [np.linalg.norm([x.position - block.centre for x in drive.landmarks], axis=1) for block in TABLE]
    assert all(np.sort(distances)[0] < 0.06 < np.sort(distances)[1] for distances in off)
    # the older are kept: the four of the first half
    assert {x.number for x in drive.landmarks} == {1, 2, 3, 4}
    for x, block in ((drive.landmarks[int(np.argmin(d))], block) for d, block in zip(off, TABLE, strict=True)):
        assert x.belief.existence > 0.95 and min(x.supporting) < len(FIRST) < max(x.supporting)
        assert CLASSES[int(np.argmax(x.belief.class_posterior()))] == block.label


@pytest.mark.parametrize(("yaw", "bearing"), COLLISIONS)
def test_without_separation_a_thing_on_another_s_place_holds_the_poses(yaw, bearing, monkeypatch):
    drive = drive_across(yaw, bearing)
    monkeypatch.setattr(drive.mapper._lifecycle, "separate", lambda: False)
    drive.smoother.add(Loop(0, 20, np.linalg.inv(drive.truth[0]) @ drive.truth[20], TIGHT))
    drive.smoother.update()
    drive.follow()
    assert worst_pose(drive) > 0.15


def test_the_saved_ledger_knows_what_was_separated_and_revived(tmp_path):
    drive = drive_across(*COLLISIONS[-1])
    drive.close_loop(0, len(drive.truth) - 1)
    kinds = {type(record) for record in drive.smoother.ledger}
    assert {DropMeasurement, Revive, Merge} <= kinds
    drive.smoother.ledger.save(tmp_path / "ledger.npz")
    config = drive.mapper.config.smoother
    again = Smoother.from_ledger(Ledger.load(tmp_path / "ledger.npz")[0], config, drive.smoother.intrinsics)
    np.testing.assert_allclose(again.poses(), drive.smoother.poses(), atol=5e-3)
    assert again.sites.keys() == drive.smoother.sites.keys()
    for x in drive.landmarks:
        np.testing.assert_allclose(again.position(x.number), drive.smoother.position(x.number), atol=5e-3)


def test_a_wrong_loop_that_separated_things_is_undone_with_it():
    drive = Drive(*JUMPS["up"])
    drive.go([*FIRST, *SECOND])
    assert len(drive.landmarks) == len(TABLE) and not drive.mapper._outcomes[Outcome.SEPARATED]
    T_wrong = np.linalg.inv(drive.truth[0]) @ drive.truth[19]
    T_wrong[:3, 3] += [0.4, 0.0, 0.0]
    number = drive.smoother.add(Loop(0, 19, T_wrong, 1e-3 * TIGHT))
    drive.smoother.update()
    drive.follow()
    drive.smoother.drop_loops([number])
    drive.smoother.update()
    drive.follow()
    assert worst_pose(drive) < 0.01
    assert {x.number for x in drive.landmarks} == {1, 2, 3, 4}
    assert all(len(at(drive.landmarks, block)) == 1 for block in TABLE)

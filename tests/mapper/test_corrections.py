"""A camera whose pose jumps by 30 cm and 10 degrees maps a table twice; a loop closure makes it one table again.

Through `SemanticMapper` itself with given poses, on boxes on a table (`lasting_world`): the poses of the second half
are off by a jump, of which the odometry's covariance tells.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parent))  # `lasting_world` is beside this file

from lasting_world import CLASSES, WALL, Block, Film, around

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import (
    CloudConfig,
    KeyframeConfig,
    LoopConfig,
    MapperConfig,
    OdometryConfig,
    OdometrySource,
    TrackConfig,
)
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.records import DropMeasurement, Loop, Merge, Revive
from thingmap.mapper.estimation.scene import Scene
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.estimation.tracks import Track
from thingmap.mapper.mapper import SemanticMapper

CONFIG = MapperConfig(
    odometry=OdometryConfig(source=OdometrySource.POSES),
    keyframes=KeyframeConfig(max_gap=1),
    loops=LoopConfig(enabled=False),  # the tests close them
    cloud=CloudConfig(pixel_step=1, max_range=1.6),  # where depth is good to 4 mm
)
CUP = Block("cup", (0.3, 0.0), (0.09, 0.09, 0.1))
CEREAL = Block("cereal box", (-0.05, 0.25), (0.2, 0.07, 0.3))
BOOK = Block("book", (-0.35, -0.05), (0.2, 0.15, 0.04))
BOWL = Block("bowl", (0.0, -0.2), (0.15, 0.15, 0.07))
TABLE = (CUP, CEREAL, BOOK, BOWL)
FIRST, SECOND, THIRD = np.arange(-25.0, 25.0, 5.0), np.arange(22.0, -28.0, -5.0), np.arange(-20.0, 30.0, 5.0)
JUMPS = {  # (3,) metres, camera axes; axis of the turn by 10 degrees, camera axes
    "up": ([0.0, -0.3, 0.0], [0.0, -1.0, 0.3]),
    "up and to the left": ([-0.21, -0.21, 0.0], [0.0, -1.0, 0.0]),
    "up and away": ([0.0, -0.25, 0.16], [1.0, 0.0, 0.0]),
    "to the right": ([0.3, 0.0, 0.0], [0.0, 1.0, 0.0]),
}
LOOSE = np.diag(np.repeat([0.2**2, 0.4**2], 3))  # rad, m: what the odometry says of the jump
TIGHT = np.diag(np.repeat([0.002**2, 0.004**2], 3))  # of the loop closure
NEAR = 0.05  # m from the middle of a block to what stands for it
SURFACE = 0.03  # m from the true surface to the cloud


class Drive:
    """A mapper under way; from `jump` on its camera's poses are off by `T_jump` in camera axes."""

    def __init__(self, shift: list[float], axis: list[float], config: MapperConfig = CONFIG) -> None:
        self.film, self.T_jump = Film(), np.eye(4)
        self.T_jump[:3, :3] = Rotation.from_rotvec(np.radians(10.0) * np.array(axis) / np.linalg.norm(axis)).as_matrix()
        self.T_jump[:3, 3] = shift
        self.mapper = SemanticMapper(self.film.detect, config, gravity=np.array([0.0, 0.0, -1.0]))
        self.T_wrong_true = np.eye(4)
        self.truth: list[np.ndarray] = []

    def go(self, angles: Iterable[float], *blocks: Block) -> None:
        for frame in self.film.walk(angles, *(blocks or TABLE)):
            self.feed(frame)

    def feed(self, frame: Frame) -> None:
        assert frame.T_world_camera is not None
        self.truth.append(frame.T_world_camera)
        self.mapper.process_frame(replace(frame, T_world_camera=self.T_wrong_true @ frame.T_world_camera))

    def jump(self, angle: float, *blocks: Block) -> None:
        """The first frame after the jump."""
        T_true, add = around(angle), self.smoother.add_keyframe
        self.T_wrong_true = T_true @ self.T_jump @ np.linalg.inv(T_true)
        self.smoother.add_keyframe = lambda T_a_b, _, T: add(T_a_b, LOOSE, T)  # type: ignore[method-assign]
        self.go([angle], *blocks)
        self.smoother.add_keyframe = add  # type: ignore[method-assign]

    def close_loop(self, a: int, b: int) -> None:
        """Keyframe b is seen to be where it is from keyframe a; everything follows."""
        self.smoother.add(Loop(a, b, np.linalg.inv(self.truth[a]) @ self.truth[b], TIGHT))
        self.smoother.update()
        assert self.follow()

    def follow(self) -> bool:
        assert self.mapper._followers is not None
        if not self.mapper._followers.follow():
            return False
        self.mapper._cloud.rebuild(self.smoother.poses())
        return True

    @property
    def smoother(self) -> Smoother:
        return self.mapper._camera.smoother

    @property
    def scene(self) -> Scene:
        return self.mapper._scene

    @property
    def landmarks(self) -> list[Landmark]:
        return list(self.mapper._scene.landmarks.values())


def surface_distance(points: np.ndarray, blocks: Iterable[Block]) -> np.ndarray:
    """(N,) metres from (N, 3) points to the table, the wall or a block."""
    distance = np.minimum(np.abs(points[:, 2]), np.abs(WALL - points[:, 1]))
    for block in blocks:
        q = np.abs(points - block.centre) - np.array(block.size) / 2.0
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        distance = np.minimum(distance, np.where(outside > 0.0, outside, -q.max(axis=1)))
    return distance


def mapped_twice(name: str, config: MapperConfig = CONFIG, second: Iterable[float] = SECOND) -> Drive:
    """A table, the jump, and the table again; no loop was closed yet."""
    drive = Drive(*JUMPS[name], config)
    drive.go(FIRST)
    drive.jump(24.0)
    drive.go(second)
    return drive


def at(members: Iterable[Landmark | Track], block: Block) -> list[Landmark | Track]:
    """What stands for a block."""
    return [x for x in members if np.linalg.norm(x.position - block.centre) < NEAR]


def displaced(drive: Drive, block: Block) -> list[Landmark]:
    """What looks like a block and was seen since the jump only, more than 15 cm off."""
    label = CLASSES.index(block.label)
    found = [x for x in drive.landmarks if np.argmax(x.belief.class_posterior()) == label]
    found = [x for x in found if min(x.supporting) >= len(FIRST)]
    return [x for x in found if np.linalg.norm(x.position - block.centre) > 0.15]


@dataclass(frozen=True)
class Story:
    """A drive whose loop was closed, and what was known before: numbers, keyframes and the cloud's worst points."""

    drive: Drive
    before: dict[Block, Landmark]
    supporting: dict[Block, set[int]]
    doubled: float


@pytest.fixture(scope="module", params=["up", "up and to the left", "up and away"])
def story(request) -> Story:
    drive = mapped_twice(request.param)
    # everything is there twice, the second time where nothing is
    assert len(drive.landmarks) == 2 * len(TABLE)
    first = {block: at(drive.landmarks, block) for block in TABLE}
    second = {block: displaced(drive, block) for block in TABLE}
    assert all(len(found) == 1 for found in (*first.values(), *second.values()))
    before = {block: first[block][0] for block in TABLE}
    supporting = {block: before[block].supporting | second[block][0].supporting for block in TABLE}
    points, _ = drive.mapper.cloud()
    doubled = float(np.mean(surface_distance(points, TABLE) > SURFACE))
    drive.close_loop(0, len(drive.truth) - 1)
    return Story(drive, before, supporting, doubled)


def test_the_camera_is_where_it_was(story):
    poses = story.drive.smoother.poses()
    assert np.abs(poses[:, :3, 3] - np.array(story.drive.truth)[:, :3, 3]).max() < 0.01


def test_every_thing_is_once_in_the_map_and_nothing_in_empty_space(story):
    found = {block: at(story.drive.landmarks, block) for block in TABLE}
    assert all(len(landmarks) == 1 for landmarks in found.values())
    assert len(story.drive.landmarks) == len(TABLE)
    assert story.drive.scene.tracks == [] and not story.drive.scene.retired


def test_the_older_landmarks_are_kept_with_the_evidence_of_both_halves(story):
    for block, landmark in story.before.items():
        assert at(story.drive.landmarks, block) == [landmark]
        assert landmark.supporting == story.supporting[block]
        assert min(landmark.supporting) < len(FIRST) < max(landmark.supporting)
        assert not landmark.contradicting & landmark.supporting
        assert landmark.belief.existence > 0.95


def test_no_surface_is_there_twice(story):
    points, _ = story.drive.mapper.cloud()
    assert story.doubled > 0.2
    assert surface_distance(points, TABLE).max() < SURFACE


def test_looks_come_from_where_the_camera_was(story):
    """Every direction that a landmark was looked at from is the direction to one of the true cameras."""
    cameras = np.array(story.drive.truth)[:, :3, 3]
    for block, landmark in story.before.items():
        cells = landmark.belief._cells
        known = cells._keyframes >= 0
        assert known.any()
        to_camera = cameras[cells._keyframes[known]] - block.centre
        true = to_camera / np.linalg.norm(to_camera, axis=1)[:, None]
        angles = np.arccos(np.clip((cells._places[known, :3] * true).sum(axis=1), -1.0, 1.0))
        assert np.degrees(angles).max() < 3.0


def test_mapping_goes_on_with_the_landmarks_that_were_kept(story):
    drive = story.drive
    tracks, numbers = drive.scene.next_track, {x.number for x in drive.landmarks}
    last = max(x.last_seen for x in drive.landmarks)
    drive.go(THIRD)
    assert drive.scene.next_track == tracks  # nothing looked new
    assert {x.number for x in drive.landmarks} == numbers
    assert all(x.last_seen > last and x.belief.existence > 0.95 for x in drive.landmarks)
    assert all(len(at(drive.landmarks, block)) == 1 for block in TABLE)
    assert surface_distance(drive.mapper.cloud()[0], TABLE).max() < SURFACE


CANDIDATES = replace(CONFIG, tracks=TrackConfig(min_existence=2.0, min_hits=1000))
SLOW = replace(CONFIG, tracks=TrackConfig(min_existence=2.0, min_hits=4))


@pytest.mark.parametrize("name", ["up", "up and away"])
def test_candidates_that_are_one_thing_become_one(name):
    drive = mapped_twice(name, CANDIDATES)
    assert len(drive.scene.tracks) == 2 * len(TABLE)
    first = {block: at(drive.scene.tracks, block)[0].number for block in TABLE}
    drive.close_loop(0, len(drive.truth) - 1)
    assert len(drive.scene.tracks) == len(TABLE) and not drive.landmarks
    for block in TABLE:
        (track,) = at(drive.scene.tracks, block)
        assert track.number == first[block]
        assert min(track.hits) < len(FIRST) < max(track.hits)


@pytest.mark.parametrize("name", ["up", "up and away"])
def test_a_candidate_of_a_landmark_joins_it(name):
    drive = mapped_twice(name, SLOW, SECOND[:1])
    numbers = {block: at(drive.landmarks, block)[0].number for block in TABLE}
    candidates = len(drive.scene.tracks)
    assert candidates >= 3 and len(drive.landmarks) == len(TABLE)
    measurements = sum(x.measurements for x in drive.landmarks)
    drive.close_loop(0, len(drive.truth) - 1)
    assert drive.scene.tracks == [] and len(drive.landmarks) == len(TABLE)
    for block in TABLE:
        (landmark,) = at(drive.landmarks, block)
        assert landmark.number == numbers[block]
    assert sum(x.measurements for x in drive.landmarks) > measurements
    assert sum(max(x.supporting) >= len(FIRST) for x in drive.landmarks) == candidates


def test_what_wrong_poses_had_retired_counts_again():
    """A camera that looks through the old places and finds the things elsewhere takes them for taken away."""
    drive = mapped_twice("to the right")
    gone = list(drive.scene.retired.values())
    assert len(gone) >= 2 and all(max(x.supporting) < len(FIRST) for x in gone)
    drive.close_loop(0, len(drive.truth) - 1)
    assert not drive.scene.retired and not drive.scene.tracks and len(drive.landmarks) == len(TABLE)
    for block in TABLE:
        (landmark,) = at(drive.landmarks, block)
        assert min(landmark.supporting) < len(FIRST) < max(landmark.supporting)
        assert landmark.belief.existence > 0.95
    numbers = {x.number for x in drive.landmarks}
    drive.go(THIRD)
    assert {x.number for x in drive.landmarks} == numbers and not drive.scene.tracks


def test_nothing_is_touched_as_long_as_nothing_moves():
    drive = Drive(*JUMPS["up"])
    drive.go(FIRST)
    positions = [x.position for x in drive.landmarks]
    assert not drive.follow()
    np.testing.assert_array_equal([x.position for x in drive.landmarks], positions)


def test_things_by_themselves_may_tell_that_a_place_is_the_same():
    """Where the odometry admits it, four pairs of things that agree close the gap before any loop does."""
    drive = drive_across(1.0, 90.0)
    assert worst_pose(drive) < 0.05
    assert {x.number for x in drive.landmarks} == {1, 2, 3, 4}
    assert all(len(at(drive.landmarks, block)) == 1 for block in TABLE)


# -- things that landed on the places of others


def sideways(yaw: float, bearing: float) -> tuple[list[float], list[float]]:
    """A jump of 30 cm across the table, by its bearing in degrees from the camera's right; a turn left or right."""
    a = np.radians(bearing)
    return [0.3 * np.cos(a), 0.0, 0.3 * np.sin(a)], [0.0, yaw, 0.0]


COLLISIONS = [(1.0, 45.0), (1.0, 315.0), (-1.0, 225.0), (1.0, 270.0)]  # a thing counts for another
ACROSS = [(yaw, bearing) for yaw in (1.0, -1.0) for bearing in np.arange(0.0, 360.0, 45.0)]


def drive_across(yaw: float, bearing: float) -> Drive:
    drive = Drive(*sideways(yaw, bearing))
    drive.go(FIRST)
    drive.jump(24.0)
    drive.go(SECOND)
    return drive


def worst_pose(drive: Drive) -> float:
    off = drive.smoother.poses()[:, :3, 3] - np.array(drive.truth)[:, :3, 3]
    return float(np.linalg.norm(off, axis=1).max())


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

"""A camera whose pose jumps by 30 cm and 10 degrees maps a table twice; a loop closure makes it one table again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from jumping_camera import CONFIG, FIRST, JUMPS, SECOND, TABLE, THIRD, Drive, at, drive_across, mapped_twice, worst_pose
from lasting_world import CLASSES, WALL, Block

from thingmap.mapper.config import TrackConfig
from thingmap.mapper.estimation.landmarks import Landmark

SURFACE = 0.03  # m from the true surface to the cloud


def surface_distance(points: np.ndarray, blocks: Iterable[Block]) -> np.ndarray:
    """(N,) metres from (N, 3) points to the table, the wall or a block."""
    distance = np.minimum(np.abs(points[:, 2]), np.abs(WALL - points[:, 1]))
    for block in blocks:
        q = np.abs(points - block.centre) - np.array(block.size) / 2.0
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        distance = np.minimum(distance, np.where(outside > 0.0, outside, -q.max(axis=1)))
    return distance


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
    drive = mapped_twice(JUMPS[request.param])
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
    drive = mapped_twice(JUMPS[name], CANDIDATES)
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
    drive = mapped_twice(JUMPS[name], SLOW, SECOND[:1])
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
    drive = mapped_twice(JUMPS["to the right"])
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

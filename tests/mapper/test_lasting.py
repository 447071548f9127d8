"""What a map promises of the same place seen for long: what is gone goes, what is hidden or just not found stays.

Through `SemanticMapper` itself with given poses, on boxes on a table (`lasting_world`).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))  # `lasting_world` is beside this file

from lasting_world import Block, Film, around, visible_share

from thingmap.datasets.frame import Frame
from thingmap.factors.evidence_model import EvidenceModel, generic_evidence_model
from thingmap.factors.existence import ExistenceModel
from thingmap.mapper.config import KeyframeConfig, MapperConfig, OdometryConfig, OdometrySource
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.mapper import SemanticMapper

POSES = MapperConfig(odometry=OdometryConfig(source=OdometrySource.POSES))
EVERY_FRAME = replace(POSES, keyframes=KeyframeConfig(max_gap=1))
STATED = ExistenceModel(
    null_prior=0.5,
    object_rate=(4.0, 2.0),
    none_rate=(1.0, 5.0),
    score_correlation=0.5,
    steady_confusion=0.1,
    surface=0.5,
)
CUP = Block("cup", (0.22, 0.0), (0.09, 0.09, 0.1))
CEREAL = Block("cereal box", (-0.05, 0.2), (0.2, 0.07, 0.3))
BOOK = Block("book", (-0.25, -0.1), (0.2, 0.15, 0.04))
BOTTLE = Block("bottle", (0.1, 0.25), (0.07, 0.07, 0.25))
BOWL = Block("bowl", (0.0, -0.2), (0.15, 0.15, 0.07))
TABLE = (CUP, CEREAL, BOOK, BOTTLE, BOWL)
WALK = np.arange(-25.0, 25.0, 5.0)  # bearings in degrees, ten views 5 degrees apart
NEAR = 0.12  # m from the middle of a block to the landmark that stands for it


def make(film: Film, config: MapperConfig) -> SemanticMapper:
    generic = generic_evidence_model()
    model = EvidenceModel(generic.scores, generic.detection, STATED, "the numbers of these tests")
    return SemanticMapper(film.detect, config, gravity=np.array([0.0, 0.0, -1.0]), model=model)


def feed(mapper: SemanticMapper, frames: Iterable[Frame]) -> None:
    for frame in frames:
        mapper.process_frame(frame)


def alive(mapper: SemanticMapper) -> list[Landmark]:
    return list(mapper._scene.landmarks.values())


def find(mapper: SemanticMapper, block: Block) -> Landmark:
    """The landmark that stands for a block."""
    near = [x for x in alive(mapper) if np.linalg.norm(x.position - block.centre) < NEAR]
    return max(near, key=lambda x: x.belief.existence)


def walked(film: Film, config: MapperConfig = EVERY_FRAME) -> SemanticMapper:
    """Ten views of all blocks."""
    mapper = make(film, config)
    feed(mapper, film.walk(WALK, *TABLE))
    return mapper


def stood(film: Film, config: MapperConfig = EVERY_FRAME) -> SemanticMapper:
    """Ten views of all blocks from one place."""
    mapper = make(film, config)
    feed(mapper, film.still(0.0, TABLE, 10))
    return mapper


# -- what is gone


def existence_without(mapper: SemanticMapper, frames: Iterable[Frame], block: Block) -> list[float]:
    landmark = find(mapper, block)
    course = [landmark.belief.existence]
    assert course[0] > 0.9
    for frame in frames:
        mapper.process_frame(frame)
        course.append(landmark.belief.existence)
    return course


@pytest.mark.parametrize("gone", [CUP, CEREAL, BOTTLE, BOWL], ids=lambda block: block.label)
@pytest.mark.parametrize("way", [WALK + 50.0, WALK[::-1], np.arange(30.0, 130.0, 10.0)], ids=["on", "back", "fast"])
def test_what_is_taken_away_is_gone_within_ten_views_of_a_moving_camera(gone, way):
    film = Film()
    mapper = walked(film)
    course = existence_without(mapper, film.walk(way, *(b for b in TABLE if b is not gone)), gone)
    assert len(course) == 11 and course[-1] < 0.1
    assert len(alive(mapper)) >= len(TABLE) - 1  # the others stay


@pytest.mark.parametrize("gone", [CUP, CEREAL, BOTTLE, BOWL], ids=lambda block: block.label)
@pytest.mark.parametrize(("before", "bearing"), [(walked, 20.0), (stood, 0.0), (walked, 40.0)])
def test_what_is_taken_away_is_gone_within_ten_views_of_a_still_camera(gone, before, bearing):
    """From where it was seen before, and from where the camera has never been."""
    film = Film()
    mapper = before(film)
    course = existence_without(mapper, film.still(bearing, [b for b in TABLE if b is not gone], 10), gone)
    assert course[-1] < 0.02


# -- what is hidden


def screen(block: Block, bearing: float, beside: float, width: float = 0.3) -> Block:
    """Something 0.25 m before a block, seen from a bearing, that stands this much to the right, metres."""
    a = np.radians(bearing)
    towards, right = np.array([np.sin(a), -np.cos(a)]), np.array([np.cos(a), np.sin(a)])
    x, y = np.array(block.place) + 0.25 * towards + beside * right
    return Block("", (float(x), float(y)), (width, 0.02, 0.45))


HIDDEN = [(CUP, 0.0), (CUP, 0.09), (CEREAL, 0.13), (BOWL, 0.13)]  # wholly, and with a third in view
MOSTLY_HIDDEN = 0.37


@pytest.mark.parametrize(("block", "beside"), HIDDEN, ids=lambda x: getattr(x, "label", x))
@pytest.mark.parametrize("before", [walked, stood])
def test_what_is_only_hidden_stays_for_a_thousand_frames(block, beside, before):
    film, hidden_by = Film(), screen(block, 0.0, beside)
    assert visible_share(around(0.0), block, [*TABLE, hidden_by]) < MOSTLY_HIDDEN
    mapper = before(film)
    landmark = find(mapper, block)
    existence = landmark.belief.existence
    assert existence > 0.95
    feed(mapper, film.still(0.0, [*TABLE, hidden_by], 1000))
    assert mapper.statistics()["keyframes"] == 1010
    assert landmark.number in mapper._scene.landmarks
    assert landmark.belief.existence > existence - 0.01


def test_what_stays_hidden_from_every_side_stays():
    """The camera goes to and fro and the screen with it."""
    film = Film()
    mapper = walked(film)
    landmark = find(mapper, CUP)
    existence = landmark.belief.existence
    for bearing in np.tile(np.concatenate([np.arange(-40, 40, 8), np.arange(40, -40, -8)]), 10).astype(float):
        feed(mapper, film.still(bearing, [*TABLE, screen(CUP, bearing, 0.05)], 5))
    assert mapper.statistics()["keyframes"] == 1010
    assert landmark.number in mapper._scene.landmarks
    assert landmark.belief.existence > existence - 0.01


# -- what is there


def watch(mapper: SemanticMapper, frames: Iterable[Frame]) -> dict[int, float]:
    """Least existence of every landmark, from the 50th keyframe on."""
    least: dict[int, float] = {}
    for frame in frames:
        if mapper.process_frame(frame).is_keyframe and mapper._camera.smoother.keyframes > 50:
            for x in alive(mapper):
                least[x.number] = min(least.get(x.number, 1.0), x.belief.existence)
    return least


def in_a_mood(moody: Block, blocks: Iterable[Block] = TABLE) -> list[Block]:
    """Objects that are found in 70 % of the frames, and one that is found in 8 % only."""
    return [replace(b, rate=0.08 if b is moody else 0.7) for b in blocks]


def check_all_there(mapper: SemanticMapper, least: dict[int, float]) -> None:
    statistics = mapper.statistics()
    assert statistics["retired"] == 0 and statistics["outcomes"]["retired"] == 0
    for block in TABLE:
        assert least[find(mapper, block).number] > 0.5


@pytest.mark.parametrize("moody", [CEREAL, BOOK], ids=lambda block: block.label)
def test_over_ten_thousand_static_frames_nothing_true_is_retired(moody):
    """Seen by a moving camera first, then by one that stands still for five and a half minutes."""
    film = Film()
    mapper = walked(film, POSES)
    check_all_there(mapper, watch(mapper, film.still(20.0, in_a_mood(moody), 10_000)))


@pytest.mark.parametrize("moody", [CEREAL, BOWL], ids=lambda block: block.label)
def test_neither_is_it_if_the_camera_never_moved(moody):
    """One direction is one view's worth: enough to keep, not enough to be sure of what is hardly ever found."""
    film = Film()
    mapper = make(film, POSES)
    watch(mapper, film.still(0.0, in_a_mood(moody), 10_000))
    assert mapper.statistics()["retired"] == 0
    for block in TABLE:
        assert find(mapper, block).belief.existence > 0.5


def test_neither_is_it_if_every_frame_is_a_keyframe():
    film = Film()
    mapper = walked(film)
    check_all_there(mapper, watch(mapper, film.still(20.0, in_a_mood(CEREAL), 2000)))
    assert mapper.statistics()["keyframes"] == 2010

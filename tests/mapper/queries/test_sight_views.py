"""What is visible from a place, and what should be detected there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.factors.evidence_model import default_evidence_model, generic_evidence_model
from thingmap.factors.solid import project_solid
from thingmap.mapper.config import EvidenceConfig, MapperConfig
from thingmap.mapper.config_file import dump_config
from thingmap.mapper.map.boxes import box_axes
from thingmap.mapper.map.map_file import CLOUD_NAME
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.queries.seen_volumes import SAMPLES, box_std

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
HERE = np.eye(4)
SURE = 1e-6 * np.eye(3)
GREY = np.full((1, 3), 128, dtype=np.uint8)


@pytest.fixture
def put(make_thing, make_map):
    """`put((x, y, z), ...)`: a map of cups there, with the camera."""

    def put(*places, **changes):
        values = {"position_covariance": SURE, "size": [0.1, 0.1, 0.1], "yaw": 0.0, "existence": 0.9, **changes}
        things = [make_thing(n + 1, position=list(place), **values) for n, place in enumerate(places)]
        return make_map(*things, camera=CAMERA)

    return put


def wall(z: float, x: tuple[float, float] = (-1.0, 1.0)) -> np.ndarray:
    """Points of a wall across the view, every 2 cm."""
    grid = np.meshgrid(np.arange(*x, 0.02), np.arange(-1.0, 1.0, 0.02), [z])
    return np.stack([axis.ravel() for axis in grid], axis=1)


def with_cloud(object_map, folder: Path, points: np.ndarray):
    OutputFolder(folder).write_cloud(points, np.repeat(GREY, len(points), axis=0))
    return replace(object_map, cloud=folder / CLOUD_NAME)


def test_a_thing_in_the_open_is_seen_as_surely_as_it_exists(put) -> None:
    (seen,) = put((0.0, 0.0, 1.0)).visible_from(HERE)
    assert seen.probability == pytest.approx(0.9)
    assert seen.share == pytest.approx(1.0)
    left, top, right, bottom = seen.xyxy
    assert (left + right) / 2 == pytest.approx(CAMERA.cx, abs=1.0)
    assert (top + bottom) / 2 == pytest.approx(CAMERA.cy, abs=1.0)
    assert right - left == pytest.approx(525 * 0.1 / 0.95, rel=0.1)


def test_a_label_asks_for_the_probability_of_that_class(put) -> None:
    cups = put((0.0, 0.0, 1.0))
    assert cups.visible_from(HERE, label="CUP")[0].probability == pytest.approx(0.9 * 0.9)
    assert cups.visible_from(HERE, label="bowl")[0].probability == pytest.approx(0.9 * 0.1)
    assert cups.visible_from(HERE, label="book") == []


def test_what_stands_before_hides_and_what_stands_behind_does_not(put) -> None:
    seen = put((0.0, 0.0, 1.0), (0.0, 0.0, 2.0)).visible_from(HERE)
    assert [answer.thing.id for answer in seen] == ["thing-0001"]
    # from the other side it is the other one
    T = np.diag([-1.0, 1.0, -1.0, 1.0])
    T[2, 3] = 3.0
    assert [a.thing.id for a in put((0.0, 0.0, 1.0), (0.0, 0.0, 2.0)).visible_from(T)] == ["thing-0002"]


def test_a_thing_half_hidden_is_seen_if_half_is_enough(put) -> None:
    object_map = put((-0.05, 0.0, 1.0), (0.0, 0.0, 2.0), size=[0.1, 0.1, 0.4])
    half = next(a for a in object_map.visible_from(HERE, min_share=0.05) if a.thing.id == "thing-0002")
    assert 0.1 < half.share < 0.9
    strict = [a.thing.id for a in object_map.visible_from(HERE, min_share=0.95)]
    assert strict == ["thing-0001"]


def test_what_is_likelier_not_there_hides_nothing(put) -> None:
    seen = put((0.0, 0.0, 1.0), (0.0, 0.0, 2.0), existence=0.4).visible_from(HERE)
    assert len(seen) == 2


def test_what_holds_a_thing_does_not_hide_it(put, make_thing) -> None:
    object_map = put((0.0, 0.0, 1.0))
    shelf = make_thing(2, size=[0.5, 0.4, 0.6], position=[0.0, 0.0, 1.0], position_covariance=SURE, yaw=0.0)
    seen = replace(object_map, things=(*object_map.things, shelf)).visible_from(HERE)
    assert {answer.thing.id for answer in seen} == {"thing-0001", "thing-0002"}


def test_the_cloud_hides_what_is_behind_it(put, tmp_path: Path) -> None:
    cup = put((0.0, 0.0, 1.0))
    assert with_cloud(cup, tmp_path, wall(0.7)).visible_from(HERE) == []
    assert len(with_cloud(cup, tmp_path, wall(1.4)).visible_from(HERE)) == 1
    (half,) = with_cloud(cup, tmp_path, wall(0.7, (0.01, 1.0))).visible_from(HERE)
    assert half.share == pytest.approx(0.5, abs=0.1)


def test_its_own_points_do_not_hide_a_thing_however_unsure_its_place(put, tmp_path: Path) -> None:
    front = wall(0.95, (-0.05, 0.05))
    front = front[np.abs(front[:, 1]) < 0.05]
    for sigma in (0.001, 0.05):
        cup = put((0.0, 0.0, 1.0), position_covariance=np.diag([1e-6, 1e-6, sigma**2]))
        assert with_cloud(cup, tmp_path, front).visible_from(HERE)[0].share == pytest.approx(1.0, abs=0.02)


def test_a_thing_of_unknown_place_at_the_border_is_seen_every_other_time(put) -> None:
    edge = (CAMERA.width - 0.5 - CAMERA.cx) / CAMERA.fx  # at a metre: on the image's right side
    (seen,) = put((edge, 0.0, 1.0), position_covariance=np.diag([0.04, 1e-6, 1e-6])).visible_from(HERE, min_share=0.5)
    assert seen.probability == pytest.approx(0.9 * 0.5, abs=0.9 * 2.0 / SAMPLES)
    assert 0.35 < seen.share < 0.65


def test_what_is_behind_the_camera_or_beside_the_image_is_not_seen(put) -> None:
    assert put((0.0, 0.0, -1.0), (3.0, 0.0, 1.0), (0.0, 0.0, 0.02)).visible_from(HERE) == []


def test_without_a_camera_the_user_is_told(put, make_map) -> None:
    with pytest.raises(UserError, match="camera"):
        make_map().visible_from(HERE)
    assert len(make_map().visible_from(HERE, CAMERA)) > 0


@pytest.mark.parametrize("pose", [np.eye(3), np.full((4, 4), np.nan), 2.0 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])])
def test_a_pose_that_is_none_is_refused(put, pose: np.ndarray) -> None:
    with pytest.raises(ValueError, match="T_world_camera"):
        put((0.0, 0.0, 1.0)).visible_from(pose)


@pytest.mark.parametrize("share", [0.0, 1.5])
def test_a_share_that_is_none_is_refused(put, share: float) -> None:
    with pytest.raises(ValueError, match="min_share"):
        put((0.0, 0.0, 1.0)).visible_from(HERE, min_share=share)


def test_a_detection_is_expected_as_the_model_has_it(put) -> None:
    object_map = put((0.0, 0.0, 1.0))
    (expected,) = object_map.expected_at(HERE)
    left, top, right, bottom = expected.xyxy
    side = np.sqrt((right - left) * (bottom - top))
    model = default_evidence_model(object_map.classes).bind(object_map.classes)
    by_class = [model.detection.probability(1.0, side, posterior=row) for row in np.eye(3)]
    assert expected.probability == pytest.approx(0.9 * (0.9 * by_class[0] + 0.1 * by_class[1]), rel=1e-6)


def test_the_hidden_and_the_small_are_hardly_expected(put) -> None:
    near, far = put((0.0, 0.0, 1.0)).expected_at(HERE)[0], put((0.0, 0.0, 12.0)).expected_at(HERE)[0]
    assert far.probability < 0.5 * near.probability
    hidden = put((0.0, 0.0, 1.0), (0.0, 0.0, 2.0)).expected_at(HERE)
    assert [answer.thing.id for answer in hidden] == ["thing-0001"]


def test_the_model_is_the_one_of_the_run(put, tmp_path: Path) -> None:
    object_map = with_cloud(put((0.0, 0.0, 1.0)), tmp_path, wall(3.0))
    (default,) = object_map.expected_at(HERE)
    blind = generic_evidence_model()
    blind = replace(blind, detection=replace(blind.detection, intercept=blind.detection.intercept - 3.0))
    blind.save(tmp_path / "blind.json")
    config = MapperConfig(evidence=EvidenceConfig(model=str(tmp_path / "blind.json")))
    OutputFolder(tmp_path).write_config(dump_config(config))
    (own,) = object_map.expected_at(HERE)
    assert own.probability < 0.2 * default.probability
    side = np.sqrt(np.prod(own.xyxy[2:] - own.xyxy[:2]))
    assert own.probability == pytest.approx(0.9 * float(blind.detection.probability(1.0, side)), rel=1e-3)


def test_the_box_is_as_unsure_as_a_thousand_boxes_are(put) -> None:
    covariance = np.array([[9e-4, 2e-4, 0.0], [2e-4, 4e-4, 1e-4], [0.0, 1e-4, 16e-4]])
    object_map = put((0.2, 0.1, 1.5), position_covariance=covariance, size_std=[0.01, 0.02, 0.015], yaw=0.4)
    (thing,) = object_map.things
    R = object_map.R_world_upright
    rng = np.random.default_rng(0)
    boxes = []
    for _ in range(2000):
        position = rng.multivariate_normal(thing.position, covariance)
        size = thing.size * np.exp(rng.normal(0.0, thing.size_std / thing.size))
        boxes.append(project_solid(HERE, box_axes(thing.yaw, R), position, np.log(size / 2.0)).xyxy)
    np.testing.assert_allclose(box_std(thing, R, HERE, CAMERA), 525.0 * np.std(boxes, axis=0), rtol=0.08)


def test_answers_are_ranked_and_repeat(put) -> None:
    object_map = put((0.0, 0.0, 1.0), (0.3, 0.0, 1.5), (-0.35, 0.1, 2.5))
    first, again = object_map.expected_at(HERE), object_map.expected_at(HERE)
    chances = [answer.probability for answer in first]
    assert len(first) == 3
    assert chances == sorted(chances, reverse=True)
    assert chances == [answer.probability for answer in again]

"""The world of the back end's benchmark is consistent, and the mapper's back end works in it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from back_end import BackEnd
from back_end_report import describe_back_end, run_back_end
from back_end_views import SimulatedView, simulate
from back_end_world import CLASSES, World, make_world
from throughput import main

from thingmap.mapper.config import VisualConfig
from thingmap.mapper.trajectory.rigid import inverse

KEYFRAMES, LAPS = 40, 0.16


def simulated(seed: int) -> tuple[World, list[SimulatedView]]:
    rng = np.random.default_rng(seed)
    world = make_world(24, 6, rng)
    return world, list(simulate(world, KEYFRAMES, LAPS, rng))


def test_there_are_40_known_classes_and_no_volumes_touch() -> None:
    world = make_world(60, 20, np.random.default_rng(2))
    assert len(set(CLASSES)) == 40
    assert world.priors.known.all()
    reach = np.exp(world.log_sizes)[:, None] + np.exp(world.log_sizes)[None]
    touching = (np.abs(world.positions[:, None] - world.positions[None]) < reach).all(axis=2)
    assert touching.sum() == len(world)  # each touches itself alone


def test_views_agree_with_the_world() -> None:
    _, views = simulated(0)
    for before, view in pairwise(views):
        assert view.odometry is not None
        error = inverse(inverse(before.T_world_camera) @ view.T_world_camera) @ view.odometry.T_a_b
        assert 0.0 < np.linalg.norm(error[:3, 3]) < 0.05
        assert [motion.a for motion in view.visual] == list(range(view.keyframe))[-VisualConfig().neighbours :]
    assert np.mean([len(view.detections) for view in views]) > 1.0


def test_detections_scatter_about_the_truth_as_they_say() -> None:
    world, views = simulated(0)
    boxes, centres = [], []
    for view in views:
        xyxy, _ = world.view(view.T_world_camera)
        for thing, d in view.detections.items():
            assert (d.xyxy[2:] > d.xyxy[:2]).all()
            share = np.sqrt(max(view.in_image[thing] * (1.0 - view.occluded[thing]), 0.1))
            boxes += ((d.xyxy - xyxy[thing]) * share / d.sigma_px)[d.sides_seen].tolist()
            true_centre = (world.positions[thing] - view.T_world_camera[:3, 3]) @ view.T_world_camera[:3, :3]
            ray = true_centre / np.linalg.norm(true_centre)
            centres.append((d.centre - true_centre) @ ray * share / d.sigma_range)
    assert np.std(boxes) == pytest.approx(1.0, abs=0.15)
    assert np.std(centres) == pytest.approx(1.0, abs=0.25)


def test_views_repeat_with_the_seed() -> None:
    (_, first), (_, second), (_, other) = simulated(0), simulated(0), simulated(1)
    np.testing.assert_array_equal(first[-1].odometry.T_a_b, second[-1].odometry.T_a_b)  # pyright: ignore
    assert [list(v.detections) for v in first] == [list(v.detections) for v in second]
    assert [list(v.detections) for v in first] != [list(v.detections) for v in other]


def test_the_back_end_maps_objects_at_their_places() -> None:
    world, views = simulated(0)
    back_end = BackEnd(world)
    for view in views:
        back_end.add(view)
    back_end.finish()
    landmarks = list(back_end.scene.landmarks.values())
    things = [back_end.thing_of(landmark.belief) for landmark in landmarks]
    assert len(set(things)) == len(things) >= 5  # never two landmarks on one thing
    errors = [np.linalg.norm(x.position - world.positions[j]) for x, j in zip(landmarks, things, strict=True)]
    assert np.median(errors) < 0.1


def test_marks_and_quality() -> None:
    marks, quality = run_back_end([10, 30], objects=24, phantoms=6)
    assert [mark.keyframes for mark in marks] == [10, 30]
    assert all(0.0 < mark.median_ms <= mark.p95_ms for mark in marks)
    assert quality.lost <= quality.seen <= 24
    assert quality.trajectory_error < 0.05
    assert quality.class_accuracy > 0.5
    text = describe_back_end(marks, quality, 24)
    assert "| 30 " in text and "24 objects and 6 phantoms" in text


def test_the_command_prints_and_refuses(capsys) -> None:
    assert main(["--keyframes", "5", "--objects", "12", "--phantoms", "2"]) == 0
    assert "## Throughput: back end" in capsys.readouterr().out
    assert main(["--sequence", "nowhere", "--detector", "none", "--keyframes"]) == 2
    assert "nowhere" in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [["--keyframes", "0"], ["--laps", "-1"], ["--sequence", "here"]])
def test_options_that_make_no_sense_are_refused(wrong: list[str]) -> None:
    with pytest.raises(SystemExit):
        main(wrong)


def test_a_full_room_is_refused(capsys) -> None:
    assert main(["--keyframes", "5", "--objects", "5000"]) == 2
    assert "no room" in capsys.readouterr().err

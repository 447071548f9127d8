"""Tables of the HOG benchmark: precision, thresholds, and what occlusion does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hog_job import Job, JudgedScene, Sights
from hog_report import (
    halves_table,
    mean_precision,
    occlusion_table,
    part_table,
    precision_table,
    threshold_at,
    trend_lines,
)
from tiny_hog import SCENE, cells

from thingmap.datasets.frame import Intrinsics
from thingmap.detectors.detections import Part
from thingmap.mapper.evaluation.boxes.curves import Scored
from thingmap.mapper.evaluation.boxes.image_boxes import TrueBoxes, found_boxes
from thingmap.mapper.evaluation.boxes.matching import Matches, match_boxes

CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)


def match_of(class_id: list[int], scores: list[float], right: list[bool]) -> Matches:
    """Boxes of which some are exactly on one object each."""
    boxes = np.array([[20.0 * k, 0.0, 20.0 * k + 10.0, 10.0] for k in range(len(scores))])
    there = np.array(right)
    true = boxes[there]
    visible = np.ones(len(true))
    thing = TrueBoxes(
        np.arange(len(true)), np.array(class_id)[there], true, true, visible, np.ones(len(true), dtype=bool)
    )
    return match_boxes(found_boxes(boxes, np.array(class_id), np.array(scores), CAMERA), thing, 0.5)


def scene_of(match: Matches, sights: Sights | None = None) -> JudgedScene:
    job = Job(SCENE, 1, Path("m.npz"), Path(), False)
    return JudgedScene(job, {part: [match] for part in Part}, sights, 10.0)


def test_mean_precision_is_that_of_the_classes_there_are() -> None:
    perfect, half = match_of([0, 0], [0.9, 0.8], [True, True]), match_of([1, 1], [0.9, 0.8], [False, True])
    assert mean_precision([perfect], ("a", "b", "c")) == 1.0
    assert mean_precision([perfect, half], ("a", "b", "c")) == pytest.approx(0.75)
    assert mean_precision([], ("a",)) is None
    groups = {"one": {"RGB": [scene_of(half)], "RGB-D": [scene_of(perfect)]}}
    shown = precision_table(groups, ("a", "b"))
    assert "| **1.000**" in shown and "| one    | a        | 0 " in shown
    assert part_table(groups, "RGB-D", ("a", "b")).count("1.000") == 5


def test_the_threshold_lets_so_many_false_boxes_through() -> None:
    claims = Scored(np.array([0.9, 0.8, 0.7, 0.6, 0.5]), np.array([True, False, False, True, False]), 2, 2)
    assert threshold_at(claims, 0.5) == 0.8
    assert threshold_at(claims, 1.0) == 0.6
    assert threshold_at(claims, 0.0) == 0.9
    assert threshold_at(replace(claims, right=np.zeros(5, dtype=bool)), 0.0) == np.inf


def test_tables_tell_what_occlusion_does() -> None:
    count = 30  # of objects that are seen, and of those whose left half is hidden
    occlusion = np.zeros((2 * count, 5))
    occlusion[count:, [Part.WHOLE, Part.TOP, Part.BOTTOM]] = 0.5
    occlusion[count:, Part.LEFT] = 0.95
    score = np.full((2 * count, 5), 0.8)
    score[count:] = (0.3, 0.2, 0.2, 0.05, 0.8)
    sights = Sights(occlusion, np.where(score > 0.5, score, 0.0), score)
    judged = [scene_of(match_of([0, 0], [0.7, 0.4], [False, False]), sights)]
    halves = {row[1]: row[2:6] for row in cells(halves_table(judged))}
    assert halves["0 to 10 %"] == ["120", "0.80", "0.80", "0.80"]
    assert halves["90 to 100 %"] == ["30", "0.05", "0.80", "0.30"]
    assert halves["30 to 50 %"] == ["0", "-", "-", "-"]
    trend = trend_lines(judged)
    assert "scores 0.80 and is NOT best" in trend and "keeps 100 %" in trend and "which keeps 38 %" in trend
    assert "no verdict" in trend_lines([scene_of(match_of([0], [0.5], [True]))])
    whole = {row[1]: row[2:13] for row in cells(occlusion_table(judged))}
    assert whole["0 to 10 %"] == ["30", *["1.00"] * 5, *["0.80"] * 5]
    assert whole["50 to 70 %"] == ["30", "0.00", "0.00", "0.00", "0.00", "1.00", "0.30", "0.20", "0.20", "0.05", "0.80"]

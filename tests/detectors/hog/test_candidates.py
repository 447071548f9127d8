"""Windows that are probable enough, and where they are."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.detectors.detections import Part
from thingmap.detectors.hog.candidates import ScoredLevel, candidates, corner_boxes
from thingmap.detectors.hog.model import HogTemplate
from thingmap.detectors.hog.pyramid import Level
from thingmap.detectors.hog.scoring import part_boxes


def template(class_id: int, rows: int, columns: int, platt=(-1.0, 0.0), box=(0.0, 0.0, 1.0, 1.0)) -> HogTemplate:
    return HogTemplate(class_id, Part(class_id), np.zeros((rows, columns, 31)), 0.0, 0.0, platt, box)


TEMPLATES = (template(0, 4, 6, box=(0.1, 0.0, 0.9, 0.5)), template(1, 3, 2, platt=(-2.0, 1.0)))


@pytest.fixture
def levels() -> list[ScoredLevel]:
    rng = np.random.default_rng(0)
    found = []
    for scale, (h, w) in ((1.0, (9, 12)), (0.7, (6, 8))):
        scores = rng.normal(size=(2, h, w)).astype(np.float32)
        scores[0, h - 3 :] = scores[0, :, w - 5 :] = -np.inf
        level = Level(scale, np.zeros((h, w, 31), np.float32), 2)
        found.append(ScoredLevel.of(level, scores, corner_boxes(TEMPLATES)))
    return found


def test_boxes_are_those_of_the_windows(levels: list[ScoredLevel]):
    for scored, scale in zip(levels, (1.0, 0.7), strict=True):
        level = Level(scale, np.zeros((0, 0, 31), np.float32), 2)
        for t, one in enumerate(TEMPLATES):
            expected = part_boxes(one, level, np.array([[0, 0], [3, 1]]))
            shift = scored.step * np.array([1, 3, 1, 3])
            np.testing.assert_allclose(scored.first[t] + [[0, 0, 0, 0], shift], expected, atol=1e-9)


def test_all_that_are_probable_enough_and_no_others(levels: list[ScoredLevel]):
    expected = []
    for level in levels:
        for t, one in enumerate(TEMPLATES):
            for i, j in np.ndindex(level.scores.shape[1:]):
                if np.isfinite(level.scores[t, i, j]):
                    p = float(one.probability(level.scores[t, i, j]))
                    expected += [(p, t, *(level.first[t] + level.step * np.array([j, i, j, i])))] if p >= 0.6 else []
    found = candidates(levels, TEMPLATES, 0.6)
    assert 0 < len(found) < 0.7 * sum(level.scores.size for level in levels)
    rows = np.column_stack([found.probability, found.class_id, found.xyxy])
    np.testing.assert_allclose(sorted(rows.tolist()), sorted(expected), rtol=1e-6)
    assert (np.diff(found.probability) <= 0).all() and (found.part == found.class_id).all()


def test_the_limits_of_probability(levels: list[ScoredLevel]):
    windows = sum(int(np.isfinite(level.scores).sum()) for level in levels)
    assert len(candidates(levels, TEMPLATES, 0.0)) == windows
    assert len(candidates(levels, TEMPLATES, 1.0)) == 0


def test_a_template_whose_scores_say_nothing(levels: list[ScoredLevel]):
    flat = (TEMPLATES[0], template(1, 3, 2, platt=(0.0, np.log(3.0))))  # p = 1/4 everywhere
    of_flat = sum(int(np.isfinite(level.scores[1]).sum()) for level in levels)
    assert (candidates(levels, flat, 0.2).class_id == 1).sum() == of_flat
    assert (candidates(levels, flat, 0.3).class_id == 1).sum() == 0


def test_no_levels():
    found = candidates([], TEMPLATES, 0.1)
    assert len(found) == 0 and found.xyxy.shape == (0, 4)

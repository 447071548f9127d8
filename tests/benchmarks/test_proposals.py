"""The truth that proposals are judged by, and the fit of their probabilities."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import label_fusion
import numpy as np
import proposal_scores
import proposal_truth
import pytest

from thingmap.datasets.errors import InputError
from thingmap.detectors.proposals.objectness import FEATURES


def proposals(labels: np.ndarray) -> Any:
    class Found(SimpleNamespace):
        def __len__(self) -> int:
            return int(labels.max()) + 1

    return Found(labels=labels)


def test_iou_by_pixels():
    instances = np.full((48, 64), -1)
    instances[0:10, 0:10] = 3
    instances[20:30, 0:20] = 7
    labels = np.full((48, 64), -1)
    labels[0:10, 5:15] = 0  # half of thing 3, and as much beside it: 50 / 150
    labels[20:30, 0:16] = 1  # 160 / 200
    depth = np.ones((48, 64))
    found = proposal_truth.match(proposals(labels), instances, depth, objects=5)
    np.testing.assert_allclose(found.iou, [[50 / 150, 0], [0, 0.8]])
    assert found.is_object.tolist() == [True, False]
    assert found.found.tolist() == [False, True] and found.right.tolist() == [False, True]
    assert found.counts.tolist() == [True, True]  # 400 pixels of 640 x 480 are 4 here
    depth[0:10, 0:6] = 0.0  # too little of it is read
    depth[20:30] = 4.0  # too far
    assert not proposal_truth.match(proposals(labels), instances, depth, objects=5).counts.any()


def test_the_fit_finds_the_log_odds():
    rng = np.random.default_rng(0)
    features = rng.normal(size=(20000, len(FEATURES))) * np.linspace(0.5, 3.0, len(FEATURES))
    weights = np.zeros(len(FEATURES))
    weights[2], weights[5] = 1.5, -0.7
    right = rng.random(len(features)) < 1.0 / (1.0 + np.exp(-(features @ weights - 0.4)))
    model = proposal_scores.fit(features, right)
    assert model.bias == pytest.approx(-0.4, abs=0.08)
    np.testing.assert_allclose(model.weights, weights, atol=0.1)


def test_a_report_says_how_far_off_the_probabilities_are():
    probability = np.repeat([0.15, 0.95], 100)
    right = np.concatenate([np.arange(100) < 35, np.ones(100, dtype=bool)])
    text = proposal_scores.report(probability, right)
    assert "200 proposals, 135 things" in text and "calibration error 0.125" in text


def test_scenes_hold_out_all_kinds():
    lines = proposal_scores.scenes(24)
    assert len(set(lines)) == 24
    for half in (0, 1):
        kinds = {line.split("?")[0] for k, line in enumerate(lines) if k // 4 % 2 == half}
        assert kinds == {"synth:tabletop", "synth:kitchen", "synth:survey"}
    assert all(int(line.split("seed=")[1].split("&")[0]) < 1000 for line in lines)


def test_recorded_views(real_data, tmp_path):
    views = label_fusion.read_label_fusion(real_data / "label_fusion" / "labels")
    assert len(views) == 15
    depth, instances = views[0].frame.depth, views[0].instances
    assert np.unique(instances).tolist() == [-1, 0, 1]
    box = depth[(instances == 1) & (depth > 0)]
    assert 0.40 < np.median(box) < 0.45 and box.std() < 0.05  # the front of a box: wrong bits would scatter
    with pytest.raises(InputError, match="give the folder of the views"):
        label_fusion.read_label_fusion(tmp_path)

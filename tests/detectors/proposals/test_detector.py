"""The class-agnostic detector and its probabilities."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.synthetic.synth import open_synth
from thingmap.detectors.proposals.config import ProposalConfig
from thingmap.detectors.proposals.detector import ProposalDetector
from thingmap.detectors.proposals.objectness import (
    FEATURES,
    SHIPPED,
    Objectness,
    load_objectness,
    proposal_features,
    shipped_objectness,
)
from thingmap.detectors.proposals.outline import Beyond, outline_counts
from thingmap.detectors.proposals.proposals import find_proposals

THINGS = [(-0.2, 0.65, 0.08, 0.08, 0.11), (0.0, 0.8, 0.1, 0.06, 0.2), (0.2, 0.6, 0.07, 0.07, 0.09)]


def test_things_on_a_table_are_detected(make_table):
    found = ProposalDetector()(make_table(THINGS))
    assert found.classes == ("unknown",) and len(found) == 3
    assert found.scores.shape == (3, 1) and found.confidence.min() > 0.5
    assert (np.diff(found.confidence) <= 0).all()
    for box, mask in zip(found.xyxy, found.mask, strict=True):
        y, x = np.nonzero(mask)
        assert box.tolist() == [x.min(), y.min(), x.max() + 1, y.max() + 1]


def test_nothing_without_depth(make_table, assert_same):
    frame = make_table([])
    dark = replace(frame, depth=np.zeros_like(frame.depth))
    assert len(ProposalDetector()(dark)) == 0
    assert_same(ProposalDetector()(frame), ProposalDetector()(frame))


def test_options(make_table):
    frame = make_table([*THINGS, (-0.44, 0.75, 0.15, 0.1, 0.1)])  # the last is cut by the image's left edge
    everything = ProposalDetector(confidence=0.0)(frame)
    assert len(everything) == 4 and (everything.xyxy[:, 0] == 0).sum() == 1
    whole = ProposalDetector(confidence=0.0, edge=False)(frame)
    assert len(whole) == 3 and (whole.xyxy[:, 0] > 0).all()
    best = ProposalDetector(confidence=0.0, max_detections=2)(frame)
    np.testing.assert_array_equal(best.confidence, everything.confidence[:2])
    sure = float(np.sort(everything.confidence)[-2])
    assert len(ProposalDetector(confidence=sure)(frame)) == 2
    with pytest.raises(UserError, match="max_detections must be at least 1, but is 0"):
        ProposalDetector(max_detections=0)
    with pytest.raises(UserError, match=r"confidence must be in \[0, 1\], but is -0.1"):
        ProposalDetector(confidence=-0.1)


def test_features_say_what_they_are_called(make_table):
    config = ProposalConfig()
    found = find_proposals(make_table([THINGS[1]]), config)
    values = dict(zip(FEATURES, proposal_features(found, config)[0], strict=True))
    assert values["log extent"] == pytest.approx(np.log(0.2 * 1.15), abs=0.15)
    assert values["depth"] == pytest.approx(found.centroids[0, 2])
    assert values["border"] == 0.0 and values["hangs"] == 0.0
    assert values["support"] > 0.05 and values["farther"] > 0.4
    assert 0.1 / 0.4 - 0.05 < values["above support"] < 0.1 / 0.4 + 0.08  # its middle is 0.1 m up
    shares = [values[name] for name in ("border", "no reading", "farther", "nearer", "support", "plane", "rest")]
    assert sum(shares) == pytest.approx(1.0)


def test_outline_of_a_square():
    labels = np.full((6, 6), -1, dtype=np.int32)
    labels[0:2, 2:4] = 0
    depth = np.ones((6, 6), dtype=np.float32)
    depth[:, 1] = 2.0
    depth[:, 4] = 0.5
    owner = np.full((6, 6), -1, dtype=np.int32)
    owner[2] = 0
    counts = outline_counts(labels, depth, owner, np.array([True]), 1, 0.01, 0.01)[0]
    expected = {Beyond.BORDER: 2, Beyond.FARTHER: 2, Beyond.NEARER: 2, Beyond.SUPPORT: 2}
    assert counts.tolist() == [expected.get(kind, 0) for kind in Beyond]
    depth[2, 2], owner[2, 3] = 0.0, -1
    counts = outline_counts(labels, depth, owner, np.array([True]), 1, 0.01, 0.01)[0]
    assert counts[Beyond.NO_READING] == 1 and counts[Beyond.REST] == 1 and counts[Beyond.SUPPORT] == 0


def test_objectness_file(tmp_path: Path):
    model = Objectness(0.5, tuple(float(k) for k in range(len(FEATURES))))
    model.save(tmp_path / "a.json")
    assert load_objectness(tmp_path / "a.json") == model
    features = np.zeros((2, len(FEATURES)))
    features[1, 1] = -0.5
    np.testing.assert_allclose(model(features), [1 / (1 + np.exp(-0.5)), 0.5])
    assert shipped_objectness() == load_objectness(SHIPPED)
    (tmp_path / "b.json").write_text('{"bias": 1, "weights": {}}')
    for name in ("b.json", "none.json"):
        with pytest.raises(InputError, match="expected a bias and a weight for each feature"):
            load_objectness(tmp_path / name)


def test_rendered_things_of_no_class_are_found_and_walls_are_not():
    scene = open_synth("synth:tabletop?seed=901&clutter=low&frames=40&width=320")
    frame, instances = scene[30], scene.instances(30)
    found = ProposalDetector(confidence=0.5)(frame)
    assert found.mask is not None
    ids, pixels = np.unique(instances[instances >= 0], return_counts=True)
    large = ids[pixels > 300]
    iou = np.array([[(m & (instances == i)).sum() / (m | (instances == i)).sum() for m in found.mask] for i in large])
    assert (iou.max(axis=1) >= 0.5).mean() >= 0.6
    assert (iou.max(axis=0) >= 0.5).mean() >= 0.6

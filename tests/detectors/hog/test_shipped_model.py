"""The model that comes with the package, on a rendered table that nothing was trained on."""

from __future__ import annotations

import numpy as np

from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.model import load_model, shipped_model
from thingmap.detectors.spec import make_detector

SCENE = "synth:tabletop?seed=1900&clutter=low&frames=20"
SEEN = 0.9  # share of an object's silhouette


def test_it_knows_the_synthetic_classes_and_their_halves():
    model = load_model(shipped_model())
    assert set(model.classes) == set(CLASSES)
    assert model.channels is Channels.RGBD
    assert {(t.class_id, t.part) for t in model.templates} == {(k, p) for k in range(len(CLASSES)) for p in Part}
    assert shipped_model().stat().st_size < 1_000_000


def test_it_finds_most_of_what_stands_in_full_view():
    sequence = open_sequence(SCENE)
    detector = make_detector("hog", sequence)
    label_of = {thing.id: thing.label for thing in sequence.objects}
    found, there = 0, 0
    for index in (0, 10):
        detections, truth = detector(sequence[index]), sequence.truth(index)
        whole = detections.select(detections.part == Part.WHOLE)
        assert len(whole) < 60
        for row in np.flatnonzero(truth.visibility >= SEEN):
            there += 1
            same = [whole.classes[k] == label_of[int(truth.object_id[row])] for k in whole.class_id]
            found += bool(np.any(np.array(same) & (overlaps(whole.xyxy - 0.5, truth.xyxy[row]) >= 0.5)))
    assert there >= 8
    assert found > 0.5 * there


def overlaps(boxes: np.ndarray, box: np.ndarray) -> np.ndarray:
    """(N,) intersection over union of (N, 4) boxes with one."""
    size = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
    shared = np.prod(np.maximum(size, 0.0), axis=1)
    areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) + np.prod(box[2:] - box[:2])
    return shared / (areas - shared)

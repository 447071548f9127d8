from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from thingmap.detectors.detections import Detections, Part
from thingmap.mapper.config import LiftingConfig, MultiViewConfig
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.multiview.observations import observe

SCORES = {0: (0.7, 0.1), 1: (0.0, 0.0)}


@pytest.fixture
def cards(tools):
    return tools.Cards(((-0.2, 0.0, 1.0), 0.06), ((0.2, 0.1, 1.2), 0.08))


def seen(cards, detections, **numbers):
    return observe(detections, cards.frame(0, 0.0), LiftingConfig(), replace(MultiViewConfig(), **numbers))


def test_centroids_are_those_of_the_masks_readings(cards):
    found, refused = seen(cards, cards.detect(0.0, SCORES))
    np.testing.assert_allclose(found.centroid, [[-0.2, 0.0, 1.0], [0.2, 0.1, 1.2]], atol=0.005)
    assert refused == Counter() and found.row.tolist() == [0, 1]
    np.testing.assert_allclose(np.exp(found.log_distribution[0]), [0.7, 0.1, 0.2], atol=1e-6)
    assert found.log_distribution[1].argmax() == 2  # what is likeliest background is an observation too


def test_readings_without_depth_and_beyond_the_range_do_not_count(cards):
    frame, detections = cards.frame(0, 0.0), cards.detect(0.0, SCORES)
    depth = frame.depth.copy()
    depth[detections.mask[0] & (np.arange(160) < 54)] = np.nan  # the left half of the card, and a bit
    depth[58:60, 54:58] = 3.9
    found, _ = observe(detections, replace(frame, depth=depth), LiftingConfig(), MultiViewConfig(far=1.5))
    assert found.centroid[0, 2] == pytest.approx(1.0) and found.centroid[0, 0] > -0.185
    none, refused = seen(cards, detections, far=0.9)
    assert len(none) == 0 and none.log_distribution.shape == (0, 3) and refused == {Outcome.OUT_OF_RANGE: 2}


def test_a_mask_without_depth_is_told(cards):
    frame = cards.frame(0, 0.0)
    found, refused = observe(
        cards.detect(0.0, SCORES),
        replace(frame, depth=np.zeros_like(frame.depth)),
        LiftingConfig(),
        MultiViewConfig(),
    )
    assert len(found) == 0 and refused == {Outcome.NO_DEPTH: 2}


def test_halves_of_objects_are_not_observations(cards):
    detections = cards.detect(0.0, SCORES)
    detections = Detections(detections.classes, detections.xyxy, detections.scores, [Part.WHOLE, Part.TOP])
    found, refused = seen(cards, detections)
    assert found.row.tolist() == [0] and refused == {Outcome.PART_UNUSED: 1}


@pytest.mark.parametrize("masks", [True, False])
def test_points_cover_the_object_and_are_few(cards, masks):
    found, _ = seen(cards, cards.detect(0.0, SCORES, masks), points=50)
    for points, (centre, half) in zip(found.points, cards.cards, strict=True):
        assert len(points) == 50 and points.dtype == np.float32
        np.testing.assert_allclose(np.ptp(points[:, :2], axis=0), 2 * half, rtol=0.25)
        np.testing.assert_allclose(points[:, 2], centre[2], atol=1e-6)


def test_without_a_mask_the_middle_of_the_box_is_read(cards):
    found, _ = seen(cards, cards.detect(0.0, SCORES, masks=False))
    np.testing.assert_allclose(found.centroid, [[-0.2, 0.0, 1.0], [0.2, 0.1, 1.2]], atol=0.01)

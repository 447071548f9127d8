"""What one view says about members of the scene: template weights, hits and misses, the mixture of scores."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.detectors.detections import Part
from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.factors.free_space import FreeSpace
from thingmap.factors.visibility import Visibility, VolumePart
from thingmap.mapper.config import EvidenceConfig
from thingmap.mapper.estimation.association import PART_VISIBLE, Targets
from thingmap.mapper.estimation.lifting import LiftedDetection
from thingmap.mapper.estimation.looks import Looks, take_looks, template_weights

MODEL, FREE, CONFIG = generic_evidence_model().bind(("cup", "bowl", "monitor")), FreeSpace(), EvidenceConfig()
ALL, WHOLE_ONLY = np.ones(5, dtype=bool), np.arange(5) == Part.WHOLE
OPEN = np.full(3, 1.0 / 3.0)
WHOLE, TOP, BOTTOM, LEFT, RIGHT = (int(part) for part in Part)
CUP, BOWL = (0.6, 0.1, 0.02), (0.1, 0.6, 0.02)


def detection(part: int = WHOLE, scores: tuple[float, ...] = CUP) -> LiftedDetection:
    box, centre = np.array([300.0, 200.0, 400.0, 300.0]), np.array([0.0, 0.0, 2.0])
    return LiftedDetection(np.array(scores), box, np.ones(4, bool), 2.0, centre, 0.03, 0.03, np.full(3, 0.1), part)


def see(
    *found: LiftedDetection,
    occluded: float | list[float] = 0.0,
    free: float = 0.0,
    missing: float = 0.0,
    in_image: float = 1.0,
    log_ratio: float = 0.0,
    side: float = 100.0,
    templates: np.ndarray = WHOLE_ONLY,
    second: bool = False,
    config: EvidenceConfig = CONFIG,
) -> Looks:
    """One target in one view; every detection shows it. `free` is the share of what is not occluded."""
    hidden = np.broadcast_to(np.asarray(occluded, dtype=float), (1, 5))
    not_hidden = 1.0 - hidden
    visibility = Visibility(
        occluded=hidden,
        agreeing=not_hidden * (1.0 - free),
        free=not_hidden * free,
        missing=np.full((1, 5), missing),
        in_image=np.full((1, 5), in_image),
        pixels=np.array([side**2]),
        depth_log_ratio=np.full((1, 5), log_ratio),
    )
    detection_of = np.full((1, 5), -1)
    for i, d in enumerate(found):
        detection_of[0, d.part] = i
    box = np.array([[300.0, 200.0, 300.0 + side, 200.0 + side]])
    visible = visibility.visible
    targets = Targets(
        np.array([[0.0, 0.0, 2.0]]), 1e-3 * np.eye(3)[None], np.zeros((1, 3)), box, visible[:, 0], visible, box
    )
    args = targets, visibility, OPEN[None], templates, (MODEL, FREE, config)
    return take_looks(list(found), detection_of, np.array([second]), *args)


def chance(part: int, visible: float, side: float = 100.0) -> float:
    return float(MODEL.detection.relative(visible, side, part, OPEN))


# -- equation (4)


def test_weights_by_hand():
    visible = np.array([[0.8, 0.9, 0.7, 1.0, 0.6], [0.5, 0.9, 0.1, 0.5, 0.31], [0.3, 0.3, 0.29, 0.0, 0.1]])
    assert PART_VISIBLE == 0.3
    expected = np.array(
        [np.array([0.8, 0.9, 0.7, 1.0, 0.6]) / 4.0, np.array([0.5, 0.9, 0, 0.5, 0.31]) / 2.21, np.zeros(5)]
    )
    np.testing.assert_allclose(template_weights(visible, ALL), expected, atol=1e-12)


def test_a_detector_without_halves_has_one_expert():
    np.testing.assert_allclose(template_weights(np.full((1, 5), 0.4), WHOLE_ONLY), [[1.0, 0, 0, 0, 0]])
    np.testing.assert_allclose(template_weights(np.full((1, 5), 0.2), WHOLE_ONLY), np.zeros((1, 5)))


# -- hits and misses


def test_a_whole_detection_is_a_hit_and_none_is_a_miss():
    hit, miss = see(detection()), see()
    assert hit.detected[0] and hit.hits[0] == 1.0 and hit.misses[0] == 0.0
    assert not miss.detected[0] and miss.hits[0] == 0.0
    assert miss.misses[0] == pytest.approx(chance(WHOLE, 1.0)) and miss.misses[0] > 0.9


@pytest.mark.parametrize("occluded", [0.0, 0.3, 0.5, 0.65])
def test_a_miss_counts_as_far_as_it_should_have_been_found(occluded):
    assert see(occluded=occluded).misses[0] == pytest.approx(chance(WHOLE, 1.0 - occluded))
    assert see(occluded=occluded, side=12.0).misses[0] < 0.5 * see(occluded=occluded).misses[0] + 1e-9


@pytest.mark.parametrize("occluded", [0.75, 0.9, 1.0])
def test_what_is_hidden_is_not_missed(occluded):
    look = see(occluded=occluded)
    assert look.misses[0] == look.expected[0] == 0.0 and not look.detected[0]


def test_the_whole_is_missing_and_a_half_fires():
    """The share of the expected firing that came is the hit, the rest, times what was expected, the miss."""
    look = see(detection(TOP), templates=ALL)
    due = np.array([chance(part, 1.0) for part in range(5)]) / 5.0
    assert look.detected[0] and look.shown[0] == [0]
    assert look.hits[0] == pytest.approx(due[TOP] / due.sum())
    assert look.expected[0] == pytest.approx(due.sum())
    assert look.misses[0] == pytest.approx((1.0 - due[TOP] / due.sum()) * due.sum())


def test_hidden_halves_are_not_missed():
    """The lower half is behind something: the whole, the top and the sides could fire, and all of them did."""
    hidden = [0.5, 0.0, 1.0, 0.5, 0.5]
    found = [detection(part) for part in (WHOLE, TOP, LEFT, RIGHT)]
    look = see(*found, occluded=hidden, templates=ALL)
    assert look.hits[0] == pytest.approx(1.0) and look.misses[0] == pytest.approx(0.0)
    only_top = see(detection(TOP), occluded=[0.8, 0.0, 1.0, 0.8, 0.8], templates=ALL)
    assert only_top.hits[0] == pytest.approx(1.0)  # nothing else had to fire
    assert only_top.expected[0] == pytest.approx(chance(TOP, 1.0))


def test_halves_that_a_detector_does_not_have_are_not_missed():
    assert see(detection()).hits[0] == 1.0
    assert see(detection(), templates=ALL).hits[0] < 0.5


def test_a_second_box_on_it_is_a_detection_without_scores():
    look = see(second=True)
    assert look.detected[0] and look.hits[0] == 1.0 and look.shown == [[]] and look.scores == [None]
    one = see(detection(LEFT), templates=ALL, second=True)  # a box more than the one that is assigned says no more
    assert one.hits[0] == see(detection(LEFT), templates=ALL).hits[0]


def test_a_detection_of_what_nobody_expected_is_a_hit():
    look = see(detection(), occluded=0.95)
    assert look.detected[0] and look.hits[0] == 1.0 and look.misses[0] == 0.0
    assert look.scores == [None]  # whose scores they are is another question


def test_without_depth_readings_nobody_knows_what_was_hidden():
    assert see(missing=1.0).misses[0] == 0.0
    assert see(missing=0.4).misses[0] == pytest.approx(0.6 * see().misses[0])
    assert see(missing=1.0).seen[0] == 0.0


def test_switched_off_misses_say_nothing():
    look = see(config=replace(CONFIG, misses=False))
    assert look.expected[0] == look.misses[0] == 0.0


# -- geometry


def test_free_space_is_of_what_is_not_hidden_and_counts_as_much_as_shows():
    look = see(occluded=0.4, free=0.5, missing=0.2, in_image=0.9, log_ratio=-1.5)
    assert look.free_ratio[0] == pytest.approx(0.5)
    assert look.seen[0] == pytest.approx(0.6 * 0.8 * 0.9)
    assert look.free[0] == pytest.approx(look.seen[0] * FREE.log_likelihood(np.array([0.5]))[0])
    assert look.depth[0] == pytest.approx(-1.5 * look.seen[0])


def test_fully_hidden_or_switched_off_geometry_says_nothing():
    for look in (see(occluded=1.0, log_ratio=-1.0), see(free=0.9, log_ratio=-1.0, config=replace(CONFIG, depth=False))):
        assert look.seen[0] == look.free[0] == look.depth[0] == 0.0


# -- scores


def test_one_detection_s_scores_are_read_at_its_occlusion():
    look, expected = see(detection(), occluded=0.3), MODEL.scores.evidence(np.array(CUP), 0.3, WHOLE)
    assert look.scores[0] is not None
    np.testing.assert_allclose(look.scores[0].own, expected.own)
    np.testing.assert_allclose(look.scores[0].background, expected.background)


def test_the_mixture_of_scores_by_hand():
    """log Σ w_i p(score_i | k, v_i) over the templates that fired, each read at its own occlusion."""
    hidden = [0.4, 0.1, 0.6, 0.4, 0.4]
    look = see(detection(WHOLE, CUP), detection(TOP, BOWL), occluded=hidden, templates=ALL)
    w = np.array([0.6, 0.9]) / 1.5
    read = [MODEL.scores.evidence(np.array(CUP), 0.4, WHOLE), MODEL.scores.evidence(np.array(BOWL), 0.1, TOP)]
    assert look.scores[0] is not None and look.shown[0] == [1, 0]  # the one that weighs most first
    np.testing.assert_allclose(look.scores[0].own, np.log(w @ np.exp([r.own for r in read])))
    np.testing.assert_allclose(look.scores[0].background, np.log(w @ np.exp([r.background for r in read])))


def test_a_half_that_hardly_shows_has_no_vote():
    with_hidden = see(detection(WHOLE, CUP), detection(BOTTOM, BOWL), occluded=[0.4, 0, 0.8, 0.4, 0.4], templates=ALL)
    alone = see(detection(WHOLE, CUP), occluded=[0.4, 0, 0.8, 0.4, 0.4], templates=ALL)
    assert with_hidden.scores[0] is not None and alone.scores[0] is not None
    np.testing.assert_allclose(with_hidden.scores[0].own, alone.scores[0].own)
    assert with_hidden.shown[0] == [0, 1]


def test_what_the_image_border_cuts_off_hides_too():
    cut, hidden = see(detection(), in_image=0.6), see(detection(), occluded=0.4)
    assert cut.scores[0] is not None and hidden.scores[0] is not None
    np.testing.assert_allclose(cut.scores[0].own, hidden.scores[0].own)


# -- a look as the only one


def test_every_look_as_the_only_one():
    look = see(detection(), free=0.1, log_ratio=0.4)
    alone, read = look.evidence(np.array([0.5]), 3), look.scores[0]
    assert read is not None
    np.testing.assert_allclose(alone.own, 0.5 * read.own[None])
    np.testing.assert_allclose(alone.excess, 0.5 * (read.background - read.own)[None])
    assert (alone.hits[0], alone.misses[0], alone.score_views[0]) == (0.5, 0.0, 0.5)
    np.testing.assert_allclose([alone.free, alone.depth], 0.5 * np.array([look.free, look.depth]))
    assert alone.log_size.shape == (1, 4) and not alone.log_size.any()


def test_nothing_is_changed_that_belongs_to_others():
    """The assignment says -1 for a second box before and after."""
    detection_of, visible = np.full((1, 5), -1), np.ones((1, 5))
    zeros = np.zeros((1, 5))
    visibility = Visibility(zeros, visible, zeros, zeros, visible, np.array([1e4]))
    box = np.array([[300.0, 200.0, 400.0, 300.0]])
    targets = Targets(np.zeros((1, 3)), np.eye(3)[None], np.zeros((1, 3)), box, visible[:, 0])
    take_looks([], detection_of, np.array([True]), targets, visibility, OPEN[None], ALL, (MODEL, FREE, CONFIG))
    assert (detection_of == -1).all()


def test_columns_of_parts_are_the_same_everywhere():
    assert [int(part) for part in Part] == [int(part) for part in VolumePart]

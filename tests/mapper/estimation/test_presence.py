"""Whether a thing is still there: Page's cumulative sum over looks, compared with what is usual."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.free_space import FreeSpace
from thingmap.mapper.config import PresenceConfig
from thingmap.mapper.estimation.presence import Presence

CONFIG, FREE = PresenceConfig(), FreeSpace()
LEAST = 1.0 / (1.0 + CONFIG.hazard)  # probability before anything is seen
QUICK = settings(max_examples=40, deadline=None)
THROUGH = 0.9  # a free ratio where nothing is
LOOKS = st.lists(st.tuples(st.integers(0, 3), st.floats(0.0, 1.0), st.booleans()), max_size=15)


def make() -> Presence:
    return Presence(CONFIG, FREE)


def after(looks) -> Presence:
    presence = make()
    for cell, free, detected in looks:
        presence.look(cell, 1.0, free, 1.0, detected)
    return presence


def detected(cells: range, free: float = 0.1) -> Presence:
    return after((cell, free, True) for cell in cells)


def test_a_thing_is_there_until_something_says_otherwise():
    assert make().probability == pytest.approx(LEAST)


@given(looks=LOOKS, hidden=st.lists(st.tuples(st.integers(0, 5), st.floats(0.0, 1.0)), min_size=1, max_size=30))
@QUICK
def test_looks_at_what_is_hidden_change_nothing_however_many(looks, hidden):
    presence = after(looks)
    before = presence.probability
    for cell, free in hidden * 30:
        presence.look(cell, 1.0, free, 0.0, False)
    assert presence.probability == pytest.approx(before, rel=1e-3)


@given(looks=LOOKS)
@QUICK
def test_it_is_a_probability_and_a_detection_never_lowers_it(looks):
    presence = after(looks)
    before = presence.probability
    assert 0.0 <= before <= 1.0
    presence.look(0, 1.0, 0.5, 1.0, True)
    assert presence.probability >= before


def test_the_cumulative_sum_by_hand():
    """G <- max(G, log hazard) + l, from places that are all new; l is bounded by what one look can say."""
    presence = detected(range(4), free=0.1)
    usual = (2.0 * CONFIG.usual_free + 4 * 0.1) / 6.0
    gone = math.log(CONFIG.hazard) - CONFIG.detected
    for cell, free, weight, seen in ((4, 0.9, 1.0, 1.0), (5, 0.8, 0.5, 0.7), (6, 0.6, 1.0, 0.4), (7, 0.7, 0.3, 1.0)):
        presence.look(cell, weight, free, seen, False)
        said = FREE.removed(np.array([free]), np.array([usual]))[0]
        gone = max(gone, math.log(CONFIG.hazard)) + seen * weight * said
        assert presence.probability == pytest.approx(1.0 / (1.0 + math.exp(gone)))


def test_clear_looks_from_new_places_outweigh_any_number_of_detections():
    """What was found a hundred times and is gone now is as surely gone as what was found twice."""
    needed = {}
    for found in (2, 100):
        presence, needed[found] = detected(range(found)), 0
        while presence.probability > 0.5:
            presence.look(1000 + needed[found], 1.0, THROUGH, 1.0, False)
            needed[found] += 1
    assert needed[2] == needed[100] <= 8


def test_one_detection_brings_back_what_one_look_took():
    presence = detected(range(3))
    presence.look(3, 1.0, THROUGH, 1.0, False)
    lower = presence.probability
    presence.look(4, 1.0, 0.1, 1.0, True)
    assert lower < LEAST and presence.probability >= LEAST


def test_what_a_badly_placed_volume_shows_from_one_side_it_shows_for_ever():
    """Missed by the detector from a side where its volume is half free: one look's worth of doubt, and no more."""
    presence = detected(range(4))
    presence.look(9, 1.0, 0.6, 1.0, False)
    once = presence.probability
    for _ in range(1000):
        presence.look(9, 0.01, 0.6, 1.0, False)
    assert presence.probability >= once - 1e-9


def test_what_detections_show_free_is_usual():
    """A chair is seen through in half of its pixels and found all the same."""
    presence = detected(range(6), free=0.5)
    for cell in (0, 1, 20, 21):
        for _ in range(200):
            presence.look(cell, 1.0, 0.5, 1.0, False)
    assert presence.probability > 0.5


def test_a_change_from_the_same_place_is_news():
    """A still camera: the volume was filled and is empty now."""
    presence = after([(0, 0.1, True)] * 50)
    for _ in range(10):
        presence.look(0, 0.01, THROUGH, 1.0, False)
    assert presence.probability < 0.02


def test_a_change_is_news_too_where_it_was_never_detected():
    presence = detected(range(4))
    for _ in range(50):
        presence.look(9, 0.01, 0.1, 1.0, False)
    for _ in range(10):
        presence.look(9, 0.01, THROUGH, 1.0, False)
    assert presence.probability < 0.02


def test_what_is_gone_does_not_come_back_by_standing_still_before_its_place():
    """Looks through an empty volume from one new place: the second and later ones are no sign that it is there."""
    presence = detected(range(4))
    presence.look(9, 1.0, THROUGH, 1.0, False)
    once = presence.probability
    for _ in range(20):
        presence.look(9, 0.01, THROUGH, 1.0, False)
    assert presence.probability <= once + 1e-9


def test_merged_landmarks_are_there_if_either_is_and_share_what_is_usual():
    gone, there = detected(range(4)), detected(range(10, 14), free=0.5)
    for cell in range(20, 30):
        gone.look(cell, 1.0, THROUGH, 1.0, False)
    assert gone.probability < 0.02
    before = there.probability
    gone.absorb(there)
    assert gone.probability == pytest.approx(before)
    both = after([(cell, 0.1, True) for cell in range(4)] + [(cell, 0.5, True) for cell in range(10, 14)])
    for presence in (gone, both):
        presence.look(50, 1.0, 0.7, 1.0, False)
    assert gone.probability == pytest.approx(both.probability, rel=1e-3)


def test_nothing_overflows():
    presence = detected(range(2))
    for cell in range(5000):
        presence.look(10 + cell, 1.0, 1.0, 1.0, False)
    assert presence.probability < 1e-300

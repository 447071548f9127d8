"""What is kept of the views of a landmark, and what is only counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper.estimation.view_log import FAINT, REPEATED, Verdict, ViewLog, ViewNote


def note(keyframe: int, verdict: Verdict = Verdict.SUPPORTED, ratio: float = 1.0, weight: float = 1.0) -> ViewNote:
    found = verdict is Verdict.SUPPORTED
    return ViewNote(
        keyframe=keyframe,
        stamp=0.1 * keyframe,
        frame=f"frame-{keyframe:06d}",
        visible=np.full(5, 0.8),
        score=0.9 if found else np.nan,
        part=0 if found else -1,
        class_id=1 if found else -1,
        log_ratio=np.array([0.0, ratio]),
        weight=weight,
        verdict=verdict,
    )


def hidden(keyframe: int) -> ViewNote:
    return note(keyframe, Verdict.OCCLUDED, 0.0)


def test_notes_come_by_keyframe_whatever_they_said():
    log = ViewLog()
    for n in (note(5), hidden(2), note(9, Verdict.MISSED, -1.0), note(1)):
        log.append(n)
    assert [n.keyframe for n in log] == [1, 2, 5, 9]
    assert len(log) == 4 and log.left_out == 0


def test_a_thousand_hidden_views_take_the_room_of_a_few_and_are_counted():
    log = ViewLog(keep_silent=20)
    log.append(note(0))
    for keyframe in range(1, 1001):
        log.append(hidden(keyframe))
    assert len(log) == 21 and log.left_out == 980
    assert [n.keyframe for n in log] == [0, *range(981, 1001)]  # the latest, and the one that said something
    assert log.counts()[Verdict.OCCLUDED] == 1000 and log.counts()[Verdict.SUPPORTED] == 1
    assert log.left_out_by == {**dict.fromkeys(Verdict, 0), Verdict.OCCLUDED: 980}


@pytest.mark.parametrize(
    ("verdict", "ratio", "weight", "silent"),
    [
        (Verdict.OCCLUDED, 0.0, 1.0, True),
        (Verdict.UNCLEAR, 0.9 * FAINT, 1.0, True),
        (Verdict.UNCLEAR, -2.0 * FAINT, 1.0, False),  # it moved a probability
        (Verdict.SUPPORTED, 0.9 * FAINT, 0.9 * REPEATED, True),
        (Verdict.SUPPORTED, 0.9 * FAINT, 1.0, False),
        (Verdict.SUPPORTED, -2.0 * FAINT, 0.0, False),
        (Verdict.MISSED, 0.0, 1.0, False),
        (Verdict.SEEN_THROUGH, 0.0, 0.0, True),
    ],
)
def test_what_says_nothing(verdict, ratio, weight, silent):
    assert note(1, verdict, ratio, weight).said_nothing is silent
    log = ViewLog(keep_silent=0)
    log.append(note(1, verdict, ratio, weight))
    assert (len(log), log.left_out) == ((0, 1) if silent else (1, 0))
    assert log.counts()[verdict] == 1


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0), (1, 0, 2)])
def test_of_one_keyframe_the_note_that_supports_stays(order):
    notes = note(4), note(4, Verdict.SEEN_THROUGH, -3.0), hidden(4)
    log = ViewLog()
    for index in order:
        log.append(notes[index])
    assert [n.verdict for n in log] == [Verdict.SUPPORTED]
    log = ViewLog()
    for index in (i for i in order if i != 0):
        log.append(notes[index])
    assert [n.verdict for n in log] == [Verdict.SEEN_THROUGH]


def test_a_merged_landmark_s_views_are_taken_over_once():
    kept, absorbed = ViewLog(keep_silent=2), ViewLog(keep_silent=2)
    for keyframe in range(6):
        kept.append(hidden(keyframe))  # 0..3 left out
        absorbed.append(hidden(keyframe + 2) if keyframe != 5 else note(1))  # 2..4 left out
    kept.absorb(absorbed)
    assert [n.keyframe for n in kept] == [1, 5, 6]
    assert kept.counts() == {**dict.fromkeys(Verdict, 0), Verdict.SUPPORTED: 1, Verdict.OCCLUDED: 6}
    assert [n.keyframe for n in absorbed] == [1, 5, 6]  # untouched


@settings(deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(st.integers(0, 12), st.sampled_from(Verdict), st.floats(-1.0, 1.0), st.floats(0.0, 1.0))),
    st.lists(st.tuples(st.integers(0, 12), st.sampled_from(Verdict), st.floats(-1.0, 1.0), st.floats(0.0, 1.0))),
    st.integers(0, 3),
)
def test_every_keyframe_counts_once_and_none_is_forgotten(mine, others, keep):
    log, other = ViewLog(keep), ViewLog(keep)
    for target, values in ((log, mine), (other, others)):
        for value in values:
            target.append(note(*value))
    log.absorb(other)
    keyframes = {value[0] for value in (*mine, *others)}
    assert sum(log.counts().values()) == len(log) + log.left_out == len(keyframes)
    assert sum(n.said_nothing for n in log) <= keep
    loud = {value[0] for value in (*mine, *others) if value[1] is Verdict.SUPPORTED and not note(*value).said_nothing}
    assert loud <= {n.keyframe for n in log if n.verdict is Verdict.SUPPORTED}


def test_notes_are_read_only_copies_and_refuse_what_is_no_number():
    ratios = np.array([1.0, 2.0])
    one = replace(note(1), log_ratio=ratios)
    ratios[0] = 9.0
    assert one.log_ratio.dtype == np.float32 and one.log_ratio[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        one.log_ratio[0] = 5.0
    with pytest.raises(ValueError, match=r"visible must have shape \(5,\), but got \(4,\)"):
        replace(one, visible=np.zeros(4))
    with pytest.raises(ValueError, match="log_ratio must be numbers"):
        replace(one, log_ratio=np.array([np.nan, 0.0]))

import threading
import time

import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame, FrameProblem
from thingmap.mapper.read_ahead import ReadAhead
from thingmap.mapper.run_report import StageTime
from thingmap.mapper.runner import SequenceRun, run_sequence


def test_every_frame_is_mapped_once_and_in_order(tiny_sequence, fake_mapper):
    sequence, mapper = tiny_sequence(20), fake_mapper()
    report = run_sequence(sequence, mapper)
    assert mapper.frames == list(range(20))
    assert sequence.read == list(range(20))
    assert (report.frames_total, report.frames_used, report.keyframes, report.things) == (20, 20, 10, 20)
    assert report.stopped is None and report.frames_skipped == 0
    assert report.seconds > 0.0


def test_broken_frames_are_skipped_counted_and_named(tiny_sequence, fake_mapper):
    mapper, seen = fake_mapper(), []
    report = run_sequence(tiny_sequence(6, broken=(0, 3)), mapper, on_update=seen.append)
    assert mapper.frames == [1, 2, 4, 5]
    assert report.skipped == {"unreadable image": ("frame-000000 (truncated)", "frame-000003 (truncated)")}
    assert report.frames_skipped == 2 and report.frames_used == 4
    assert [(now.done, now.skipped, now.things) for now in seen] == [
        *((1, 1, 0), (2, 1, 1), (3, 1, 2), (4, 2, 2), (5, 2, 3), (6, 2, 4))
    ]
    assert [now.update is None for now in seen] == [True, False, False, True, False, False]
    assert all(now.total == 6 for now in seen)


def test_frames_that_the_mapper_cannot_use_are_skipped_too(tiny_sequence, fake_mapper):
    unusable = BrokenFrame("frame-000002", FrameProblem.NO_DEPTH)
    report = run_sequence(tiny_sequence(4), fake_mapper(fail_at=2, error=unusable))
    assert report.frames_used == 3 and report.stopped is None
    assert report.skipped == {"no valid depth": ("frame-000002",)}


def test_nothing_but_broken_frames_is_a_users_mistake(tiny_sequence, fake_mapper):
    with pytest.raises(UserError, match=r"none of the 3 frames can be used: 3 with unreadable image.*frame-000000"):
        run_sequence(tiny_sequence(3, broken=(0, 1, 2)), fake_mapper())
    with pytest.raises(UserError, match="the sequence has no frames"):
        run_sequence(tiny_sequence(0), fake_mapper())


def test_ctrl_c_in_the_mapper_keeps_what_is_mapped(tiny_sequence, fake_mapper):
    mapper = fake_mapper(fail_at=3, error=KeyboardInterrupt())
    report = run_sequence(tiny_sequence(6), mapper)
    assert mapper.frames == [0, 1, 2]
    assert report.stopped == "interrupted at frame 3"
    assert report.frames_used == 3


def test_being_asked_to_stop_ends_between_two_frames(tiny_sequence, fake_mapper):
    mapper = fake_mapper()
    report = SequenceRun(tiny_sequence(6), mapper, should_stop=lambda: len(mapper.frames) == 2).execute()
    assert mapper.frames == [0, 1]
    assert report.stopped == "interrupted at frame 2"


def test_a_failure_of_the_mapper_is_raised_and_the_report_says_where(tiny_sequence, fake_mapper):
    failure = RuntimeError("singular")
    run = SequenceRun(tiny_sequence(6), fake_mapper(fail_at=4, error=failure))
    with pytest.raises(RuntimeError) as caught:
        run.execute()
    assert caught.value is failure
    assert run.report.stopped == "RuntimeError at frame 4: singular"
    assert run.report.frames_used == 4


def test_a_failure_of_the_sequence_comes_after_the_frames_before_it(tiny_sequence, fake_mapper):
    mapper = fake_mapper()
    run = SequenceRun(tiny_sequence(6, failing=(2,)), mapper)
    with pytest.raises(ValueError, match="disk gone at 2"):
        run.execute()
    assert mapper.frames == [0, 1]
    assert run.report.stopped == "ValueError at frame 2: disk gone at 2"


def test_reading_stays_a_few_frames_ahead(tiny_sequence):
    sequence = tiny_sequence(100)
    with ReadAhead(sequence, ahead=4) as readings:
        first = next(iter(readings))
        deadline = time.monotonic() + 2.0
        while len(sequence.read) < 6 and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(0.05)
        assert first.position == 0
        assert len(sequence.read) == 6  # the one taken, four in the queue, one in the reader's hand
    assert not any(thread.name == "read-ahead" for thread in threading.enumerate())


def test_reading_and_mapping_are_timed_apart(tiny_sequence, fake_mapper):
    class Slow(fake_mapper):
        def process_frame(self, frame, detections=None):
            time.sleep(0.01)
            return super().process_frame(frame, detections)

    report = run_sequence(tiny_sequence(5, broken=(1,)), Slow())
    assert report.stages["mapping"].total_ms >= 40.0
    assert report.stages["mapping"].median_ms >= 10.0
    assert report.stages["reading"].total_ms < report.stages["mapping"].total_ms
    assert report.frames_per_second <= 100.0


def test_the_report_as_json(tiny_sequence, fake_mapper):
    document = run_sequence(tiny_sequence(4, broken=(1,)), fake_mapper()).to_dict()
    assert document["skipped"] == {"unreadable image": ["frame-000001 (truncated)"]}
    assert document["frames_used"] == 3 and document["frames_skipped"] == 1 and document["source"] == "tiny"
    assert set(document["stages"]) == {"reading", "mapping"}
    assert document["peak_memory_mb"] is None or 10.0 < document["peak_memory_mb"] < 1e5


def test_stage_times():
    assert StageTime.of([1.0, 2.0, 6.0]) == StageTime(3.0, 2.0, pytest.approx(5.6), 9.0)
    assert StageTime.of([]).total_ms == 0.0

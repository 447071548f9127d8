"""Work that can wait: when its results come, and what becomes of it when the other process fails."""

from __future__ import annotations

import io
import os
import pickle
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper import deferred_worker
from thingmap.mapper.deferred import Deferred
from thingmap.mapper.deferred_process import read_message, write_message
from thingmap.mapper.deferred_worker import end_workers, worker_for


@pytest.fixture(scope="module")
def jobs() -> Iterator[ModuleType]:
    """The module `deferred_jobs`, which another process finds by the search path of this one."""
    folder = str(Path(__file__).parent)
    sys.path.append(folder)
    import deferred_jobs

    yield deferred_jobs
    end_workers()
    sys.path.remove(folder)


@pytest.mark.parametrize("parallel", [True, False])
def test_results_come_in_order_a_lag_later_and_once(jobs, parallel):
    deferred = Deferred(jobs.slow_square, lag=2, parallel=parallel)
    came = []
    for turn in range(6):
        deferred.submit(turn, float(turn))
        came.append(deferred.due(turn))
        assert deferred.due(turn) == []
        assert deferred.pending == min(turn + 1, 2)
    assert came == [[], [], [0.0], [1.0], [4.0], [9.0]]
    assert deferred.drain() == [16.0, 25.0]
    assert (deferred.drain(), deferred.pending) == ([], 0)
    done = deferred.statistics
    assert (done.done_there, done.done_here) == ((6, 0) if parallel else (0, 6))
    assert (done.waited_ms > 0.0) == parallel  # this loop has no work of its own to hide the other's behind


@settings(max_examples=40, deadline=None)
@given(
    steps=st.lists(st.tuples(st.integers(0, 3), st.sampled_from(["submit", "due", "both"])), max_size=12),
    lag=st.integers(0, 4),
)
def test_with_and_without_the_other_process_everything_comes_alike(jobs, steps, lag):
    def run(parallel: bool) -> list[list[float]]:
        deferred, turn, came = Deferred(jobs.square, lag, parallel), 0, []
        for number, (step, what) in enumerate(steps):
            turn += step
            if what != "due":
                deferred.submit(turn, number + 0.5)
            if what != "submit":
                came.append(deferred.due(turn))
        return [*came, deferred.drain()]

    there, here = run(True), run(False)
    assert there == here
    submitted = [number + 0.5 for number, (_, what) in enumerate(steps) if what != "due"]
    assert [result for some in there for result in some] == [value**2 for value in submitted]


def test_the_work_is_done_elsewhere_by_one_process_for_each_function(jobs):
    first, second, other = (Deferred(f, lag=1) for f in (jobs.where, jobs.where, jobs.also_where))
    for turn in range(3):
        for deferred in (first, second, other):
            deferred.submit(turn, None)
    pids = [{pid for pid, _ in deferred.drain()} for deferred in (first, second, other)]
    assert pids[0] == pids[1] != pids[2]
    assert all(len(some) == 1 and os.getpid() not in some for some in pids)


def test_two_objects_get_their_own_results(jobs):
    one, two = Deferred(jobs.square, lag=3), Deferred(jobs.square, lag=0)
    for turn in range(4):
        one.submit(turn, turn + 1.0)
        two.submit(turn, -10.0 * turn)
        assert two.due(turn) == [100.0 * turn**2]
    assert one.due(3) == [1.0]
    assert one.drain() == [4.0, 9.0, 16.0]


def test_nothing_is_started_before_the_first_job(jobs, monkeypatch):
    monkeypatch.setattr(deferred_worker, "_workers", started := {})
    deferred = Deferred(jobs.square, lag=1)
    assert deferred.due(5) == deferred.drain() == []
    assert not started
    here = Deferred(jobs.square, lag=0, parallel=False)
    here.submit(0, 2.0)
    assert here.due(0) == [4.0]
    assert not started


def test_big_jobs_fill_no_pipe(jobs):
    deferred = Deferred(jobs.doubled, lag=20)
    images = np.random.default_rng(0).random((20, 128, 1024))  # 1 MB each
    deferred.submit(0, images[0])
    deferred.drain()  # the process has started
    start = time.perf_counter()
    for image in images:
        deferred.submit(1, image)
    handed_over = time.perf_counter() - start
    results = deferred.drain()
    taken = time.perf_counter() - start
    assert taken >= 20 * 0.02
    assert handed_over < 0.5 * taken  # nobody waited for the process, although 20 MB fit in no pipe
    np.testing.assert_array_equal(results, 2.0 * images)


@pytest.mark.parametrize("parallel", [True, False])
def test_a_job_is_taken_as_it_was_when_submitted(jobs, parallel):
    deferred = Deferred(jobs.spoil, lag=1, parallel=parallel)
    job = [7]
    deferred.submit(0, job)
    job.clear()
    deferred.submit(1, job)
    assert deferred.drain() == [[7, 1], [0]]
    assert job == []


@pytest.mark.parametrize("parallel", [True, False])
def test_an_exception_is_raised_at_its_turn_and_no_other_result_is_lost(jobs, parallel):
    deferred = Deferred(jobs.root, lag=1, parallel=parallel)
    for value in (4.0, -1.0, 9.0):
        deferred.submit(0, value)
    assert deferred.due(0) == []
    with pytest.raises(ValueError, match=r"no root of -1\.0") as caught:
        deferred.due(1)
    told = "".join(getattr(caught.value, "__notes__", [])) if parallel else str(caught.traceback[-1])
    assert "deferred_jobs.py" in told and "root" in told
    assert deferred.due(1) == [2.0, 3.0]
    assert deferred.pending == 0


def test_an_exception_that_cannot_travel_arrives_as_its_text(jobs):
    deferred = Deferred(jobs.lose, lag=0)
    deferred.submit(0, "gone")
    with pytest.raises(RuntimeError, match="Unpicklable: gone"):
        deferred.due(0)


def test_what_a_function_prints_does_not_disturb(jobs, capfd):
    deferred = Deferred(jobs.chatter, lag=0)
    for turn in range(3):
        deferred.submit(turn, f"hello {turn}")
    assert deferred.drain() == ["hello 0", "hello 1", "hello 2"]
    assert capfd.readouterr().out == ""


def test_when_the_process_dies_its_jobs_are_done_here_and_that_is_said_once(jobs):
    first, second = Deferred(jobs.die_at, lag=3), Deferred(jobs.die_at, lag=3)
    came: list[int] = []
    with pytest.warns(RuntimeWarning) as told:
        for turn in range(12):
            for deferred in (first, second):
                deferred.submit(turn, (turn, 5, os.getpid()))
                came += deferred.due(turn)
        came += first.drain() + second.drain()
    assert came == [*np.repeat(np.arange(9), 2), 9, 10, 11, 9, 10, 11]
    assert len(told) == 1
    assert all(part in str(told[0].message) for part in ("deferred_jobs.die_at", "-9", "cannot bear it"))
    assert told[0].filename == __file__
    for done in (first.statistics, second.statistics):
        assert done.done_there >= 5 and done.done_here >= 3
        assert done.done_there + done.done_here == 12
    assert first.statistics.done_there + second.statistics.done_there == 10  # both up to the fatal one


def test_when_the_process_is_killed_from_outside_nothing_is_lost(jobs):
    deferred = Deferred(jobs.nap_alone, lag=2)
    for turn in range(3):
        deferred.submit(turn, 0.2)
    os.kill(worker_for(jobs.nap_alone).pid, 9)
    with pytest.warns(RuntimeWarning, match="exit code -9"):
        assert deferred.drain() == [os.getpid()] * 3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        deferred.submit(3, 0.0)
        assert deferred.drain() == [os.getpid()]


@pytest.mark.parametrize("program", ["/nowhere/python", "/bin/echo", ""])
def test_without_another_process_the_work_is_done_here(jobs, monkeypatch, program):
    monkeypatch.setattr(deferred_worker, "_workers", {})
    monkeypatch.setattr(sys, "executable", program)
    monkeypatch.setenv("PATH", "")
    deferred = Deferred(jobs.square, lag=1)
    deferred.submit(0, 3.0)
    with pytest.warns(RuntimeWarning, match=r"deferred_jobs\.square is gone"):
        assert deferred.due(1) == [9.0]
    assert deferred.statistics.done_here == 1


def test_an_interrupt_while_waiting_loses_nothing(jobs, monkeypatch):
    deferred = Deferred(jobs.slow_square, lag=1)
    deferred.submit(0, 2.0)
    deferred.submit(1, 3.0)

    def interrupted(*_: object) -> bytes:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(deferred_worker.Worker, "wait_for", interrupted)
        with pytest.raises(KeyboardInterrupt):
            deferred.drain()
    assert deferred.drain() == [4.0, 9.0]


def test_libraries_have_one_thread_there(jobs):
    deferred = Deferred(jobs.threads, lag=0)
    deferred.submit(0, None)
    assert deferred.due(0) == [(1, 1)]


def test_messages_are_told_from_anything_else():
    stream = io.BytesIO()
    for number, payload in enumerate((b"", b"job", bytes(70000))):
        write_message(stream, number, payload)
    whole = stream.getvalue()
    stream.seek(0)
    assert [read_message(stream) for _ in range(4)] == [(0, b""), (1, b"job"), (2, bytes(70000)), None]
    for cut in (1, 19, 50, len(whole) - 1):
        stream = io.BytesIO(whole[:cut])
        with pytest.raises(EOFError, match="ends within"):
            while read_message(stream) is not None:
                pass
    with pytest.raises(ValueError, match="expected a message"):
        read_message(io.BytesIO(b"Welcome to some other program"))


def test_what_was_not_fetched_is_counted_at_the_end(jobs):
    deferred = Deferred(jobs.square, lag=5)
    deferred.submit(0, 1.0)
    deferred.submit(0, 2.0)
    deferred.close()
    assert (deferred.statistics.discarded, deferred.pending, deferred.drain()) == (2, 0, [])
    with pytest.raises(RuntimeError, match="after close"):
        deferred.submit(1, 1.0)


def test_what_cannot_work_is_refused_at_once(jobs):
    for function in (lambda value: value, np.random.default_rng(0).random):
        with pytest.raises(ValueError, match="found by its name"):
            Deferred(function, lag=1)
    with pytest.raises(ValueError, match="lag"):
        Deferred(jobs.square, lag=-1)
    deferred = Deferred(jobs.square, lag=1)
    deferred.submit(3, 1.0)
    with pytest.raises(ValueError, match="2 after 3"):
        deferred.submit(2, 1.0)
    with pytest.raises((pickle.PicklingError, AttributeError)):
        deferred.submit(3, lambda: 1)
    assert deferred.drain() == [1.0]

"""Deferred work in whole programs: scripts without a guard, Ctrl-C, and processes that must not outlive them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals and process groups are those of POSIX")

LIMIT = 60.0  # s, in which any program here ends

PREFACE = f"""
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # whoever runs the tests may have it ignored
sys.path.append({str(Path(__file__).parent)!r})
import deferred_jobs
from thingmap.mapper.deferred import Deferred
"""


def start(script: Path, text: str) -> subprocess.Popen[str]:
    script.write_text(PREFACE + text)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    program = subprocess.Popen([sys.executable, str(script)], start_new_session=True, **pipes)
    late = threading.Timer(LIMIT, program.kill)  # a program that hangs fails its test, and no more
    late.daemon = True
    late.start()
    return program


def is_gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except ProcessLookupError:
        return True
    except FileNotFoundError:  # gone just now, or a system without /proc, where the next look tells
        return False
    return state == "Z"  # an orphan that has ended, and waits for somebody to ask how


def test_a_script_without_a_guard_runs_once_and_leaves_nothing_behind(tmp_path):
    program = start(
        tmp_path / "script.py",
        """
print("begins")
deferred = Deferred(deferred_jobs.where, lag=1)
deferred.submit(0, None)
print(deferred.due(1)[0][0])
deferred.submit(2, None)
""",
    )
    out, err = program.communicate(timeout=30)
    assert (program.returncode, err) == (0, "")
    begins, pid = out.split()
    assert begins == "begins" and int(pid) != program.pid
    assert is_gone(int(pid))


def test_a_job_that_nobody_waits_for_does_not_hold_up_the_exit(tmp_path):
    program = start(
        tmp_path / "script.py",
        """
deferred = Deferred(deferred_jobs.nap, lag=1)
deferred.submit(0, 0.0)
print(deferred.drain()[0])
for _ in range(100):
    deferred.submit(1, 60.0)
""",
    )
    out, err = program.communicate(timeout=20)
    assert (program.returncode, err) == (0, "")
    assert is_gone(int(out))


def test_the_process_ends_when_its_parent_is_killed_in_the_middle_of_a_job(tmp_path):
    program = start(
        tmp_path / "script.py",
        """
deferred = Deferred(deferred_jobs.nap, lag=1)
deferred.submit(0, 0.0)
print(deferred.drain()[0], flush=True)
deferred.submit(1, 60.0)
time.sleep(60)
""",
    )
    assert program.stdout is not None
    pid = int(program.stdout.readline())
    program.kill()
    program.communicate()
    end = time.monotonic() + 5.0
    while not is_gone(pid):
        assert time.monotonic() < end
        time.sleep(0.02)


def test_ctrl_c_stops_the_parent_only_and_its_work_is_finished(tmp_path):
    started, go = tmp_path / "started", tmp_path / "go"
    program = start(
        tmp_path / "script.py",
        f"""
import os
deferred = Deferred(deferred_jobs.wait_for_file, lag=1)
deferred.submit(0, ({str(started)!r}, {str(go)!r}))
try:
    print("waiting", flush=True)
    deferred.due(1)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    print(deferred.drain()[0], deferred.statistics.done_here)
""",
    )
    assert program.stdout is not None and program.stdout.readline() == "waiting\n"
    end = time.monotonic() + 20.0
    while not started.exists():
        assert time.monotonic() < end
        time.sleep(0.01)
    os.killpg(program.pid, signal.SIGINT)
    assert program.stdout.readline() == "interrupted\n"
    part = tmp_path / "part"
    part.write_text("done")
    part.rename(go)
    out, err = program.communicate(timeout=20)
    assert (program.returncode, out, err) == (0, "done 0\n", "")


def test_a_function_of_the_script_itself_is_refused(tmp_path):
    program = start(tmp_path / "script.py", "def mine(job): return job\nDeferred(mine, lag=1)\n")
    _, err = program.communicate(timeout=20)
    assert program.returncode == 1 and "in a module that another process can import" in err


def test_a_forked_process_has_its_own(tmp_path):
    program = start(
        tmp_path / "script.py",
        """
import os, warnings
deferred = Deferred(deferred_jobs.where, lag=1)
deferred.submit(0, None)
[(first, _)] = deferred.drain()
deferred.submit(1, None)
if os.fork() == 0:
    [(before, _)] = deferred.drain()
    deferred.submit(2, None)
    [(after, _)] = deferred.drain()
    print(before == os.getpid(), after not in (first, os.getpid()), flush=True)
    sys.exit(0)
os.wait()
print(deferred.drain()[0][0] == first)
""",
    )
    out, err = program.communicate(timeout=30)
    assert (program.returncode, out.split(), err) == (0, ["True", "True", "True"], "")

"""Where the live view goes, what cannot be, and what becomes of a run whose viewer goes away."""

from __future__ import annotations

import builtins
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rerun_reading import Recorded

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.cli.main import app
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.view import live_targets
from thingmap.mapper.view.live_targets import BESIDE_PYTHON, LOCAL, LiveTargets
from thingmap.mapper.view.rerun_file import export_rrd

SMALL = "sample:tabletop?frames=12&width=320"


def thingmap(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


@pytest.fixture
def without_rerun(monkeypatch):
    real = builtins.__import__

    def missing(name, *args, **kwargs):
        if name.split(".")[0] == "rerun":
            raise ModuleNotFoundError("No module named 'rerun'")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", missing)


def test_a_missing_package_is_one_line_that_names_the_extra(without_rerun, tmp_path):
    result = thingmap("run", SMALL, "-o", tmp_path / "out", "--save", tmp_path / "run.rrd")
    assert result.exit_code == 2
    lines = result.output.strip().splitlines()
    assert len(lines) == 1 and 'pip install "' in lines[0] and '[view]"' in lines[0]
    assert not (tmp_path / "out").exists()


def test_nothing_imports_rerun_unless_asked():
    modules = ("mapper", "runner", "cli.run", "cli.job", "cli.live", "view.live", "view.live_targets")
    code = "import sys, " + ", ".join(f"thingmap.mapper.{module}" for module in modules)
    check = "; assert not [m for m in sys.modules if m.split('.')[0] == 'rerun']"
    subprocess.run([sys.executable, "-c", code + check], check=True)


def test_a_window_needs_a_display(monkeypatch, tmp_path):
    pytest.importorskip("rerun")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    result = thingmap("run", SMALL, "-o", tmp_path / "out", "--view")
    assert result.exit_code == 2 and "--serve 9090" in result.output and "--save" in result.output
    assert not (tmp_path / "out").exists()
    monkeypatch.setenv("DISPLAY", ":0")
    LiveTargets(window=True).check()


def test_mistakes_are_told_before_anything_is_made(tmp_path):
    pytest.importorskip("rerun")
    with pytest.raises(InputError, match=r"ending in \.rrd"):
        LiveTargets(file=tmp_path / "run.bin").check()
    old = tmp_path / "old.rrd"
    old.write_bytes(b"mine")
    with pytest.raises(InputError, match="--overwrite"):
        LiveTargets(file=old).check()
    LiveTargets(file=old, overwrite=True).check()
    assert old.read_bytes() == b"mine"
    with pytest.raises(UserError, match="leave out one"):
        LiveTargets(window=True, port=9090).check()
    with socket.socket() as taken:
        taken.bind((LOCAL, 0))
        taken.listen()
        with pytest.raises(UserError, match="choose another"):
            LiveTargets(port=taken.getsockname()[1]).check()


def test_a_run_is_saved_beside_its_map(tmp_path):
    pytest.importorskip("rerun")
    file = tmp_path / "out" / "run.rrd"
    result = thingmap("run", SMALL, "-o", tmp_path / "out", "--save", file)
    assert result.exit_code == 0, result.output
    assert f"rerun {file}" in " ".join(result.output.split())
    recorded, object_map = Recorded(file), ObjectMap.load(tmp_path / "out")
    assert len(recorded.latest("world/things", "Boxes3D:centers")) == len(object_map)
    # and the finished map on its own
    count = export_rrd(OutputFolder.open(tmp_path / "out"), tmp_path / "map.rrd")
    whole = Recorded(tmp_path / "map.rrd")
    assert count == len(object_map) == len(whole.latest("world/things", "Boxes3D:centers"))
    cloud, _ = OutputFolder.open(tmp_path / "out").read_cloud()
    assert len(whole.latest("world/cloud", "Points3D:positions")) == len(cloud)
    assert sum(len(strip) for strip in whole.latest("world/path/0000", "LineStrips3D:strips")) == 12
    assert whole.timelines == set() and len(whole.layouts) == 1


def free_port() -> int:
    with socket.socket() as free:
        free.bind((LOCAL, 0))
        return free.getsockname()[1]


def start_viewer(port: int) -> subprocess.Popen:
    """What a window is to a mapper, without a screen."""
    command = [str(BESIDE_PYTHON), "--serve-grpc", "--bind", LOCAL, "--port", str(port)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    viewer = subprocess.Popen(command, start_new_session=True, **quiet)
    assert is_listening(port, until=True)
    return viewer


def end(viewer: subprocess.Popen) -> None:
    """`rerun` is a script that starts the program: both have to end."""
    with suppress(ProcessLookupError):
        os.killpg(viewer.pid, signal.SIGKILL)
    viewer.wait()


def is_listening(port: int, until: bool) -> bool:
    """Whether somebody listens, after a while in which it may become as expected."""
    for _ in range(100):
        with socket.socket() as probe:
            if (probe.connect_ex((LOCAL, port)) == 0) is until:
                return until
        time.sleep(0.1)
    return not until


HANGING = """
import os, signal, subprocess, sys, time
import rerun as rr
from thingmap.mapper.view.live import leave
from thingmap.mapper.view.rerun_package import new_recording

recording = new_recording("hanging")
recording.set_sinks(rr.GrpcSink("rerun+http://127.0.0.1:" + sys.argv[1] + "/proxy"))
recording.log("a", rr.Scalars(1.0))
recording.flush(timeout_sec=20.0)
os.killpg(int(sys.argv[2]), signal.SIGSTOP)
for _ in range(20):
    recording.log("a", rr.Points3D([[0.0, 0.0, 0.0]] * 100_000))
start = time.monotonic()
leave(recording, seconds=1.0)
print(time.monotonic() - start)
"""


def test_a_viewer_that_hangs_does_not_hold_up_the_end(tmp_path):
    pytest.importorskip("rerun")
    if not BESIDE_PYTHON.is_file():
        pytest.skip("rerun's viewer is not beside this Python")
    port = free_port()
    viewer = start_viewer(port)
    try:
        command = [sys.executable, "-c", HANGING, str(port), str(viewer.pid)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    finally:
        end(viewer)
    assert done.returncode == 0, done.stderr
    assert 0.9 < float(done.stdout) < 10.0  # it did hang, and was left


def test_a_viewer_that_is_closed_does_not_stop_mapping(monkeypatch, tmp_path):
    rr = pytest.importorskip("rerun")
    if not BESIDE_PYTHON.is_file():
        pytest.skip("rerun's viewer is not beside this Python")
    port = free_port()
    viewers: list[subprocess.Popen] = []
    listening: list[bool] = []  # after it was closed

    def spawn(**_: object) -> None:  # as the window does, without a screen
        viewers.append(start_viewer(port))

    from thingmap.mapper.view.live import LiveView

    draw = LiveView.__call__

    def close_at_the_fourth_frame(view, now):
        if now.done == 4:
            end(viewers[0])
            listening.append(is_listening(port, until=False))
        draw(view, now)

    monkeypatch.setattr(live_targets, "WINDOW_PORT", port)
    monkeypatch.setattr(rr, "spawn", spawn)
    monkeypatch.setattr(LiveView, "__call__", close_at_the_fourth_frame)
    monkeypatch.setenv("DISPLAY", ":0")
    try:
        result = thingmap("run", SMALL, "-o", tmp_path / "seen", "--view", "--save", tmp_path / "run.rrd")
    finally:
        for viewer in viewers:
            end(viewer)
    assert result.exit_code == 0, result.output
    assert len(viewers) == 1 and listening == [False]
    frames = Recorded(tmp_path / "run.rrd").rows("world/camera", "Transform3D:translation")
    assert len(frames) == 12  # the file has them all
    assert result.output.count("the live view was not shown to its end") == 1
    alone = thingmap("run", SMALL, "-o", tmp_path / "alone")
    assert alone.exit_code == 0
    assert (tmp_path / "seen" / "map.json").read_bytes() == (tmp_path / "alone" / "map.json").read_bytes()

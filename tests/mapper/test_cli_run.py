import json
import os
import signal
import subprocess
import sys
import textwrap
import types
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import SAMPLE_PREFIX, SYNTH_PREFIX, Loader
from thingmap.detectors.detections import Detections
from thingmap.mapper.cli.main import app
from thingmap.mapper.config import MapperConfig, OdometrySource
from thingmap.mapper.config_file import load_config
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder


class World:
    """What the commands open and make, in place of the real sequence, detector and mapper."""

    def __init__(self, sequence, mapper) -> None:
        self.sequence, self.mapper = sequence, mapper
        self.opened: dict = {}
        self.spec: str | None = None
        self.made: dict = {}

    def open_sequence(self, spec, dataset=None, stride=1, max_frames=None):
        self.opened = {"spec": spec, "dataset": dataset, "stride": stride, "max_frames": max_frames}
        return self.sequence

    def make_detector(self, spec, sequence=None):
        self.spec = spec
        return self.detect

    def detect(self, frame):
        box = np.array([[1.0, 1.0, 3.0, 4.0]])
        return Detections(("cup", "bowl"), box, np.array([[0.8, 0.1]]))

    def make_mapper(self, detector=None, config=None, *, source="", gravity=None):
        self.made = {"detector": detector, "config": config, "source": source, "gravity": gravity}
        return self.mapper


@pytest.fixture
def world(monkeypatch, tiny_sequence, fake_mapper):
    world = World(tiny_sequence(5), fake_mapper())
    modules = {
        "thingmap.datasets.open": {
            "open_sequence": world.open_sequence,
            "LOADERS": (Loader("folder", "images in a folder", lambda path: [path], world.open_sequence),),
            "SAMPLE_PREFIX": SAMPLE_PREFIX,
            "SYNTH_PREFIX": SYNTH_PREFIX,
        },
        "thingmap.detectors.spec": {"make_detector": world.make_detector},
        "thingmap.mapper.mapper": {"SemanticMapper": world.make_mapper},
    }
    for name, content in modules.items():
        monkeypatch.setitem(sys.modules, name, types.SimpleNamespace(**content))
    return world


def thingmap(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


def test_a_run_leaves_everything_in_its_folder(world, tmp_path):
    options = ["--detector", "none", "--stride", 2, "--max-frames", 9, "--seed", 7, "--odometry", "kiss-icp"]
    result = thingmap("run", "desk", "-o", tmp_path / "out", *options)
    assert result.exit_code == 0, result.output
    assert world.opened == {"spec": "desk", "dataset": None, "stride": 2, "max_frames": 9}
    assert world.made["detector"] == world.detect and world.made["source"] == "tiny"
    folder = OutputFolder.open(tmp_path / "out")
    assert len(folder.read_map()) == 5
    assert load_config(folder.config_file, MapperConfig) == world.made["config"]
    assert world.made["config"].seed == 7
    report = folder.read_report()
    assert report["command"] == {
        **{"sequence": "desk", "dataset": None, "detector": "none", "stride": 2, "max_frames": 9}
    }
    assert report["frames_used"] == 5 and report["stopped"] is None
    assert "thing-0005" in result.stdout and "0.100±0.010" in result.stdout
    assert "5 things from 5 frames" in result.stdout


def test_snapshots_are_maps_on_the_way_with_doubtful_things(world, tmp_path):
    out = tmp_path / "out"
    result = thingmap("run", "desk", "-o", out, "--detector", "none", "--snapshots", "1,3,99")
    assert result.exit_code == 0, result.output
    index = json.loads((out / "snapshots" / "index.json").read_text())
    assert [(entry["frames"], entry["stamp"]) for entry in index["snapshots"]] == [
        (1, world.sequence[0].stamp),
        (3, world.sequence[2].stamp),
    ]
    entry = index["snapshots"][1]
    assert np.array(entry["T_world_camera"])[0, 3] == 2.0  # the fake camera walks along x
    kept = ObjectMap.load(out / "snapshots" / entry["file"])
    assert len(kept) == 4 and min(thing.existence for thing in kept.things) == 0.2

    thingmap("run", "desk", "-o", out, "--detector", "none", "--overwrite")
    assert json.loads((out / "snapshots" / "index.json").read_text())["snapshots"] == []


def test_snapshots_of_no_number_are_refused(world, tmp_path):
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none", "--snapshots", "3;7")
    assert_mistake(result, "--snapshots", "3;7")


def test_progress_without_a_terminal_is_a_few_lines(world, tiny_sequence, tmp_path):
    world.sequence = tiny_sequence(500)
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none")
    lines = [line for line in result.stderr.splitlines() if line.startswith("mapping: ")]
    assert len(lines) == 10
    assert lines[0].startswith("mapping: 50/500 frames, ") and lines[0].endswith(", 50 things")
    assert lines[-1].startswith("mapping: 500/500 frames, ")


def test_the_command_line_is_over_the_file_is_over_the_defaults(world, tmp_path):
    file = tmp_path / "my.yaml"
    file.write_text("seed: 3\nodometry: {source: poses, max_range: 2.0}\n")
    world.sequence.poses = np.tile(np.eye(4), (5, 1, 1))
    thingmap("run", "desk", "-o", tmp_path / "a", "--detector", "none", "--config", file)
    assert world.made["config"].seed == 3 and world.made["config"].odometry.source is OdometrySource.POSES
    thingmap("run", "desk", "-o", tmp_path / "b", "--detector", "none", "--config", file, "--odometry", "kiss-icp")
    assert world.made["config"].odometry.source is OdometrySource.KISS_ICP
    assert world.made["config"].odometry.max_range == 2.0


def assert_mistake(result, *parts):
    assert result.exit_code == 2, result.output
    assert result.stdout == "" and result.stderr.count("\n") == 1 and result.stderr.startswith("error: ")
    for part in parts:
        assert part in result.stderr


def test_mistakes_before_the_run_leave_nothing_behind(world, tmp_path):
    out = tmp_path / "out"
    assert_mistake(thingmap("run", "desk", "-o", out, "--odometry", "poses", "--detector", "none"), "has no poses")
    assert_mistake(thingmap("run", "desk", "-o", out), "no detector: give --detector")
    assert_mistake(thingmap("run", "desk", "-o", out, "--config", tmp_path / "no.yaml"), "no.yaml", "no such file")
    (tmp_path / "bad.yaml").write_text("odometry: {max_rnage: 2}")
    assert_mistake(thingmap("run", "desk", "-o", out, "--config", tmp_path / "bad.yaml"), "odometry.max_range?")
    assert not out.exists()


def test_a_folder_in_use_is_refused_before_anything_is_opened(world, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    assert_mistake(thingmap("run", "desk", "-o", tmp_path, "--detector", "none"), "not empty")
    assert world.opened == {}
    assert thingmap("run", "desk", "-o", tmp_path, "--detector", "none", "--overwrite").exit_code == 0
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_the_detector_that_the_sequence_brings(world, tmp_path):
    (tmp_path / "desk").mkdir()
    (tmp_path / "desk" / "detections.json").write_text("{}")
    assert thingmap("run", tmp_path / "desk", "-o", tmp_path / "a").exit_code == 0
    assert world.spec == f"recorded:{tmp_path / 'desk' / 'detections.json'}"
    world.sequence.objects, world.sequence.classes, world.sequence.truth = (), (), lambda index: None
    assert thingmap("run", tmp_path / "desk", "-o", tmp_path / "b").exit_code == 0
    assert world.spec == "simulated"
    assert thingmap("run", tmp_path / "desk", "-o", tmp_path / "c", "--detector", "none").exit_code == 0
    assert world.spec == "none"


def test_recordings_of_other_frames_are_a_mistake(world, fake_mapper, tmp_path):
    world.detect = types.SimpleNamespace(missing=("frame-000000", "frame-000002", "frame-000004"))
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "recorded:x.json")
    assert result.exit_code == 2 and "error: recorded:x.json: none of the 3 keyframes (frame-000000, " in result.stderr
    assert not (tmp_path / "out" / "map.json").exists()
    world.detect, world.mapper = types.SimpleNamespace(missing=("frame-000002", "frame-000004")), fake_mapper()
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "recorded:x.json")
    assert result.exit_code == 0
    assert "recorded:x.json has nothing for 2 keyframes (frame-000002, frame-000004)" in result.stderr


def test_skipped_frames_are_named(world, tiny_sequence, tmp_path):
    world.sequence = tiny_sequence(5, broken=(1, 2))
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none")
    assert result.exit_code == 0
    assert (
        "skipped frames: 2 with unreadable image (frame-000001 (truncated), frame-000002 (truncated))" in result.stderr
    )


def test_nothing_but_broken_frames(world, tiny_sequence, tmp_path):
    world.sequence = tiny_sequence(3, broken=(0, 1, 2))
    assert_mistake(thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none"), "none of the 3 frames")


def test_ctrl_c_saves_what_is_mapped(world, fake_mapper, tmp_path):
    world.mapper = fake_mapper(fail_at=3, error=KeyboardInterrupt())
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none")
    assert result.exit_code == 130
    assert f"interrupted at frame 3; what was mapped before is in {tmp_path / 'out'}" in result.stderr
    folder = OutputFolder.open(tmp_path / "out")
    assert len(folder.read_map()) == 3 and folder.read_report()["stopped"] == "interrupted at frame 3"


def test_ctrl_c_before_the_first_frame_writes_nothing(world, fake_mapper, tmp_path):
    world.mapper = fake_mapper(fail_at=0, error=KeyboardInterrupt())
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none")
    assert result.exit_code == 130 and "nothing is written" in result.stderr
    assert list((tmp_path / "out").iterdir()) == []


def test_a_failure_saves_what_is_mapped_and_is_shown(world, fake_mapper, tmp_path):
    world.mapper = fake_mapper(fail_at=3, error=RuntimeError("singular"))
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none")
    assert result.exit_code == 1 and isinstance(result.exception, RuntimeError)
    assert "RuntimeError at frame 3: singular; what was mapped before is in" in result.stderr
    assert OutputFolder.open(tmp_path / "out").read_report()["frames_used"] == 3


def test_a_users_mistake_in_the_middle_is_one_line_and_saves(world, fake_mapper, tmp_path):
    world.mapper = fake_mapper(fail_at=3, error=UserError("frame-000003: images of another size"))
    result = thingmap("run", "desk", "-o", tmp_path / "out", "--detector", "none")
    errors = [line for line in result.stderr.splitlines() if not line.startswith("mapping: ")]
    assert result.exit_code == 2 and len(errors) == 1
    assert errors[0].startswith("error: frame-000003: images of another size; what was mapped before is in")
    assert len(OutputFolder.open(tmp_path / "out").read_map()) == 3


def test_detect_writes_what_the_detector_finds(world, tiny_sequence, tmp_path):
    world.sequence = tiny_sequence(4, broken=(2,))
    file = tmp_path / "detections.json"
    result = thingmap("detect", "desk", "--detector", "onnx:x", "-o", file)
    assert result.exit_code == 0, result.output
    assert f"3 boxes in 3 frames; they are in {file}" in result.stdout and "frame-000002" in result.stderr
    document = json.loads(file.read_text())
    assert [frame["name"] for frame in document["frames"]] == ["frame-000000", "frame-000001", "frame-000003"]
    assert document["frames"][0]["xyxy"] == [[1.0, 1.0, 3.0, 4.0]]
    shown = thingmap("info", file).stdout
    assert "3: 3 cup" in shown and "2: cup, bowl" in shown
    assert_mistake(thingmap("detect", "desk", "--detector", "onnx:x", "-o", file), "expected a new file")
    assert thingmap("detect", "desk", "--detector", "onnx:x", "-o", file, "--overwrite").exit_code == 0


def test_detect_on_broken_frames_only(world, tiny_sequence, tmp_path):
    world.sequence = tiny_sequence(2, broken=(0, 1))
    file = tmp_path / "detections.json"
    assert_mistake(thingmap("detect", "desk", "--detector", "x", "-o", file), "none of the 2 frames", "frame-000000")
    assert not file.exists()


def test_ctrl_c_while_detecting_keeps_the_frames_before(world, tmp_path, monkeypatch):
    seen = []
    detect = world.detect
    world.detect = lambda frame: seen.append(frame.index) or detect(frame)

    @contextmanager
    def after_two():
        yield lambda: len(seen) == 2

    monkeypatch.setattr("thingmap.mapper.cli.detect.stop_on_interrupt", after_two)
    file = tmp_path / "detections.json"
    result = thingmap("detect", "desk", "--detector", "x", "-o", file)
    assert result.exit_code == 130 and f"interrupted; the 2 frames before are in {file}" in result.stderr
    assert len(json.loads(file.read_text())["frames"]) == 2


def test_a_second_ctrl_c_while_detecting_leaves_no_file(world, tmp_path):
    def detect(frame):
        raise KeyboardInterrupt

    world.detect = detect
    result = thingmap("detect", "desk", "--detector", "x", "-o", tmp_path / "detections.json")
    assert result.exit_code == 130 and result.stderr == "interrupted\n"
    assert list(tmp_path.iterdir()) == []


def test_info_of_a_sequence(world, tiny_sequence, tmp_path):
    world.sequence = tiny_sequence(5, broken=(0,))
    shown = thingmap("info", tmp_path).stdout
    for part in (
        "folder (images in a folder)",
        "8 x 6, fx 10.00",
        "0.40 s, 10.0 frames/s",
        "gravity",
        "frame-000000: unreadable",
    ):
        assert part in shown
    assert "depth of frame-000001" in shown and "100 % valid, 1.00 to 1.00 m" in shown


CHILD = """
    import signal, sys, time, types
    signal.signal(signal.SIGINT, signal.default_int_handler)  # even where the tests run in the background
    sys.path.insert(0, {tests!r})
    import conftest
    class Slow(conftest.FakeMapper):
        def process_frame(self, frame, detections=None):
            print("frame", frame.index, flush=True)
            time.sleep(0.05)
            return super().process_frame(frame, detections)
    def module(**content):
        return types.SimpleNamespace(**content)
    sys.modules["thingmap.datasets.open"] = module(open_sequence=lambda *a, **k: conftest.TinySequence(2000))
    sys.modules["thingmap.detectors.spec"] = module(make_detector=lambda *a: None)
    sys.modules["thingmap.mapper.mapper"] = module(SemanticMapper=lambda *a, **k: Slow())
    from thingmap.mapper.cli.main import main
    sys.argv = ["thingmap", "run", "desk", "-o", {out!r}, "--detector", "none"]
    main()
"""


@pytest.mark.skipif(os.name == "nt", reason="sends SIGINT")
def test_a_real_ctrl_c_ends_after_the_frame_at_hand(tmp_path):
    out = tmp_path / "out"
    code = textwrap.dedent(CHILD).format(tests=str(Path(__file__).parent), out=str(out))
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout is not None
    for line in child.stdout:
        if line == "frame 3\n":
            child.send_signal(signal.SIGINT)
            break
    _, complaint = child.communicate(timeout=30)
    assert child.returncode == 130, complaint
    assert "stopping after this frame" in complaint and "what was mapped before is in" in complaint
    assert "Traceback" not in complaint
    folder = OutputFolder.open(out)
    used = folder.read_report()["frames_used"]
    assert 4 <= used < 50 and len(folder.read_map()) == used and len(folder.read_trajectory()[0]) == used

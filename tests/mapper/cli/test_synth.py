"""`thingmap synth`: what it writes, what it refuses, and that the rest of the program takes it."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.written_config import read_config
from thingmap.datasets.truth import HasClutter, HasPointTruth, HasTruth
from thingmap.mapper.cli import synth as command
from thingmap.mapper.cli.main import app

SMALL = ("--frames", "3", "--width", "64", "--objects", "3", "--clutter", "low", "--seed", "4")


def thingmap(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("synth") / "my table"
    result = thingmap("synth", "--preset", "tabletop", *SMALL, "-o", folder)
    assert result.exit_code == 0, result.stderr
    assert "rendering: 3/3 frames" in result.stderr
    assert "3 frames of synth:tabletop?seed=4&objects=3&clutter=low&frames=3&width=64: 3 objects (" in result.stdout
    for line in ("info '{0}'", "run '{0}' -o OUT", "evaluate OUT --truth '{0}' -o REPORT"):
        assert f"thingmap {line.format(folder)}\n" in result.stdout
    return folder


def test_the_folder_is_the_line(written: Path) -> None:
    files, line = open_sequence(written), open_sequence("synth:tabletop?seed=4&objects=3&clutter=low&frames=3&width=64")
    assert isinstance(files, HasTruth) and isinstance(files, HasClutter) and isinstance(files, HasPointTruth)
    assert isinstance(line, HasTruth)
    assert [thing.label for thing in files.objects] == [thing.label for thing in line.objects]
    assert np.abs(files[2].depth - line[2].depth).max() <= 0.000101
    np.testing.assert_array_equal(files.truth(2).visibility, line.truth(2).visibility)
    config = SyntheticConfig(Preset.TABLETOP, 3, ClutterLevel.LOW, 4, 3, 64)
    assert read_config(written) == config


def test_info_tells_of_the_truth(written: Path) -> None:
    result = thingmap("info", written)
    assert result.exit_code == 0, result.stderr
    assert "\ntruth " in result.stdout and " 3 objects: " in result.stdout and "things of no class" in result.stdout


def test_the_folder_maps_with_the_simulated_detector(written: Path, tmp_path: Path) -> None:
    result = thingmap("run", written, "-o", tmp_path / "out", "--odometry", "poses")
    assert result.exit_code == 0, result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["frames_used"] == 3 and report["command"]["detector"] == "simulated"


def test_the_same_options_give_the_same_files(written: Path, tmp_path: Path) -> None:
    assert thingmap("synth", *SMALL, "-o", tmp_path / "again").exit_code == 0
    for file in written.rglob("*"):
        if file.is_file():
            assert (tmp_path / "again" / file.relative_to(written)).read_bytes() == file.read_bytes(), file


def test_all_options_reach_the_configuration(tmp_path: Path) -> None:
    config = command._config("kitchen", "axial,shadow", 7, "high", 5, 9, 320, tmp_path, 3, 2.5)
    assert (config.preset, config.clutter, config.meshes) == (Preset.KITCHEN, ClutterLevel.HIGH, tmp_path)
    assert (config.objects, config.seed, config.frames, config.width) == (7, 5, 9, 320)
    assert (config.blur, config.pace) == (3, 2.5)
    off = [name for name in ("axial", "shadow", "quantised", "edges") if not getattr(config.sensor, name)]
    assert off == ["axial", "shadow"]
    assert command._config("survey", None, None, "medium", 0, None, 640, None, 0, 1.0) == SyntheticConfig(Preset.SURVEY)


def test_the_names_offered_are_those_of_the_renderer() -> None:
    assert [name.value for name in command.PresetName] == [preset.value for preset in Preset]
    assert [name.value for name in command.Clutter] == [level.value for level in ClutterLevel]


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("--preset", "attic"), "'tabletop', 'survey', 'kitchen', 'laps', 'wall'"),
        (("--clutter", "some"), "'low', 'medium', 'high'"),
        (("--objects", "0"), "expected objects from 1"),
        (("--frames", "many"), "--frames"),
        (("--width", "70"), "divisible by 4"),
        (("--blur", "99"), "expected blur from 0"),
        (("--pace", "0"), "expected pace above 0 and up to 8"),
        (("--preset", "survey", "--pace", "2"), "stands still, found pace 2.0"),
        (("--preset", "wall", "--objects", "2"), "nothing stands before its wall"),
        (("--without", "gravity"), "'gravity'"),
        (("--seed", "-1"), "expected seed from 0"),
        (("--meshes", "/nowhere/at/all"), "/nowhere/at/all"),
    ],
)
def test_mistakes_are_one_line_and_write_nothing(tmp_path: Path, arguments: tuple[str, ...], part: str) -> None:
    result = thingmap("synth", *arguments, "-o", tmp_path / "out")
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1, result.stderr
    assert part in result.stderr and not (tmp_path / "out").exists()


def test_a_folder_with_files_is_kept(tmp_path: Path) -> None:
    (tmp_path / "color").mkdir()
    (tmp_path / "color" / "mine.png").write_bytes(b"mine")
    result = thingmap("synth", *SMALL, "-o", tmp_path)
    assert result.exit_code == 2 and "not empty" in result.stderr and "--overwrite" in result.stderr
    result = thingmap("synth", *SMALL, "-o", tmp_path, "--overwrite")
    assert result.exit_code == 2 and "color" in result.stderr
    assert [file.name for file in tmp_path.rglob("*")] == ["color", "mine.png"]


def test_ctrl_c_leaves_a_shorter_sequence(tmp_path: Path, monkeypatch, request: pytest.FixtureRequest) -> None:
    import os
    import signal

    from thingmap.datasets.synthetic.files import writing

    encode = writing.encode_instances
    calls = []

    def press(instances: np.ndarray) -> bytes:
        calls.append(1)
        if len(calls) == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return encode(instances)

    monkeypatch.setattr(writing, "encode_instances", press)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job may be told to ignore it
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    options = ("--frames", "40", "--width", "64", "--objects", "3", "--clutter", "low")
    result = thingmap("synth", *options, "-o", tmp_path / "out")
    assert result.exit_code == 130, result.stderr
    short = open_sequence(tmp_path / "out")
    assert isinstance(short, HasTruth) and 1 <= len(short) < 40
    assert f"the first {len(short)} frames are a sequence with its truth" in result.stderr
    assert f"\n{len(short)} frames of " in "\n" + result.stdout

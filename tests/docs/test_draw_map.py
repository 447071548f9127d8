"""The script: it writes the same picture every time, and says in one line why it cannot."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import draw_map
import numpy as np
import pytest
from drawing.scene import PALETTE

from thingmap.mapper.map.thing import Thing


@pytest.fixture
def out(write_out: Callable[..., Path], make_thing: Callable[..., Thing]) -> Path:
    """A cup, a bowl, and a second cup that probably does not exist."""
    doubtful = make_thing(3, "cup", position=[0.2, -0.1, 1.0], existence=0.3)
    return write_out(make_thing(1, "cup"), make_thing(2, "bowl"), doubtful)


def test_it_writes_the_same_picture_twice_and_says_how_many_things_are_in_it(
    out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for file in files:
        assert draw_map.main([str(out), "-o", str(file), "--width", "320", "--view-from", "20", "45"]) == 0
    assert "2 things" in capsys.readouterr().out
    assert files[0].read_bytes() == files[1].read_bytes()
    assert draw_map.main([str(out), "-o", str(files[0]), "--width", "320", "--min-existence", "0.2"]) == 0
    assert "3 things" in capsys.readouterr().out


def test_it_runs_as_a_program_from_any_folder(out: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(draw_map.__file__), str(out), "-o", "a.png", "--width", "320"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    image = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_COLOR_RGB)
    assert image is not None and image.shape == (160, 320, 3)
    for color in PALETTE[:2]:  # the bowl's and the cup's are kept, whatever the other colours
        assert np.all(image == color, axis=-1).any()


@pytest.mark.parametrize("name", ["map.json", "cloud.ply", "trajectory.txt"])
def test_a_missing_file_is_one_line_that_names_it(
    out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (out / name).unlink()
    assert draw_map.main([str(out), "-o", str(tmp_path / "a.png")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and name in error and error.count("\n") == 1
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (["-o", "a.jpg"], "a.jpg"),
        (["--width", "20"], "--width"),
        (["--view-from", "0", "120"], "--view-from"),
    ],
)
def test_a_wrong_option_is_one_line_that_names_it(
    out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: list[str], named: str
) -> None:
    assert draw_map.main([str(out), "-o", str(tmp_path / "a.png"), *changes]) == 2
    error = capsys.readouterr().err
    assert named in error and error.count("\n") == 1
    assert not (tmp_path / "a.png").exists()

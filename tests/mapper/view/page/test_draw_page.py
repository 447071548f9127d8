"""docs/draw_page.py: a picture of the page, small enough, and one line about each mistake."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from thingmap.mapper.map.store import OutputFolder

sys.path.insert(0, str(Path(__file__).resolve().parents[4] / "docs"))

import draw_page


def test_a_picture_is_taken_with_a_thing_chosen(chromium: Any, folder: OutputFolder, tmp_path: Path) -> None:
    """The fixture skips where there is no browser; it holds this thread's playwright, so the script gets a process."""
    png = tmp_path / "page.png"
    command = [sys.executable, draw_page.__file__, str(folder.path), "-o", str(png), "--thing", "thing-0001"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    image = cv2.imread(str(png))
    assert image.shape[:2] == draw_page.SIZE[::-1]
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 200


def test_a_jpeg_keeps_within_its_bytes() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (300, 300, 3)).astype(np.uint8)
    png = cv2.imencode(".png", noise)[1].tobytes()
    large, small = draw_page.encode(png, ".jpg", 10**6), draw_page.encode(png, ".jpg", 70_000)
    assert len(small) <= 70_000 < len(large)
    assert draw_page.encode(png, ".png", 10) == png


def test_mistakes_are_one_line(folder: OutputFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (
        [str(folder.path), "-o", str(tmp_path / "page.gif")],
        [str(tmp_path), "-o", str(tmp_path / "page.png")],
        [str(folder.path), "-o", str(tmp_path / "page.png"), "--chromium", str(tmp_path / "none")],
    ):
        assert draw_page.main(arguments) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1

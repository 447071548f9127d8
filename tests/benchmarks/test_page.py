"""benchmarks/page.py on a small cloud."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import page
import pytest


def test_a_small_page_is_measured() -> None:
    pytest.importorskip("playwright")
    if not Path(page.CHROMIUM).is_file():
        pytest.skip("no Chromium")
    # a process of its own: one thread holds one playwright, and another test's may still be there
    command = [sys.executable, page.__file__, "--points", "500", "2000", "--times", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("| ")]
    assert [line.split("|")[1].strip() for line in lines] == ["points", "500", "2,000"]
    sizes = [float(line.split("|")[2]) for line in lines[1:]]
    assert 0.0 < sizes[0] < sizes[1] < 1.0
    assert all(0.0 < float(line.split("|")[6]) < 60.0 for line in lines[1:])


def test_a_room_has_the_points_asked_for(tmp_path: Path) -> None:
    run = page.write_room(tmp_path / "room", 1000)
    points, colors = run.read_cloud()
    assert points.shape == colors.shape == (1000, 3)
    assert len(run.read_map()) == page.THINGS


def test_mistakes_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert page.main(["--out", str(tmp_path)]) == 2
    assert page.main(["--points", "10", "--chromium", str(tmp_path / "none")]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 2

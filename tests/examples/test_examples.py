"""Every numbered example runs and says what it is about."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("[0-9][0-9]_*.py"))
SAYS = {
    "01_map_a_sample": ("P = ", "supported"),
    "02_own_detector": ("boxes in 15 frames", "exists with P"),
    "03_own_sequence": ("45 poses", "cm"),
    "04_while_it_runs": ("appeared", "outcomes of all boxes"),
    "05_questions": ("next to it", "bits about"),
    "06_take_it_along": ("thing-", "map.glb", "map.html"),
}


def test_they_are_numbered_without_a_gap() -> None:
    assert [int(example.stem[:2]) for example in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
    assert {example.stem for example in EXAMPLES} == set(SAYS)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_it_runs(example: Path, tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    done = subprocess.run(
        [sys.executable, str(example)],
        cwd=tmp_path,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
        timeout=400,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    for words in SAYS[example.stem]:
        assert words in done.stdout, done.stdout[-2000:]

"""What the README promises."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).resolve().parents[1] / "README.md"


def test_the_python_example_runs(tmp_path: Path):
    section = README.read_text().split("## From Python")[1]
    code = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert code is not None
    done = subprocess.run(
        [sys.executable, "-c", code.group(1)], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "thing-" in done.stdout
    assert (tmp_path / "tabletop-map.json").is_file()


def test_every_file_it_names_exists():
    text = README.read_text()
    for name in re.findall(r"`((?:mapper|factors|docs|benchmarks|\.ci)/[\w./]+)`|\]\(([\w./]+)\)", text):
        path = name[0] or name[1]
        assert (README.parent / path).exists(), path

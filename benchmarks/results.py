"""How benchmarks show what they measured: tables, the machine in general terms, sections of RESULTS.md."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path

RESULTS = Path(__file__).with_name("RESULTS.md")
HEAD = "# Results\n\nWritten by the benchmarks' `--write`; see README.md for what they measure.\n"
PACKAGES = ("gtsam", "kiss-icp", "numba", "numpy")


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table that also reads well in a terminal."""
    cells = [[str(cell) for cell in row] for row in (head, *rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = ["| " + " | ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) + " |" for row in cells]
    return "\n".join([lines[0], "|" + "|".join("-" * (w + 2) for w in widths) + "|", *lines[1:]])


def machine() -> str:
    """One line that says enough to read times by: cores, Python, packages; no names."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    cores = f"{os.cpu_count()} cores ({platform.machine()}, shared with whatever else ran)"
    return f"Machine: {cores}, Python {platform.python_version()}, {packages}."


def write_section(title: str, body: str, path: Path = RESULTS) -> None:
    """Put a section under its heading `## title`: in place of the old one, or at the end."""
    text = path.read_text(encoding="utf-8") if path.exists() else HEAD
    head, *sections = text.split("\n## ")
    kept = {section.split("\n", 1)[0]: section.rstrip() for section in sections}
    kept[title] = f"{title}\n\n{body.strip()}"
    path.write_text("\n## ".join([head.rstrip() + "\n", *(section + "\n" for section in kept.values())]), "utf-8")


def show_section(title: str, text: str, write: bool) -> None:
    """Print a section with the machine's line below it; with `write`, put it into RESULTS.md too."""
    body = f"{text}\n\n{machine()}"
    print(f"\n## {title}\n\n{body}", flush=True)
    if write:
        write_section(title, body)

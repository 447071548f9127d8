"""Every command and every program of the tutorial and the how-to pages, run as a reader would run them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted([DOCS / "tutorial.md", *(DOCS / "howto").glob("*.md")])
MAKE_MAP_THEMSELVES = {"tutorial"}
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', re.MULTILINE | re.DOTALL)
LONGEST = 400  # seconds of a block, on a busy machine


def run(command: list[str], folder: Path) -> str:
    """Runs a program where `thingmap` is this environment's."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    environment = {**os.environ, "PATH": path, "COLUMNS": "120"}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=LONGEST
    )
    assert done.returncode == 0, f"{command[-1]}\n{done.stdout[-2000:]}{done.stderr[-3000:]}"
    return done.stdout


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a reader has: `rec` with detections.json, and its map in `out/rec`."""
    folder = tmp_path_factory.mktemp("reader")
    world = "--preset tabletop --objects 6 --clutter low --frames 30 --seed 2 --width 320 -o rec"
    run(["bash", "-ec", f"thingmap synth {world}"], folder)
    run(["bash", "-ec", "thingmap detect rec --detector simulated?seed=1 -o boxes.json"], folder)
    shutil.rmtree(folder / "rec" / "truth")  # a reader's recording has none
    (folder / "rec" / "poses.txt").unlink()
    (folder / "boxes.json").rename(folder / "rec" / "detections.json")
    run(["bash", "-ec", "thingmap run rec -o out/rec"], folder)
    return folder


def write_bag(folder: Path) -> None:
    """`desk.mcap`: the first frames of `rec`, as a RealSense would record them."""
    pytest.importorskip("rosbags", reason="the extra `ros` (rosbags) is not installed")
    sys.path.insert(0, str(DOCS.parent / "tests" / "datasets" / "ros"))
    from bags import NAMES, PERIOD, START, Messages

    from thingmap.datasets.open import open_sequence

    sequence = open_sequence(folder / "rec", max_frames=6)
    messages, rows, k = Messages("mcap"), [], sequence.intrinsics
    for i, frame in enumerate(sequence):
        stamp = START + i * PERIOD
        info = messages.info(stamp, k=(k.fx, k.fy, k.cx, k.cy))
        info.width, info.height = k.width, k.height
        rows += [
            (NAMES["color"], stamp, messages.image(stamp, frame.color, "rgb8")),
            (NAMES["depth"], stamp, messages.image(stamp, frame.depth, "32FC1")),
            (NAMES["info"], stamp, info),
        ]
    written = messages.write(folder / "bag.mcap", rows)
    next(written.glob("*.mcap")).rename(folder / "desk.mcap")
    shutil.rmtree(written)


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """(language, title, text) of every block of a page."""
    return [(match[1], match[2] or "", match[3]) for match in BLOCK.finditer(page.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_everything_on_the_page_runs(page: Path, recorded: Path, tmp_path: Path) -> None:
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    if page.stem in MAKE_MAP_THEMSELVES:
        shutil.rmtree(tmp_path / "out")
    if page.stem == "ros":
        write_bag(tmp_path)
    program = ""  # blocks of python go on from each other, as in one session, until a command comes
    for language, title, text in blocks(page):
        if title:
            (tmp_path / title).write_text(text, encoding="utf-8")
        elif language == "sh":
            if program:
                run([sys.executable, "-c", program], tmp_path)
            program = ""
            run(["bash", "-ec", text], tmp_path)
        elif language == "python":
            program += text
        else:
            assert language in ("text", "json"), f"{page.name}: nothing runs a block of {language!r}"
    if program:
        run([sys.executable, "-c", program], tmp_path)


def test_the_tutorial_needs_fewer_than_five_commands() -> None:
    commands = [text for language, _, text in blocks(DOCS / "tutorial.md") if language == "sh"]
    assert 1 < sum(len(text.strip().splitlines()) for text in commands) < 5

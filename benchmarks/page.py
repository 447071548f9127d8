"""The one-file page: how large it is, how long it takes to write, and how soon a browser shows its first picture.

uv run python benchmarks/page.py                     a room of 100,000 and of 300,000 points with 24 things
uv run python benchmarks/page.py --out OUT --write   the map of a run instead, into RESULTS.md

Needs playwright and a Chromium. It draws without a graphics card, so times are those of a slow machine.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from results import show_section, table

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection
from thingmap.mapper.view.page.write import export_html

TITLE = "One-file page"
CHROMIUM = "/usr/bin/chromium"
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
ROOM = np.array([6.0, 4.5, 2.5])  # m
NOISE = 0.004  # m along a wall's normal: a depth camera's at 2 m
THINGS = 24
RAW_BYTES = 10 * 4 / 3  # of a point that is neither packed nor deflated: six of place, four of colour and side, base64


@dataclass(frozen=True, slots=True)
class Measured:
    """One page: `points` on it, `megabytes`, seconds to write it, milliseconds to unpack and to the first picture."""

    points: int
    megabytes: float
    writing: float
    unpacking: float
    first_picture: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder)
            run = OutputFolder.open(options.out) if options.out else write_room(path / "room", max(options.points))
            measured = measure(run, options.points, options.times, path, options.chromium)
            source = run.read_map().source
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    show_section(TITLE, describe(measured, source, options.times), options.write)
    return 0


def write_room(path: Path, points: int) -> OutputFolder:
    """The output folder of a run that never was: the walls of a room, painted, and boxes on its floor."""
    rng = np.random.default_rng(0)
    walls = rng.uniform(0.0, 1.0, (points, 3))
    axis = rng.choice(3, points, p=[0.25, 0.25, 0.5])
    walls[np.arange(points), axis] = np.where(axis == 2, 0.0, rng.integers(0, 2, points))
    walls = walls * ROOM + rng.normal(0.0, NOISE, (points, 3))
    shade = 128.0 + 60.0 * np.sin(3.0 * walls) + rng.normal(0.0, 6.0, (points, 3))
    folder = OutputFolder.create(path)
    folder.write_cloud(walls, np.clip(shade, 0, 255).astype(np.uint8))
    things = tuple(_thing(k, rng) for k in range(THINGS))
    up = UpDirection(np.array([0.0, 0.0, 1.0]), 0.01, "known")
    folder.write_map(ObjectMap(things, ("cup", "bowl", "book"), "a room", MapFrame.GRAVITY_ALIGNED, up))
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    poses = np.tile(np.eye(4), (200, 1, 1))
    poses[:, :3, 3] = ROOM / 2.0 + np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    folder.write_trajectory(angle, poses)
    return folder


def _thing(number: int, rng: np.random.Generator) -> Thing:
    label = ("cup", "bowl", "book")[number % 3]
    return Thing(
        id=f"thing-{number + 1:04d}",
        label=label,
        probability=0.9,
        existence=0.95,
        class_posterior={label: 0.9},
        position=rng.uniform(0.2, 0.8, 3) * ROOM * [1.0, 1.0, 0.2],
        position_covariance=1e-4 * np.eye(3),
        size=rng.uniform(0.1, 0.4, 3),
        size_std=np.full(3, 0.01),
        yaw=float(rng.uniform(0.0, np.pi)),
        first_seen=0.0,
        last_seen=6.0,
        evidence=Evidence(10, 2, 1),
    )


def measure(run: OutputFolder, points: Sequence[int], times: int, scratch: Path, chromium: Path) -> list[Measured]:
    """Every size of cloud, each opened `times` times in a browser that has nothing in its memory of it."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise UserError("playwright is not installed; install it with `pip install playwright`") from None
    if not chromium.is_file():
        raise InputError(chromium, "a Chromium", "nothing", "say where one is with --chromium")
    measured = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(chromium), args=list(FLAGS))
        for count in points:
            file = scratch / f"{count}.html"
            started = time.perf_counter()
            export_html(run, file, points=count, crops=False)
            writing = time.perf_counter() - started
            opened = [_open(browser, file) for _ in range(times)]
            unpacking, first = (statistics.median(values) for values in zip(*opened, strict=True))
            shown = min(count, len(run.read_cloud()[0]))
            measured.append(Measured(shown, file.stat().st_size / 1e6, writing, unpacking, first))
        browser.close()
    return measured


def _open(browser: Any, file: Path) -> tuple[float, float]:
    """Milliseconds of unpacking, and from the beginning of the page to its first picture."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    page.goto(file.as_uri())
    page.wait_for_selector("html[data-ready]", state="attached", timeout=120_000)
    times = page.evaluate("[thingmap.unpacked, thingmap.firstFrame]")
    context.close()
    return times[0], times[1]


def describe(measured: Sequence[Measured], source: str, times: int) -> str:
    """Markdown."""
    rows = [
        (
            f"{m.points:,}",
            f"{m.megabytes:.2f}",
            f"{m.points * RAW_BYTES / 1e6:.2f}",
            f"{m.writing:.1f}",
            f"{m.unpacking:.0f}",
            f"{m.first_picture / 1e3:.2f}",
        )
        for m in measured
    ]
    head = ("points", "page MB", "cloud unpacked MB", "writing s", "unpacking ms", "first picture s")
    text = (
        f"The page of {source}, opened from disk in Chromium without a graphics card; medians of {times}. "
        "Unpacking is what deflated differences cost over plain arrays, whose size is beside it."
    )
    return f"{text}\n\n{table(head, rows)}"


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Size and first picture of the one-file page.")
    parser.add_argument("--points", type=int, nargs="+", default=[100_000, 300_000], metavar="N")
    parser.add_argument("--out", type=Path, metavar="OUT", help="a run's map in place of a made-up room")
    parser.add_argument("--times", type=int, default=3, metavar="N", help="how often each page is opened (default: 3)")
    parser.add_argument("--chromium", type=Path, default=Path(CHROMIUM), metavar="FILE")
    parser.add_argument("--write", action="store_true", help="put the table into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.times < 1 or min(options.points) < 1:
        parser.error("--points and --times count from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())

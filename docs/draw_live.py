"""Takes the README's picture of the live view: rerun's own web viewer, in a browser without a screen.

    uv run thingmap run sample:tabletop -o OUT --save run.rrd
    uv run python docs/draw_live.py run.rrd -o docs/live.jpg

Nothing but this machine is asked for anything: requests of the viewer to the network are refused.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.extras import install_command
from thingmap.mapper.map.atomic import write_atomic

SIZE = (1600, 1000)  # pixels
LARGEST = 250_000  # bytes
BAR = 60  # pixels at the top and at the bottom, whose numbers never rest
STILL = 4  # pictures in a row that are the same
EVERY, LONGEST = 6.0, 420.0  # s; without a graphics card the viewer takes minutes
SAME = 0.05  # grey levels, mean difference
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def main(arguments: list[str] | None = None) -> int:
    """Returns 0, or 2 after one line about a mistake of the user."""
    given = _parser().parse_args(arguments)
    try:
        _check(given)
        with tempfile.TemporaryDirectory() as folder, _served(_compacted(given.recording, Path(folder))) as address:
            picture = _photograph(address, _browser(given.browser))
        write_atomic(given.output, _as_jpeg(picture))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{given.output} has {given.output.stat().st_size / 1000:.0f} kB")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Take a picture of a recorded live view.")
    parser.add_argument("recording", metavar="FILE.rrd", type=Path, help="that `thingmap run --save` wrote")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="JPEG to write")
    parser.add_argument("--browser", metavar="PROGRAM", help="Chromium; the first of its usual names by default")
    return parser


def _check(given: argparse.Namespace) -> None:
    if not given.recording.is_file():
        raise InputError(
            given.recording, "a recording", "nothing", "make one with `thingmap run SEQ -o OUT --save FILE`"
        )
    if given.output.suffix.lower() not in (".jpg", ".jpeg"):
        raise InputError(given.output, "a name ending in .jpg", given.output.name, "choose another name")


def _viewer() -> str:
    beside = Path(sys.executable).with_name("rerun")
    program = str(beside) if beside.is_file() else shutil.which("rerun")
    if program is None:
        raise UserError(f"rerun: the program was not found; install it with: {install_command('view')}")
    return program


def _browser(asked: str | None) -> str:
    found = next((path for name in ([asked] if asked else BROWSERS) if (path := shutil.which(name))), None)
    if found is None:
        raise UserError(f"{asked or 'Chromium'}: the browser was not found; name one with --browser")
    return found


def _compacted(recording: Path, folder: Path) -> Path:
    """The same in fewer, larger pieces, which the viewer takes in far sooner."""
    compact = folder / "compact.rrd"
    done = subprocess.run([_viewer(), "rrd", "optimize", str(recording), "-o", str(compact)], capture_output=True)
    if done.returncode != 0:
        found = done.stderr.decode(errors="replace").strip().splitlines()
        raise InputError(recording, "a recording", found[-1] if found else "something else", "record the run again")
    return compact


@contextmanager
def _served(recording: Path) -> Iterator[str]:
    """The address of a page that shows a recording."""
    page, data = _free_port(), _free_port()
    command = [_viewer(), str(recording), "--serve-web", "--bind", "127.0.0.1"]
    command += ["--web-viewer-port", str(page), "--port", str(data)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    server = subprocess.Popen(command, start_new_session=True, **quiet)
    try:
        _wait_for(page)
        yield f"http://localhost:{page}/?url=rerun%2Bhttp://localhost:{data}/proxy"
    finally:
        os.killpg(server.pid, signal.SIGTERM)  # `rerun` is a script that starts the program: both have to end
        server.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _wait_for(port: int) -> None:
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise UserError("rerun: its web viewer did not start within 30 s; try again")


def _photograph(address: str, browser: str) -> np.ndarray:
    """(H, W, 3) BGR, once the picture rests."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise UserError("playwright: not installed; it drives the browser: pip install playwright") from None
    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=browser, args=SOFTWARE)
        page = chromium.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, color_scheme="dark")
        ours = ("localhost", "127.0.0.1", None)  # None: data and blobs
        page.route("**/*", lambda r: r.continue_() if urlsplit(r.request.url).hostname in ours else r.abort())
        page.goto(address, timeout=1e3 * LONGEST)
        start, before, still = time.monotonic(), np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8), 0
        while still < STILL and time.monotonic() - start < LONGEST:
            time.sleep(EVERY)
            encoded = np.frombuffer(page.screenshot(timeout=1e3 * LONGEST), dtype=np.uint8)
            now = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
            changed = np.abs(now[BAR:-BAR].astype(np.int16) - before[BAR:-BAR]).mean()
            # before anything is shown the window is of one colour
            still, before = (still + 1 if changed < SAME and now[BAR:-BAR].std() > 10.0 else 0), now
        chromium.close()
    return before


def _as_jpeg(picture: np.ndarray) -> bytes:
    for quality in range(90, 30, -5):
        _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1])
        if len(encoded) <= LARGEST:
            return encoded.tobytes()
    raise UserError(f"the picture does not fit into {LARGEST / 1000:.0f} kB")


if __name__ == "__main__":
    sys.exit(main())

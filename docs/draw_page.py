"""Takes a picture of the page of a map, in a real browser without a window.

    python docs/draw_page.py OUT -o docs/page.jpg --thing thing-0003

Needs the package `playwright` and a Chromium.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.map.atomic import write_atomic
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.view.page.write import export_html

CHROMIUM = "/usr/bin/chromium"
# a card of software, so that the picture is the same on machines with and without a graphics card
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--hide-scrollbars")
SIZE = (1280, 800)  # pixels of the window
SETTLED = 900  # ms until a flight of the camera has ended
QUALITIES = (88, 80, 72, 64, 56)  # JPEG; the first that is small enough


def main(arguments: list[str] | None = None) -> int:
    """Returns 0, or 2 after one line about a mistake of the user."""
    given = _parser().parse_args(arguments)
    try:
        if given.output.suffix.lower() not in (".jpg", ".png"):
            raise InputError(given.output, "a name ending in .jpg or .png", given.output.name, "choose another name")
        with tempfile.TemporaryDirectory() as folder:
            page = Path(folder) / "map.html"
            export_html(OutputFolder.open(given.out), page)
            image = take_picture(page, given.thing, "light" if given.light else "dark", given.chromium)
        write_atomic(given.output, encode(image, given.output.suffix.lower(), given.most))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{given.output} has {given.output.stat().st_size / 1000:.0f} kB")
    return 0


def take_picture(page: Path, thing: str | None, scheme: str, chromium: Path) -> bytes:
    """A PNG of the page as it opens, or with a thing chosen.

    Args:
        page: file that `export_html` wrote.
        thing: id; None for none.
        scheme: "light" or "dark".
        chromium: the browser.

    Raises:
        UserError: there is no browser, or no such thing.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise UserError("playwright is not installed; install it with `pip install playwright`") from None
    if not chromium.is_file():
        raise InputError(chromium, "a Chromium", "nothing", "say where one is with --chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(chromium), args=list(FLAGS))
        try:
            tab = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, color_scheme=scheme)  # type: ignore[arg-type]
            tab.goto(page.resolve().as_uri())
            tab.wait_for_selector("html[data-ready]", state="attached")
            if thing is not None:
                row = tab.locator(f'.row[data-id="{thing}"]')
                if row.count() == 0:
                    raise UserError(f"--thing {thing}: the page lists no such thing; choose another one")
                row.click()
                tab.mouse.move(SIZE[0] / 2, SIZE[1] - 5)
            tab.wait_for_timeout(SETTLED)
            return tab.screenshot()
        finally:
            browser.close()


def encode(png: bytes, suffix: str, most: int) -> bytes:
    """The picture in the format asked for, a JPEG of at most `most` bytes where a quality allows that."""
    if suffix == ".png":
        return png
    image = cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_COLOR)
    content = b""
    for quality in QUALITIES:
        content = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(content) <= most:
            break
    return content


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Take a picture of the page of a map.")
    parser.add_argument("out", metavar="OUT", type=Path, help="folder that `thingmap run` wrote")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="JPEG or PNG to write")
    parser.add_argument("--thing", metavar="ID", help="choose this thing first")
    parser.add_argument("--light", action="store_true", help="light instead of dark")
    parser.add_argument("--most", metavar="BYTES", type=int, default=250_000, help="largest JPEG (default: 250000)")
    parser.add_argument("--chromium", metavar="FILE", type=Path, default=Path(CHROMIUM), help="the browser")
    return parser


if __name__ == "__main__":
    sys.exit(main())

"""Draws the map that `thingmap run` left in a folder as one PNG, with nothing but numpy and OpenCV.

    uv run python docs/draw_map.py OUT -o docs/tabletop.png

Shown are the coloured cloud, every thing as its upright box with what it probably is and the 2-sigma ellipse of its
position, and the camera's path. What the cloud hides of a box is thin; a doubtful thing is faint.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from drawing.pen import INK, WHITE
from drawing.picture import draw
from drawing.png import encode_png
from drawing.scene import ELEVATION, choose_view, read_scene

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.map.atomic import write_atomic

WIDTHS = (320, 4000)  # pixels


def main(arguments: list[str] | None = None) -> int:
    """Returns 0, or 2 after one line about a mistake of the user."""
    given = _parser().parse_args(arguments)
    try:
        _check(given)
        scene = read_scene(given.out, given.min_existence)
        image, missing = draw(scene, choose_view(scene, given.width, *given.view_from))
        write_atomic(given.output, encode_png(image, [WHITE, INK, *scene.palette.values()]))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    left_out = f", {missing} tags left out for lack of room" if missing else ""
    print(f"{len(scene.things)} things{left_out}; {given.output} has {given.output.stat().st_size / 1000:.0f} kB")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Draw the map that `thingmap run` left in a folder.")
    parser.add_argument("out", metavar="OUT", type=Path, help="folder that `thingmap run` wrote")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="PNG to write")
    parser.add_argument(
        "--view-from",
        nargs=2,
        type=float,
        default=(0.0, ELEVATION),
        metavar=("AZIMUTH", "ELEVATION"),
        help=f"degrees: turned from behind the camera, and above the horizontal (default: 0 {ELEVATION:g})",
    )
    parser.add_argument("--min-existence", metavar="P", type=float, default=0.5, help="leave out what is less probable")
    parser.add_argument("--width", metavar="PIXELS", type=int, default=1600)
    return parser


def _check(given: argparse.Namespace) -> None:
    """Raises `UserError` for a value that cannot be drawn with."""
    if given.output.suffix.lower() != ".png":
        raise InputError(given.output, "a name ending in .png", given.output.name, "choose another name")
    if not WIDTHS[0] <= given.width <= WIDTHS[1]:
        raise UserError(f"--width: expected {WIDTHS[0]} to {WIDTHS[1]}, found {given.width}; change it")
    if not 0.0 <= given.view_from[1] <= 90.0:
        raise UserError(f"--view-from: expected an elevation from 0 to 90, found {given.view_from[1]:g}; change it")


if __name__ == "__main__":
    sys.exit(main())

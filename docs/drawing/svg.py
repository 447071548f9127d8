"""A few strokes of SVG: circles for variables, squares for factors, curves and words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape

Point = Sequence[float]

FONT = 'font-family="sans-serif" font-size="13"'
RADIUS = 20.0  # of a variable


class Svg:
    """A picture on white, so that it can be read on a dark page too.

    Args:
        width, height: pixels.
    """

    def __init__(self, width: int, height: int) -> None:
        self._size = (width, height)
        self._lines: list[str] = []  # below everything else
        self._shapes: list[str] = []

    def document(self, title: str) -> str:
        """The file; the title is what a screen reader says."""
        width, height = self._size
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">'
        white = f'<rect width="{width}" height="{height}" rx="6" fill="#ffffff"/>'
        return "\n".join([head, f"<title>{escape(title)}</title>", white, *self._lines, *self._shapes, "</svg>"]) + "\n"

    def node(self, at: Point, name: str, colour: str) -> None:
        """A variable."""
        self._shapes.append(
            f'<circle cx="{at[0]:g}" cy="{at[1]:g}" r="{RADIUS:g}" fill="#ffffff" stroke="{colour}" stroke-width="2"/>'
        )
        self.text((at[0], at[1] + 5), name, colour)

    def factor(self, a: Point, b: Point, name: str, colour: str) -> None:
        """A measurement of two variables, half way between them."""
        self.line(a, b, colour)
        self._square((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, name, colour)

    def curve(self, a: Point, b: Point, rise: float, colour: str, name: str) -> None:
        """A measurement of two variables that are not neighbours, `rise` pixels off the straight line."""
        x, y = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2 + rise
        bend = 2 * y - (a[1] + b[1]) / 2
        self._lines.append(
            f'<path d="M {a[0]:g} {a[1]:g} Q {x:g} {bend:g} {b[0]:g} {b[1]:g}" fill="none" stroke="{colour}" '
            'stroke-width="1.5"/>'
        )
        self._square(x, y, name, colour)

    def line(self, a: Point, b: Point, colour: str) -> None:
        ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"'
        self._lines.append(f'<line {ends} stroke="{colour}" stroke-width="1.5"/>')

    def path(self, points: Iterable[Point], colour: str, dashed: bool = False) -> None:
        where = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dash = ' stroke-dasharray="6 4"' if dashed else ""
        self._shapes.append(f'<polyline points="{where}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>')

    def polygon(self, points: Iterable[Point], colour: str) -> None:
        self._shapes.append(f'<polygon points="{" ".join(f"{x:g},{y:g}" for x, y in points)}" fill="{colour}"/>')

    def box(
        self, centre: Point, size: Point, colour: str, name: str, below: bool = False, dashed: bool = False
    ) -> None:
        """A rectangle with its name over or below it."""
        x, y = centre[0] - size[0] / 2, centre[1] - size[1] / 2
        dash = ' stroke-dasharray="6 4"' if dashed else ""
        self._shapes.append(
            f'<rect x="{x:g}" y="{y:g}" width="{size[0]:g}" height="{size[1]:g}" fill="{colour}" fill-opacity="0.15" '
            f'stroke="{colour}" stroke-width="2"{dash}/>'
        )
        self.text((centre[0], y + size[1] + 18 if below else y - 8), name, colour)

    def bar(self, at: Point, length: float, colour: str) -> None:
        self._shapes.append(
            f'<rect x="{at[0]:g}" y="{at[1]:g}" width="{max(length, 1.0):.1f}" height="14" fill="{colour}"/>'
        )

    def dot(self, at: Point, colour: str) -> None:
        self._shapes.append(f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="4" fill="{colour}"/>')

    def text(self, at: Point, words: str, colour: str, anchor: str = "middle") -> None:
        if not all(math.isfinite(value) for value in at):
            raise ValueError(f"{words!r} has no place: {at}")
        place = f'x="{at[0]:g}" y="{at[1]:g}" text-anchor="{anchor}" fill="{colour}"'
        self._shapes.append(f"<text {place} {FONT}>{escape(words)}</text>")

    def _square(self, x: float, y: float, name: str, colour: str) -> None:
        self._shapes.append(f'<rect x="{x - 5:g}" y="{y - 5:g}" width="10" height="10" fill="{colour}"/>')
        if name:
            self.text((x, y - 10), name, colour)

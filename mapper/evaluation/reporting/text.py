"""Numbers of a report as people read them, the same in the terminal, on the page and in comparisons."""

from __future__ import annotations

import math

from ..result import Better

ABSENT = "–"
DIGITS = 3  # significant
NOISE = 1e-9  # of sums in floating point: nearer to 1 than this is 1

ARROWS = {Better.HIGHER: "↑", Better.LOWER: "↓", Better.NEAR_ONE: "→1", Better.NEITHER: ""}
WAYS = {
    Better.HIGHER: "higher is better",
    Better.LOWER: "lower is better",
    Better.NEAR_ONE: "nearest to 1 is best",
    Better.NEITHER: "neither way is better",
}
ARROWS_EXPLAINED = ", ".join(f"{arrow} {WAYS[better]}" for better, arrow in ARROWS.items() if arrow)


def number_text(value: float | int | None) -> str:
    """Three significant digits; whole numbers in full; what only nearly is 1 never as 1.

    Digits before the point are never replaced by zeros: 12345.6 is 12346.
    """
    if value is None or not math.isfinite(value):
        return ABSENT
    if isinstance(value, int) or value == 0.0:
        return str(int(value))
    size = abs(value)
    if 1.0 - 0.5 * 10.0**-DIGITS <= size < 1.0 - NOISE:
        return ">0.999" if value > 0.0 else "<-0.999"
    if size < 1e-4:
        return f"{value:.{DIGITS - 1}e}"
    before_point = math.floor(math.log10(float(f"{size:.{DIGITS - 1}e}"))) + 1  # after rounding: 9.999 is 10.0
    return f"{value:.{max(DIGITS - before_point, 0)}f}"


def cell_text(value: str | float | int | None) -> str:
    """A cell of a table: text as it is, numbers as `number_text`."""
    return value if isinstance(value, str) else number_text(value)

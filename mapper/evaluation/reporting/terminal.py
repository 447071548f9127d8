"""Reports and comparisons on the terminal, which may be narrow."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from .compare import Comparison
from .compare_files import row_name
from .report import Report
from .text import ARROWS, ARROWS_EXPLAINED, number_text

WIDTH = 1000  # columns where the output is a file or a pipe: a row stays one line
NAME_WIDTH = 14  # columns at least for the names of metrics
BEST = "*"


def terminal() -> Console:
    """As wide as the terminal is."""
    return Console(highlight=False) if sys.stdout.isatty() else Console(highlight=False, width=WIDTH)


def print_report(report: Report, console: Console) -> None:
    """The notes on all numbers and the metrics of every protocol with their units, then what was not evaluated."""
    for note in report.notes:
        console.print(Text(f"note: {' '.join(note.split())}", style="yellow"))
    table = _table(("metric", "left"), ("value", "right"), ("unit", "left"), ("", "left"))
    for result in report.results:
        table.add_row(Text(result.title, style="bold"))
        for metric in filter(lambda metric: metric.headline, result.metrics):
            unit = metric.unit if metric.value is not None else ""
            table.add_row(*_texts(f"  {metric.name}", number_text(metric.value), unit, ARROWS[metric.better]))
        table.add_section()
    console.print(table)
    console.print(Text(ARROWS_EXPLAINED, style="dim"))
    for name, reason in report.skipped.items():
        console.print(Text(f"not evaluated: {name}: {' '.join(reason.split())}"))


def print_comparison(comparison: Comparison, console: Console) -> None:
    """What differs, then a row a metric; the best value of a row is bold and has a star."""
    for warning in comparison.warnings:
        console.print(Text(warning, style="yellow"))
    table = _table(("metric", "left"), *((name, "right") for name in comparison.names), ("", "left"))
    for group in comparison.groups:
        table.add_row(Text(group.title, style="bold"))
        for row in group.rows:
            values = [
                Text(number_text(value) + BEST, style="bold") if best else Text(number_text(value) + " ")
                for value, best in zip(row.values, row.best, strict=True)
            ]
            table.add_row(Text(f"  {row_name(row)}"), *values, Text(ARROWS[row.better]))
        table.add_section()
    console.print(table)
    console.print(Text(f"{ARROWS_EXPLAINED}; {BEST} best of its row", style="dim"))
    for line in comparison.skipped:
        console.print(Text(f"not evaluated: {line}"))


def _table(*columns: tuple[str, str]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), show_edge=False)
    for number, (name, justify) in enumerate(columns):
        least = NAME_WIDTH if number == 0 else None
        table.add_column(Text(name), justify=justify, overflow="fold", min_width=least)  # type: ignore[arg-type]
    return table


def _texts(*cells: str) -> Sequence[Text]:
    """A name may hold what rich takes for markup."""
    return [Text(cell) for cell in cells]

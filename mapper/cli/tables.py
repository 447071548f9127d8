"""Things as tables for people."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Sequence
from textwrap import indent
from typing import TYPE_CHECKING

from ..map.text import probability_text

if TYPE_CHECKING:
    from ..map.explanation import Explanation
    from ..map.thing import Thing
    from ..queries.answer import Answer

GAP = 2  # columns between two cells
WIDTH = 1000  # columns: a row stays one line, whatever the terminal or the file
EXPLAINED_WIDTH = 100  # columns where the output is no terminal
INDENT = "  "
SPARE = ("for/hidden/against", "P", "existence", "size, m")  # left out in this order where a terminal is too narrow
LARGEST = 40  # things shown after a run


def print_things(things: Iterable[Thing]) -> None:
    """Everything in a map, surest first: label, P, existence, position ± std, size, evidence."""
    ranked = sorted(things, key=lambda thing: (-thing.existence * thing.probability, thing.id))
    if not ranked:
        return
    headers = ("label", "P", "existence", "x, y, z ± std, m", "size, m", "for/hidden/against", "id")
    print_table(headers, [_thing_cells(thing) for thing in ranked[:LARGEST]])
    if len(ranked) > LARGEST:
        print(f"and {len(ranked) - LARGEST} more")


def print_answers(answers: Sequence[Answer]) -> None:
    """Answers to a question, in their order; the first column is the probability of being what was asked for."""
    with_distance = any(answer.distance is not None for answer in answers)
    headers = ("P(asked for)", *(("distance ± std, m",) if with_distance else ()))
    headers += ("label", "P", "existence", "x, y, z ± std, m", "size, m", "for/hidden/against", "id")
    rows = []
    for answer in answers:
        distance = (f"{answer.distance:.3f} ± {answer.distance_std:.3f}",) if with_distance else ()
        rows.append((probability_text(answer.probability), *distance, *_thing_cells(answer.thing)))
    print_table(headers, rows)


def print_explained(answers: Iterable[tuple[Answer, Explanation]]) -> None:
    """Each answer with the views that mattered most for what was asked for, the table as wide as the terminal."""
    width = shutil.get_terminal_size((EXPLAINED_WIDTH, 24)).columns - len(INDENT)
    for number, (answer, explanation) in enumerate(answers):
        if number:
            print()
        print_answers([answer])
        print(indent(f"\n{explanation.table(width=width)}", INDENT))


def _thing_cells(thing: Thing) -> tuple[str, ...]:
    position = "  ".join(f"{p:.3f}±{s:.3f}" for p, s in zip(thing.position, thing.position_std, strict=True))
    size = "  ".join(f"{extent:.3f}" for extent in thing.size)
    seen = thing.evidence
    counts = f"{seen.supporting}/{seen.occluded}/{seen.contradicting}"
    known = probability_text(thing.probability), probability_text(thing.existence)
    return thing.label, *known, position, size, counts, thing.id


def print_table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Rows of cells under heads; what is in a cell is shown as it is.

    A row stays one line. Where the output is a terminal too narrow for it, `SPARE` columns are left out, and named.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    kept = _fitting(headers, rows) if sys.stdout.isatty() else list(range(len(headers)))
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for k in kept:
        table.add_column(headers[k])
    for row in rows:
        table.add_row(*(Text(row[k]) for k in kept))  # Text: a label may hold what rich takes for markup
    Console(width=WIDTH).print(table)
    if len(kept) < len(headers):
        missing = "; ".join(header for k, header in enumerate(headers) if k not in kept)
        print(f"left out, as the terminal is narrow: {missing}")


def _fitting(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    """Which columns to show in this terminal: all that are not `SPARE`, and of these as many as there is room for."""
    widths = [max(len(row[k]) for row in (headers, *rows)) + GAP for k in range(len(headers))]
    kept = list(range(len(headers)))
    for header in SPARE:
        if sum(widths[k] for k in kept) - 1 <= shutil.get_terminal_size().columns:
            break
        kept = [k for k in kept if headers[k] != header]
    return kept

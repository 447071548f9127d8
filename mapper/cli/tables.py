"""Things as tables for people."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from textwrap import indent
from typing import TYPE_CHECKING

from ..map.text import probability_text

if TYPE_CHECKING:
    from ..map.explanation import Explanation
    from ..map.thing import Thing
    from ..queries.answer import Answer

WIDTH = 1000  # columns: a row stays one line, whatever the terminal or the file
EXPLAINED_WIDTH = 100  # columns where the output is no terminal
INDENT = "  "
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
    headers += ("likeliest label", "P", "existence", "x, y, z ± std, m", "size, m", "for/hidden/against", "id")
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
    """Rows of cells under heads; what is in a cell is shown as it is."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), show_edge=False)
    for header in headers:
        table.add_column(header)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))  # Text: a label may hold what rich takes for markup
    Console(width=WIDTH).print(table)

"""Pieces of HTML that the page of a report and that of a comparison share; everything given is escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from ..result import Table
from .text import cell_text, number_text

LONG = 32  # letters: longer cells are broken into lines, longer facts get more room
MANY = 40  # rows: longer tables are shown on demand

# The browser itself refuses whatever is not in the file.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


def document(title: str, body: Iterable[str]) -> str:
    """A page that needs nothing but itself; `body` is HTML."""
    style = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            f"<title>{escape(title)}</title>",
            f"<style>\n{style}</style>",
            "</head>",
            "<body>",
            "<main>",
            *body,
            "</main>",
            "</body>",
            "</html>\n",
        ]
    )


def table(content: Table) -> str:
    """A table that scrolls where it is wide and opens where it is folded or long; numbers are set to the right."""
    styles = [_style([row[column] for row in content.rows]) for column in range(len(content.columns))]
    columns = zip(content.columns, styles, strict=True)
    head = "".join(f'<th scope="col"{style}>{escape(name)}</th>' for name, style in columns)
    lines = []
    for row in content.rows:
        first, *rest = (escape(cell_text(cell)) for cell in row)
        cells = "".join(f"<td{style}>{cell}</td>" for cell, style in zip(rest, styles[1:], strict=True))
        lines.append(f'<tr><th scope="row"{styles[0]}>{first}</th>{cells}</tr>')
    if len(lines) <= MANY and not content.folded:
        return scrolling(content.title, head, lines)
    summary = f"<summary>{escape(content.title)} ({len(lines)} rows)</summary>"
    return f"<details>{summary}\n{scrolling('', head, lines)}</details>"


def scrolling(caption: str, head: str, rows: Sequence[str]) -> str:
    """A table of ready cells and rows, which are HTML; the caption is text."""
    shown = f"<caption>{escape(caption)}</caption>" if caption else ""
    return (
        f'<div class="scroll" tabindex="0"><table>{shown}\n<thead><tr>{head}</tr></thead>\n<tbody>\n'
        + "\n".join(rows)
        + "\n</tbody></table></div>"
    )


def facts(values: Mapping[str, Any]) -> str:
    """Names and values as a list of definitions."""
    pairs = []
    for name, value in values.items():
        text = fact_text(value)
        style = ' class="long"' if len(text) > LONG else ""
        pairs.append(f"<div{style}><dt>{escape(name)}</dt><dd>{escape(text)}</dd></div>")
    return '<dl class="facts">\n' + "\n".join(pairs) + "\n</dl>"


def fact_text(value: Any) -> str:
    """A fact in words: "a, b", "cup = mug", "–"."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} = {fact_text(item)}" for name, item in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(fact_text(item) for item in value) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float | int) or value is None:
        return number_text(value)
    return str(value)


def _style(cells: Sequence[object]) -> str:
    """Attribute of a column's cells: numbers to the right, long texts with lines of their own."""
    texts = [cell for cell in cells if isinstance(cell, str)]
    if texts:
        return ' class="long"' if max(map(len, texts)) > LONG else ""
    return ' class="n"' if cells else ""

"""A comparison as Markdown and as a page."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from .compare import Comparison, Row
from .markup import document, scrolling
from .text import ARROWS, ARROWS_EXPLAINED, number_text

TITLE = "Maps compared"


def to_markdown(comparison: Comparison) -> str:
    """A table a protocol; the best values are bold."""
    lines = [f"# {TITLE}", "", f"{ARROWS_EXPLAINED}; the best of a row is bold."]
    if comparison.warnings:
        lines += ["", *(f"- **{_cell(warning)}**" for warning in comparison.warnings)]
    for group in comparison.groups:
        head = ["metric", "", *comparison.names]
        lines += ["", f"## {_cell(group.title)}", "", _line(head), "|---|---|" + "---:|" * len(comparison.names)]
        for row in group.rows:
            values = [f"**{text}**" if best else text for text, best in zip(_values(row), row.best, strict=True)]
            lines.append(_line([row_name(row), ARROWS[row.better], *values]))
    if comparison.skipped:
        lines += ["", "## Not evaluated", "", *(f"- {_cell(line)}" for line in comparison.skipped)]
    return "\n".join(lines) + "\n"


def to_page(comparison: Comparison) -> str:
    """HTML that needs nothing but itself, as `render_page`."""
    return document(TITLE, _body(comparison))


def row_name(row: Row) -> str:
    """ "position error, m"."""
    return f"{row.name}, {row.unit}" if row.unit else row.name


def _body(comparison: Comparison) -> Iterator[str]:
    yield f"<header><h1>{TITLE}</h1>"
    yield f'<p class="quiet">{escape(ARROWS_EXPLAINED)}; the best of a row is bold.</p></header>'
    for warning in comparison.warnings:
        yield f'<p class="warning">{escape(warning)}</p>'
    columns = "".join(f'<th scope="col" class="n">{escape(name)}</th>' for name in comparison.names)
    rows: list[str] = []
    for group in comparison.groups:
        width = 2 + len(comparison.names)
        rows.append(f'<tr class="group"><th scope="colgroup" colspan="{width}">{escape(group.title)}</th></tr>')
        rows += [_page_row(row) for row in group.rows]
    yield scrolling("", f'<th scope="col">metric</th><th></th>{columns}', rows)
    if comparison.skipped:
        yield "<h3>Not evaluated</h3>"
        yield '<ul class="notes">' + "".join(f"<li>{escape(line)}</li>" for line in comparison.skipped) + "</ul>"


def _page_row(row: Row) -> str:
    cells = "".join(
        f'<td class="n{" best" if best else ""}">{escape(text)}</td>'
        for text, best in zip(_values(row), row.best, strict=True)
    )
    name = escape(row_name(row))
    return f'<tr><th scope="row">{name}</th><td class="quiet">{escape(ARROWS[row.better])}</td>{cells}</tr>'


def _values(row: Row) -> list[str]:
    return [number_text(value) for value in row.values]


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(_cell(cell) for cell in cells) + " |"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")

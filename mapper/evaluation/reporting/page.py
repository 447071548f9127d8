"""The report as one HTML page that opens from disk and asks for nothing else."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from typing import Any

from ..result import Metric, Plot, PlotKind, ProtocolResult, WorstCase
from .markup import document, facts, table
from .pictures import Picture
from .plots import LegendEntry, draw, legend
from .report import Report
from .text import ARROWS, ARROWS_EXPLAINED, WAYS, number_text

# Of `plots.MARKERS`, as paths in the legend's 26 x 10.
MARKS = {
    "o": "M10.5 5a2.5 2.5 0 1 0 5 0a2.5 2.5 0 1 0 -5 0Z",
    "x": "M9.5 1.5L16.5 8.5M9.5 8.5L16.5 1.5",
    "^": "M13 2.5L16 7.5H10Z",
    "+": "M13 .5V9.5M8.5 5H17.5",
}


def render_page(report: Report, pictures: Mapping[WorstCase, Picture]) -> str:
    """HTML of the whole report; the same report and pictures give the same text.

    Args:
        report: what to show, whatever its protocols are.
        pictures: of its worst cases, from `take_pictures`; cases without one are shown in words.
    """
    name = str(report.run.get("map", "a map"))
    return document(f"Evaluation of {name}", _body(report, name, pictures))


def _body(report: Report, name: str, pictures: Mapping[WorstCase, Picture]) -> Iterator[str]:
    source, frames = report.run.get("source", "a map"), report.run.get("frames in common")
    mapped = f"{frames} frames of {source}" if frames is not None else str(source)
    what = f"{mapped}, judged by {report.truth}, evaluator {report.evaluator}"
    yield f"<header><h1>Evaluation of {escape(name)}</h1>"
    yield f'<p class="quiet">{escape(what)}</p>'
    yield from (f'<p class="warning">{escape(note)}</p>' for note in report.notes)
    yield "</header>"
    yield from _headline(report)
    for number, result in enumerate(report.results, start=1):
        yield from _section(result, f"r{number}", pictures)
    yield f"<section><h2>What was judged</h2>{facts(_shown_facts(report))}"
    yield f"<h3>Numbers of the evaluator</h3>{facts(report.config)}</section>"
    yield f"<footer>Written by thingmap evaluate, evaluator {escape(report.evaluator)}.</footer>"


def _shown_facts(report: Report) -> dict[str, Any]:
    run = {name: value for name, value in report.run.items() if name not in ("map", "classes")}
    alignment = {"alignment" if name == "method" else name: value for name, value in report.alignment.items()}
    return run | {"classes judged": report.classes} | alignment


def _notes(notes: Iterable[str]) -> str:
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f'<ul class="notes">{items}</ul>' if items else ""


def _headline(report: Report) -> Iterator[str]:
    yield f'<section><h2>Results</h2><p class="quiet">{escape(ARROWS_EXPLAINED)}</p><div class="headline">'
    for number, result in enumerate(report.results, start=1):
        yield f'<article><h3><a href="#r{number}">{escape(result.title)}</a></h3><dl>'
        yield from (_metric(metric) for metric in result.metrics if metric.headline)
        yield "</dl></article>"
    yield "</div>"
    if report.skipped:
        yield '<h3>Not evaluated</h3><ul class="notes">'
        yield from (f"<li><b>{escape(name)}</b>: {escape(why)}</li>" for name, why in report.skipped.items())
        yield "</ul>"
    yield "</section>"


def _metric(metric: Metric) -> str:
    unit = escape(metric.unit) if metric.value is not None else ""
    return (
        f'<div><dt>{escape(metric.name)}</dt><dd class="value">{escape(number_text(metric.value))}</dd>'
        f'<dd>{unit}</dd><dd title="{WAYS[metric.better]}">{ARROWS[metric.better]}</dd></div>'
    )


def _section(result: ProtocolResult, key: str, pictures: Mapping[WorstCase, Picture]) -> Iterator[str]:
    yield f'<section id="{key}"><h2>{escape(result.title)}</h2><p class="follows">{escape(result.follows)}</p>'
    yield _notes(result.notes)
    if result.plots:
        yield '<div class="plots">'
        yield from (_plot(plot, f"{key}-{number}") for number, plot in enumerate(result.plots, start=1))
        yield "</div>"
    if result.tables:
        yield '<div class="tables">'
        yield from (table(content) for content in result.tables)
        yield "</div>"
    if result.worst:
        yield from _worst(result.worst, pictures)
    yield "</section>"


def _plot(plot: Plot, key: str) -> str:
    svg = draw(plot, key)
    if svg is None:
        svg = '<p class="quiet">There is nothing to draw: no value is defined.</p>'
    entries = "".join(f"<li>{_sample(entry)}{escape(entry.name)}</li>" for entry in legend(plot))
    shown = f'<ul class="legend">{entries}</ul>' if len(plot.series) > 1 else ""
    return f"<figure><figcaption>{escape(plot.title)}</figcaption>\n{svg}\n{shown}</figure>"


def _sample(entry: LegendEntry) -> str:
    """The key of a legend entry."""
    color = f"var(--series-{entry.color})"
    if entry.kind is PlotKind.POINTS:
        mark = f'<path d="{MARKS[entry.marker]}" stroke="{color}" stroke-width="1.6" fill="{color}"/>'
    elif entry.kind is PlotKind.BARS:
        mark = f'<rect x="6" y="0" width="14" height="10" fill="{color}" opacity=".75"/>'
    else:
        mark = f'<path d="M0 5H26" stroke="{color}" stroke-width="2" stroke-dasharray="{entry.dashes}"/>'
    return f'<svg viewBox="0 0 26 10" aria-hidden="true">{mark}</svg>'


def _worst(cases: tuple[WorstCase, ...], pictures: Mapping[WorstCase, Picture]) -> Iterator[str]:
    yield "<h3>Worst cases</h3>"
    shown = [case for case in cases if case in pictures]
    if shown:
        yield (
            '<ul class="legend cases-legend">'
            '<li><svg viewBox="0 0 26 10"><path class="box-truth" d="M0 5H26"/></svg>true box</li>'
            '<li><svg viewBox="0 0 26 10"><path class="box-found" d="M0 5H26"/></svg>found box</li></ul>'
        )
        yield '<div class="cases">'
        yield from (_case(case, pictures[case]) for case in shown)
        yield "</div>"
    rest = [case for case in cases if case not in pictures]
    if rest:
        yield '<ul class="notes">' + "".join(f"<li>{escape(case.text)}{_where(case)}</li>" for case in rest) + "</ul>"


def _case(case: WorstCase, picture: Picture) -> str:
    data = base64.b64encode(picture.jpeg).decode("ascii")
    size = f'width="{picture.width}" height="{picture.height}"'
    boxes = "".join(
        f'<rect class="{style}" x="{x1:.1f}" y="{y1:.1f}" width="{x2 - x1:.1f}" height="{y2 - y1:.1f}"/>'
        for kind, box in (("box-truth", picture.truth), ("box-found", picture.found))
        if box is not None
        for x1, y1, x2, y2 in (box,)
        for style in ("box-halo", kind)
    )
    return (
        f'<figure><svg class="case" viewBox="0 0 {picture.width} {picture.height}" role="img" '
        f'aria-label="{escape(case.text)}"><image href="data:image/jpeg;base64,{data}" {size}/>{boxes}</svg>'
        f"<figcaption>{escape(case.text)}{_where(case)}</figcaption></figure>"
    )


def _where(case: WorstCase) -> str:
    return "" if case.frame is None else f' <span class="quiet">(frame {case.frame})</span>'

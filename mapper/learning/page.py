"""The page beside the model: what the detector does when objects are hidden, class by class."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ...datasets.truth import PARTS
from ..evaluation.reporting.markup import document, facts, table
from ..evaluation.reporting.plots import draw
from ..evaluation.uncertainty.calibration import reliability_plot, reliability_table
from .learn import Learned
from .plots import draw_rates, draw_scores
from .summary import (
    POOLED,
    calibration_plot,
    calibration_table,
    class_table,
    notes,
    prior_table,
    size_rates,
    templates,
    weight_table,
)

if TYPE_CHECKING:  # it brings the whole mapper along
    from .existence import LearnedExistence

_SCORES = (
    "Mean score of detections that name the class, over how much of it is hidden, with a band of one standard "
    "deviation; dashed, in red: false detections that name it. Right of the dotted line at 0.7 an object counts as "
    "hidden, and its scores say nothing. The bars count the votes, on a logarithmic scale."
)
_RATES = (
    "How often objects are found, over how much of them shows: curves are the model's P_D, points were counted in the "
    "octave about the size; the largest stand for 100 trials or more."
)
_WEIGHTS = (
    "A weight of 1 takes evidence at its word; 0.5 halves it, as is right for what is said twice; much lower it "
    "hardly helped; above 1 it was too modest."
)
_RELIABILITY = (
    "Of the landmarks that exist with 0.8, eight of ten should be objects, and of the objects that are named with 0.8, "
    "eight of ten should be what they are called: points on the line. "
    "The tables say how many stand behind each point."
)


def render_page(learned: Learned, existence: LearnedExistence | None = None) -> str:
    """HTML that opens from disk; the same model gives the same text.

    Args:
        learned: the first stage; its model may be that of the second.
        existence: the second stage; None where the sequences were not mapped.
    """
    return document("What a detector does when objects are hidden", _body(learned, existence))


def _body(learned: Learned, existence: LearnedExistence | None) -> Iterator[str]:
    tally, model = learned.samples.tally, learned.model
    shown = templates(learned.samples)
    yield "<header><h1>What a detector does when objects are hidden</h1>"
    yield f'<p class="quiet">Learned from {escape(model.learned_from)}.</p></header>'
    counted = {
        "sequences": len(tally.scenes),
        "frames": tally.frames,
        "detections": tally.detections,
        "false detections": len(learned.samples.false_part),
        "templates": [PARTS[part] for part in shown],
    }
    left_out = "".join(f"<li>{escape(note)}</li>" for note in notes(tally))
    yield f'<section><h2>What was looked at</h2>{facts(counted)}<ul class="notes">{left_out}</ul>'
    yield '<div class="tables">'
    yield from (table(class_table(learned, part)) for part in shown)
    yield "</div></section>"
    yield from _section(learned, len(model.classes), POOLED)
    for row, name in enumerate(model.classes):
        yield from _section(learned, row, name)
    yield from _calibration(learned)
    yield from _existence(existence)
    yield f"<footer>Written by thingmap learn. {escape(_numbers(learned))}</footer>"


def _section(learned: Learned, row: int, name: str) -> Iterator[str]:
    yield f'<section id="class-{row}"><h2>{escape(name)}</h2>'
    if row == len(learned.model.classes):
        yield f"<p>{escape(_SCORES)}</p><p>{escape(_RATES)}</p>"
    yield '<div class="plots">'
    for part in templates(learned.samples):
        key = f"c{row}-{part}"
        title = f"{PARTS[part]}: score of {name}"
        votes = learned.votes[row, part]
        yield _figure(title, draw_scores(learned.model.scores, row, part, votes, f"{key}-s", f"{title} over occlusion"))
        if part == 0 or row == len(learned.model.classes):
            yield _rates(learned, row, part, f"{key}-r")
    yield "</div></section>"


def _rates(learned: Learned, row: int, part: int, key: str) -> str:
    """P_D of a class; for all classes, of the mixture of them that was seen."""
    rows = np.ones(len(learned.samples.part), dtype=bool)
    if row < len(learned.class_id):
        rows = learned.samples.class_id == learned.class_id[row]
    rates = size_rates(learned, rows, part)
    title = f"{PARTS[part]}: detection rate"
    if not rates:
        return _figure(title, '<p class="quiet">Too few trials of any size.</p>')
    picture = draw_rates(rates, key, f"{title} over visible share")
    entries = "".join(
        f'<li><svg viewBox="0 0 26 10" aria-hidden="true"><path d="M0 5H26" stroke="var(--series-{k})" '
        f'stroke-width="2"/></svg>{rate.size_px:.0f} px</li>'
        for k, rate in enumerate(rates, start=1)
    )
    return _figure(title, f'{picture}\n<ul class="legend">{entries}</ul>')


def _figure(title: str, content: str) -> str:
    return f"<figure><figcaption>{escape(title)}</figcaption>\n{content}</figure>"


def _calibration(learned: Learned) -> Iterator[str]:
    yield '<section id="calibration"><h2>Is P_D right elsewhere?</h2>'
    if not learned.calibration:
        yield '<p class="quiet">Not known: that needs two sequences or more, of which some are left out.</p></section>'
        return
    yield "<p>Each sequence was left out once, and its detections predicted by a model learned from the others.</p>"
    yield '<div class="plots">'
    plot = calibration_plot(learned.calibration)
    yield _figure(plot.title, draw(plot, "calibration") or "")
    yield f"</div>{table(calibration_table(learned.calibration))}</section>"


def _existence(learned: LearnedExistence | None) -> Iterator[str]:
    """The second stage: weights, and whether probabilities mean what they say."""
    yield '<section id="existence"><h2>How sure to be</h2>'
    if learned is None:
        yield '<p class="quiet">Not learned: the sequences were not mapped. The weights are the defaults.</p></section>'
        return
    yield f"<p>{escape(_sentence(learned.summary()))}</p>"
    if learned.fitted:
        model = learned.model.existence
        yield f"<p>{escape(_WEIGHTS)}</p>"
        yield f'<div class="tables">{table(weight_table(model))}{table(prior_table(model))}</div>'
    if learned.calibration is not None:
        yield f"<h3>On sequences left out</h3><p>{escape(_RELIABILITY)}</p>"
        shown = {"existence": learned.calibration.existence, "class": learned.calibration.label}
        titles = {name: f"Reliability of {name}" for name in shown}
        plots = [(name, reliability_plot(titles[name], reliability)) for name, reliability in shown.items()]
        pictures = "".join(_figure(plot.title, draw(plot, f"reliability-{name}") or "") for name, plot in plots)
        tables = "".join(table(reliability_table(titles[name], reliability)) for name, reliability in shown.items())
        yield f'<div class="plots">{pictures}</div><div class="tables">{tables}</div>'
    yield "</section>"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _numbers(learned: Learned) -> str:
    scores = learned.model.scores
    wrong = ", ".join(f"{scores.confusion[part]:.2f} {PARTS[part]}" for part in templates(learned.samples))
    return f"Share of detections that name another class: {wrong}."

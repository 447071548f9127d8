import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from made_up_reports import NASTY, make_protocol, make_report
from rich.console import Console

from thingmap.mapper.evaluation.reporting.page import render_page
from thingmap.mapper.evaluation.reporting.pictures import crop
from thingmap.mapper.evaluation.reporting.report import read_report, write_report
from thingmap.mapper.evaluation.reporting.terminal import print_report
from thingmap.mapper.evaluation.result import Better, Metric, Table

VOID = {"meta", "br", "img", "link", "hr", "input"}


class Page(HTMLParser):
    """Elements, attributes and text of a page; fails where an element is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    def elements(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.seen if name == tag]


@pytest.fixture
def report():
    other = make_protocol("honesty", Metric("count ratio", 1.5, "", Better.NEAR_ONE), Metric("unknown", None, "m"))
    return make_report(make_protocol(), other, run={"map": NASTY, "source": NASTY, "frames in common": 9})


@pytest.fixture
def pictures(report):
    color = np.zeros((48, 64, 3), np.uint8)
    cases = [case for result in report.results for case in result.worst if case.frame is not None]
    return {case: crop(color, case.truth_xyxy, case.found_xyxy) for case in cases}


@pytest.fixture
def page(report, pictures):
    return render_page(report, pictures)


def test_everything_is_on_the_page(page, report):
    parsed = Page(page)
    text = " ".join(parsed.texts)
    for part in (
        "0.750", "0.0123", "centre error", "count ratio", "a paper & its section", "By class", "0.250", "cup 3 was",
        "cup 4 has no picture", "the truth has no labelled points", "1 thing left out.", "Objects below 25 %",
        "SE(3) by poses", "path_lengths", "3, 7, 10, 12", f"evaluator {report.evaluator}",
    ):  # fmt: skip
        assert part in text, part
    assert text.index("Title of honesty") < text.index("a paper & its section")  # the numbers come first
    ids = [a["id"] for _, a in parsed.seen if a.get("id")]
    assert len(ids) == len(set(ids))
    targets = {a["href"] for a in parsed.elements("a")}
    assert targets and all(str(target)[1:] in ids for target in targets)


def test_what_was_given_is_text_not_markup(page):
    parsed = Page(page)
    assert not parsed.elements("script") and "<script" not in page
    assert sum(NASTY in text for text in parsed.texts) >= 5


def test_nothing_is_fetched(page):
    assert not re.search(r"https?://", page)
    assert not re.search(r"@import|url\((?!#)", page)
    parsed = Page(page)
    sources = [a[name] or "" for _, a in parsed.seen for name in ("src", "href") if name in a]
    assert sources and all(source.startswith(("#", "data:image/jpeg;base64,")) for source in sources)
    assert not [tag for tag, _ in parsed.seen if tag in {"link", "script", "iframe", "object"}]
    policy = [a["content"] for a in parsed.elements("meta") if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy and policy[0].startswith("default-src 'none'")


def test_the_same_report_is_the_same_page(report, pictures, page, tmp_path):
    assert render_page(report, pictures) == page
    write_report(report, page, tmp_path)
    assert render_page(read_report(tmp_path), pictures) == page


def test_pictures_show_their_boxes(page, pictures):
    parsed = Page(page)
    shown = parsed.elements("image")
    assert len(shown) == 4  # two protocols of two
    stored = {base64.b64decode((a["href"] or "").split(",", 1)[1]) for a in shown}
    assert stored == {picture.jpeg for picture in pictures.values()}
    boxes = [a["class"] for a in parsed.elements("rect") if a.get("class")]
    assert boxes.count("box-truth") == 4 and boxes.count("box-found") == 2


def test_without_pictures_the_cases_are_told(report):
    text = " ".join(Page(render_page(report, {})).texts)
    assert "cup 3 was never found" in text and "frame 1" in text


@pytest.mark.parametrize(("rows", "for_programs", "folded"), [(40, False, 0), (41, False, 1), (2, True, 1)])
def test_long_tables_and_those_for_programs_open_on_demand(rows, for_programs, folded):
    content = Table("Many", ("name", "value"), tuple((f"row {n}", n) for n in range(rows)), for_programs)
    result = replace(make_protocol(), tables=(content,))
    parsed = Page(render_page(make_report(result), {}))
    assert len(parsed.elements("details")) == folded and f"row {rows - 1}" in parsed.texts


def test_an_empty_report_is_a_page():
    report = replace(make_report(), results=(), skipped={}, notes=(), run={}, alignment={})
    assert "Evaluation of a map" in " ".join(Page(render_page(report, {})).texts)


@pytest.mark.parametrize("width", [30, 80, 200])
def test_the_terminal_shows_every_metric(report, width):
    out = io.StringIO()
    print_report(report, Console(file=out, width=width))
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    text = " ".join(out.getvalue().split())
    for part in ("note: 1 thing left out.", "0.750", "0.0123", "1.50", "–", "not evaluated: lai"):
        assert part in text
    if width == 80:
        assert any(line.split() == ["centre", "error", "0.0123", "m", "↓"] for line in lines)
        assert "not evaluated: lai: the truth has no labelled points" in lines

import re
from itertools import pairwise
from xml.etree import ElementTree

import pytest

from thingmap.mapper.evaluation.reporting.plots import MOST_POINTS, draw, legend
from thingmap.mapper.evaluation.result import Plot, PlotKind, Series

NAN = float("nan")


def make_plot(*series: Series, **changes) -> Plot:
    return Plot(**({"title": "T & <t>", "x_label": "recall", "y_label": "precision $_a", "series": series, **changes}))


def numbers(d: str) -> list[float]:
    return [float(x) for x in re.findall(r"-?\d+\.?\d*", d)]


def paths(svg: str, variable: str) -> list[ElementTree.Element]:
    return [e for e in ElementTree.fromstring(svg).iter("path") if f"var({variable})" in e.get("style", "")]


LINE = Series("a", (0.0, 0.5, 1.0), (0.0, 0.5, 1.0))


def test_the_picture_is_well_formed_and_needs_nothing_else():
    svg = draw(make_plot(LINE), "r1-1")
    assert svg is not None
    ElementTree.fromstring(svg)
    assert "http" not in svg and "<style" not in svg and "font-family" not in svg and "DejaVu" not in svg
    assert "precision $_a" in svg  # not taken for mathematics
    assert 'aria-label="T &amp; &lt;t&gt;: precision $_a over recall"' in svg


def test_the_same_plot_is_the_same_bytes():
    plot = make_plot(LINE, Series("b", (0.1, 0.9), (0.2, 0.3), PlotKind.POINTS), limits=(0, 1, 0, 1))
    assert draw(plot, "k") == draw(plot, "k")


def test_two_pictures_share_no_id():
    first, second = (draw(make_plot(LINE), key) for key in ("r1-1", "r1-2"))
    assert first is not None and second is not None
    ids = [set(re.findall(r'\bid="([^"]+)"', svg)) for svg in (first, second)]
    assert ids[0] and not ids[0] & ids[1]
    for svg, known in zip((first, second), ids, strict=True):
        used = set(re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', svg))
        assert used and all((a or b) in known for a, b in used)


def test_a_line_goes_where_its_numbers_say():
    svg = draw(make_plot(LINE, limits=(0, 1, 0, 1)), "k")
    assert svg is not None
    (line,) = paths(svg, "--series-1")
    xy = numbers(line.get("d", ""))
    assert xy[0] < xy[-2] and xy[1] > xy[-1]  # to the right and upwards


def test_colors_are_left_to_the_page():
    svg = draw(make_plot(LINE, LINE, LINE), "k")
    assert svg is not None
    assert {f"--series-{n}" for n in (1, 2, 3)} <= set(re.findall(r"--series-\d", svg))
    assert not re.search(r"#[0-9a-f]{6}", svg)


def test_bars_are_as_high_and_stand_beside_each_other():
    first = Series("a", (0.5, 1.5), (2.0, 4.0), PlotKind.BARS)
    second = Series("b", (0.5, 1.5), (1.0, 1.0), PlotKind.BARS)
    svg = draw(make_plot(first, second), "k")
    assert svg is not None
    boxes = []
    for number in (1, 2):
        for bar in paths(svg, f"--series-{number}"):
            xy = numbers(bar.get("d", ""))
            boxes.append((min(xy[::2]), max(xy[::2]), max(xy[1::2]) - min(xy[1::2])))
    assert boxes[1][2] == pytest.approx(2 * boxes[0][2], rel=0.01)
    edges = sorted(boxes)
    assert all(left[1] < right[0] for left, right in pairwise(edges))


def test_gaps_and_nothing():
    assert draw(make_plot(), "k") is None
    assert draw(make_plot(Series("a", (), ())), "k") is None
    assert draw(make_plot(Series("a", (0.0, 1.0), (NAN, NAN))), "k") is None
    some = make_plot(Series("a", (0.0, 1.0), (NAN, NAN)), Series("b", (0.5,), (0.5,)))
    assert draw(some, "k") is not None
    assert [entry.name for entry in legend(some)] == ["a (no values)", "b"]


def test_equal_axes_keep_a_circle_round():
    square = Series("s", (0.0, 4.0, 4.0, 0.0, 0.0), (0.0, 0.0, 1.0, 1.0, 0.0))
    svg = draw(make_plot(square, equal=True), "k")
    assert svg is not None
    xy = numbers(paths(svg, "--series-1")[0].get("d", ""))
    assert (max(xy[::2]) - min(xy[::2])) == pytest.approx(4 * (max(xy[1::2]) - min(xy[1::2])), rel=0.01)


def ticks(svg: str) -> list[str]:
    return re.findall(r">([−\d.]+)</text>", svg)


def test_what_cannot_be_halved_has_no_halves():
    counts = draw(make_plot(Series("n", (0.1, 0.2, 0.3), (1.0, 2.0, 0.0), PlotKind.BARS), y_label="n"), "k")
    assert counts is not None and {"0", "1", "2"} <= set(ticks(counts)) and "0.5" not in ticks(counts)
    views = draw(make_plot(Series("AP", (2.0, 3.0, 4.0), (0.1, 0.2, 0.3))), "k")
    assert views is not None and {"2", "3", "4"} <= set(ticks(views)) and "2.5" not in ticks(views)


@pytest.mark.parametrize(("value", "end"), [(0.0, "1.0"), (50.0, "50"), (-3.0, "−3")])
def test_a_single_value_is_shown_against_zero(value, end):
    svg = draw(make_plot(Series("a", (0.1, 0.2), (value, value))), "k")
    assert svg is not None
    labels = ticks(svg)
    assert any(label.startswith(end) for label in labels) and any(label in ("0", "0.0", "0.00") for label in labels)
    assert value < 0.0 or not any(label.startswith("−") for label in labels)


def test_series_differ_without_color():
    entries = legend(make_plot(*[LINE] * 20))
    assert len({(entry.color, entry.dashes) for entry in entries}) == 20
    assert len({entry.dashes for entry in entries[:4]}) == 4 == len({entry.marker for entry in entries[:4]})


def test_many_points_are_thinned_and_it_is_said():
    many = Series("p", tuple(map(float, range(2 * MOST_POINTS))), (0.0,) * (2 * MOST_POINTS), PlotKind.POINTS)
    svg = draw(make_plot(many), "k")
    assert svg is not None and MOST_POINTS <= svg.count("<use") < MOST_POINTS + 40
    assert legend(make_plot(many))[0].name == "p (1 of 2 points shown)"

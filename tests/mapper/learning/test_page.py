import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from thingmap.mapper.learning.learn import learn
from thingmap.mapper.learning.page import render_page
from thingmap.mapper.learning.plots import draw_scores
from thingmap.mapper.learning.samples import Tally
from thingmap.mapper.learning.summary import class_table, notes, size_rates, templates


@pytest.fixture(scope="module")
def learned(make_samples):
    return learn(make_samples(parts=2), "mine?a=1&b=<2>")


def test_the_table_counts_what_was_learned_from(learned):
    table = class_table(learned)
    rows = {row[0]: row[1:] for row in table.rows}
    samples = learned.samples
    assert list(rows) == ["cup", "bowl", "book", "all classes"]
    assert rows["all classes"][0] == (samples.found & (samples.part == 0)).sum()
    assert rows["all classes"][1] == rows["cup"][1] + rows["bowl"][1] + rows["book"][1]
    assert rows["cup"][2] + rows["bowl"][2] + rows["book"][2] == rows["all classes"][2]
    assert rows["cup"][3] > rows["cup"][4] > rows["cup"][5]


def test_curves_go_through_what_was_counted(learned):
    rates = size_rates(learned, np.ones(len(learned.samples.part), dtype=bool), 0)
    assert len(rates) == 4 and sum(int(rate.trials.sum()) for rate in rates) == (learned.samples.part == 0).sum()
    for rate in rates:
        many = rate.trials > 50
        expected = np.interp(rate.visible, rate.share, rate.curve)
        assert rate.rate[many] == pytest.approx(expected[many], abs=0.15)


def test_the_page_stands_alone_and_is_the_same_again(learned):
    page = render_page(learned)
    assert page == render_page(learned)
    assert "://" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", page) and "$" not in page
    assert "mine?a=1&amp;b=&lt;2&gt;" in page
    assert page.count("<svg class=") == 4 * 2 + 2 + 3 + 1  # scores of 3 + 1 by template, P_D, calibration
    ids = re.findall(r'\bid="([^"]*)"', page)
    assert len(ids) == len(set(ids))
    assert templates(learned.samples) == (0, 1)


def test_the_picture_is_well_formed_and_has_both_bands(learned):
    svg = draw_scores(learned.model.scores, 0, 0, learned.votes[0, 0], "key", "<cup>")
    ET.fromstring(svg.replace("href=", "h="))
    assert "var(--series-1)" in svg and "var(--series-2)" in svg and "&lt;cup&gt;" in svg


def test_what_was_left_out_is_said():
    tally = Tally(["a"], 3, {"no camera pose": ["x", "y"]}, weak=4, no_depth=5, incomplete=["a"])
    tally.strangers["ghost"] = 2
    said = "; ".join(notes(tally))
    for part in ("2 frames with no camera pose", "2 ghost", "5 times", "4 boxes", "no false detections: a"):
        assert part in said
    assert notes(Tally(["a"], 3)) == []

"""The page in a real browser: it opens without a complaint or a request, and shows what the user asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.view.page.write import export_html

HOSTILE = "</script><img src=x onerror=\"document.title='taken'\">"


@pytest.fixture(scope="session")
def page_file(folder: OutputFolder, wall_sequence: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("page") / "map.html"
    assert export_html(folder, file, sequence=wall_sequence()) == 3
    return file


@pytest.fixture
def tab(open_tab: Callable[..., Any], page_file: Path) -> Any:
    return open_tab(page_file)


def test_it_opens_and_draws_cloud_and_boxes(tab: Any) -> None:
    assert tab.text("#source") == "table"
    assert "3 things" in tab.text("#facts") and "4 of them keyframes" in tab.text("#facts")
    assert tab.requests == [tab.page.url]  # nothing else was fetched, not from disk either
    assert tab.page.locator("#message").is_hidden()
    colors = canvas_colors(tab)
    assert (180, 170, 160) in {tuple(rgb) for rgb in colors}  # an unshaded point of the wall
    tab.page.click("#tools [data-show=cloud]")
    assert (180, 170, 160) not in {tuple(rgb) for rgb in canvas_colors(tab)}


def canvas_colors(tab: Any) -> list[list[int]]:
    """RGB that occur in the picture."""
    tab.settle()
    return tab.page.evaluate(
        """() => new Promise(done => requestAnimationFrame(() => {
          thingmap.look({});
          requestAnimationFrame(() => {
            const canvas = document.getElementById("canvas"), copy = document.createElement("canvas");
            copy.width = canvas.width; copy.height = canvas.height;
            const context = copy.getContext("2d");
            context.drawImage(canvas, 0, 0);
            const data = context.getImageData(0, 0, copy.width, copy.height).data, seen = new Set();
            for (let k = 0; k < data.length; k += 4)
              if (data[k + 3] === 255) seen.add((data[k] << 16) | (data[k + 1] << 8) | data[k + 2]);
            done([...seen].map(c => [c >> 16, (c >> 8) & 255, c & 255]));
          });
        }))"""
    )


def test_things_are_listed_by_probability_and_the_slider_leaves_out_what_is_less_probable(tab: Any) -> None:
    tab.page.locator("#threshold").fill("0")
    assert tab.listed() == ["thing-0001", "thing-0002", "thing-0003"]
    tab.page.locator("#threshold").fill("0.5")
    assert tab.listed() == ["thing-0001", "thing-0002"]  # 0.95 * 0.9, 0.95 * 0.7; the book has 0.6 * 0.6
    tab.page.locator("#threshold").fill("0.8")
    assert tab.listed() == ["thing-0001"] and tab.text("#count") == "1 of 3 things"
    assert tab.page.evaluate("thingmap.shown()") == ["thing-0001"]


def test_search_ranks_by_the_probability_of_what_was_asked_for(tab: Any) -> None:
    tab.page.locator("#threshold").fill("0")
    tab.page.fill("#search", "BOW")
    assert tab.listed() == ["thing-0002", "thing-0003", "thing-0001"]  # .95 * .7, .6 * .4 and .95 * .1
    tab.page.fill("#search", "thing-0002")
    assert tab.listed() == ["thing-0002"]
    tab.page.fill("#search", "mug")  # another word for a cup
    assert tab.listed()[0] == "thing-0001"
    tab.page.fill("#search", "elephant")
    assert tab.listed() == [] and tab.text("#count").startswith("0 of 3")


def test_a_class_is_left_out_and_taken_in_again(tab: Any) -> None:
    tab.page.click('.chip[data-label="cup"]')
    assert tab.listed() == ["thing-0002"]
    tab.page.click('.chip[data-label="cup"]')
    assert tab.listed() == ["thing-0001", "thing-0002"]


def test_a_click_in_the_list_shows_everything_about_the_thing(tab: Any) -> None:
    tab.page.click('.row[data-id="thing-0001"]')
    text = tab.text("#detail")
    assert "cup" in tab.text("#detail h2") and "thing-0001" in text and "85.5 %" in text  # 0.95 * 0.9
    assert tab.page.locator("#posterior .number").all_inner_texts() == ["90.0 %", "10.0 %"]
    for number in ("-50.0 ± 1.0", "150.0 ± 3.0", "20.0 ± 1.0", "12.0 ± 2.0"):
        assert number in text.replace("\xa0", " ")
    assert "10 views: 6 supported, 1 contradicted (1 missed), 3 said nothing" in text
    assert "2 that said nothing are not drawn" in text
    assert tab.page.locator("#timeline circle").count() == 8
    assert tab.page.locator(".crop.for").count() == 3 and tab.page.locator(".crop.against").count() == 1
    crops = tab.page.locator(".crop img")  # read by and by; one that cannot be read is an error here
    widths = crops.evaluate_all("all => Promise.all(all.map(image => image.decode().then(() => image.naturalWidth)))")
    assert len(widths) == 4 and all(widths)


def test_the_timeline_says_what_a_view_said_and_looks_from_there(tab: Any) -> None:
    tab.page.click('.row[data-id="thing-0001"]')
    tab.settle()
    tab.page.locator("#timeline").hover(position={"x": 331, "y": 50})  # the last view
    said = tab.text("#said")
    assert "frame-000007" in said and "score 0.75" in said and "80 % visible" in said and "+3.00" in said
    before = tab.page.evaluate("thingmap.project('thing-0002')")
    tab.page.locator("#timeline").click(position={"x": 331, "y": 50})
    tab.settle()
    assert tab.page.evaluate("thingmap.project('thing-0002')") != before
    tab.page.locator("#timeline").focus()
    tab.page.keyboard.press("ArrowRight")
    tab.page.keyboard.press("ArrowLeft")
    assert "frame-000006" in tab.text("#said") and "contradicted" in tab.text("#said")


@pytest.mark.parametrize("thing", ["thing-0001", "thing-0002"])
def test_a_click_on_a_box_in_the_picture_shows_that_thing(tab: Any, thing: str) -> None:
    at = tab.page.evaluate(f"thingmap.project('{thing}')")
    tab.page.mouse.click(at["x"], at["y"])
    assert thing in tab.text("#detail header")
    assert tab.page.locator(".tag.chosen").get_attribute("data-id") == thing
    tab.page.keyboard.press("Escape")
    assert tab.page.locator("#detail").is_hidden()


def test_a_click_beside_all_boxes_chooses_nothing(tab: Any) -> None:
    tab.page.mouse.click(260, 500)
    assert tab.page.locator("#detail").is_hidden()


def test_dragging_turns_the_wheel_zooms_and_reset_goes_back(tab: Any) -> None:
    where = lambda: tab.page.evaluate("thingmap.project('thing-0001')")  # noqa: E731
    start = where()
    tab.page.mouse.move(700, 600)
    tab.page.mouse.down()
    tab.page.mouse.move(800, 620, steps=3)
    tab.page.mouse.up()
    turned = where()
    assert abs(turned["x"] - start["x"]) > 5
    assert tab.page.locator("#detail").is_hidden()  # a drag is no click
    tab.page.mouse.wheel(0, -300)
    tab.settle()
    assert where() != turned
    tab.page.keyboard.press("r")
    tab.settle()
    assert where() == pytest.approx(start, abs=0.5)


def test_double_click_goes_to_a_thing(tab: Any) -> None:
    at = tab.page.evaluate("thingmap.project('thing-0001')")
    tab.page.mouse.dblclick(at["x"], at["y"])
    tab.settle()
    box, now = tab.page.locator("#canvas").bounding_box(), tab.page.evaluate("thingmap.project('thing-0001')")
    assert now["x"] == pytest.approx(box["x"] + box["width"] / 2, abs=2)
    assert now["y"] == pytest.approx(box["y"] + box["height"] / 2, abs=2)


def test_the_keyboard_reaches_a_thing(tab: Any) -> None:
    tab.page.keyboard.press("/")
    tab.page.keyboard.type("bowl")
    tab.page.keyboard.press("ArrowDown")
    tab.page.keyboard.press("Enter")
    assert "thing-0002" in tab.text("#detail header")


def test_names_do_not_cover_one_another(
    make_folder: Callable[..., OutputFolder],
    make_thing: Callable[..., Thing],
    open_tab: Callable[..., Any],
    tmp_path: Path,
) -> None:
    crowd = [make_thing(k, position=[0.03 * (k % 5), 0.03 * (k // 5), 1.5]) for k in range(1, 21)]
    export_html(make_folder(tmp_path / "run", *crowd), tmp_path / "map.html", crops=False)
    tab = open_tab(tmp_path / "map.html")
    tab.settle()
    boxes = tab.page.locator(".tag").evaluate_all(
        "tags => tags.filter(t => t.style.visibility === 'visible').map(t => t.getBoundingClientRect().toJSON())"
    )
    assert 3 <= len(boxes) <= 20
    for k, a in enumerate(boxes):
        for b in boxes[:k]:
            apart = (
                a["right"] <= b["left"] or b["right"] <= a["left"] or a["bottom"] <= b["top"] or b["bottom"] <= a["top"]
            )
            assert apart


def test_on_a_phone_nothing_is_wider_than_the_screen(open_tab: Callable[..., Any], page_file: Path) -> None:
    tab = open_tab(page_file, 390, 844, has_touch=True, is_mobile=True)
    tab.page.tap('.row[data-id="thing-0001"]')
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390
    box = tab.page.locator("#detail").bounding_box()
    assert box["width"] == 390 and box["y"] > 300


def test_text_of_a_map_stays_text(
    make_folder: Callable[..., OutputFolder],
    make_thing: Callable[..., Thing],
    open_tab: Callable[..., Any],
    tmp_path: Path,
) -> None:
    thing = make_thing(1, HOSTILE, 0.9, position=[0.0, 0.0, 1.5], size=[0.2, 0.2, 0.2])
    run = make_folder(tmp_path / "run", thing, source=HOSTILE, classes=(HOSTILE,))
    export_html(run, tmp_path / "map.html")
    tab = open_tab(tmp_path / "map.html")
    tab.page.click("#list .row")
    assert HOSTILE in tab.text("#detail h2") and tab.text("#source") == HOSTILE
    assert tab.page.locator("img").count() == 0 and tab.page.title().startswith(HOSTILE)


def test_the_policy_forbids_requests_and_scripts(tab: Any) -> None:
    blocked = tab.page.evaluate(
        """async () => {
          const image = new Image();
          const failed = new Promise(done => { image.onerror = () => done(true); image.onload = () => done(false); });
          image.src = "https://example.com/x.png";
          document.body.insertAdjacentHTML("beforeend", "<button id=evil onclick='window.taken = true'></button>");
          document.getElementById("evil").click();
          const refused = await fetch("https://example.com").then(() => false, () => true);
          return [await failed, window.taken === undefined, refused];
        }"""
    )
    assert blocked == [True, True, True]
    refused = [text for text in tab.complaints if "Content Security Policy" in text]
    assert len(refused) >= 3
    tab.complaints.clear()  # they were asked for
    tab.requests.clear()


def test_a_map_without_things_or_cloud_says_so(
    make_folder: Callable[..., OutputFolder], open_tab: Callable[..., Any], tmp_path: Path
) -> None:
    assert export_html(make_folder(tmp_path / "run", cloud=False), tmp_path / "map.html") == 0
    tab = open_tab(tmp_path / "map.html")
    assert tab.text("#count") == "The map holds no things."
    assert tab.page.locator("#message").is_hidden()


def test_a_thing_without_views_or_images_says_why(
    make_folder: Callable[..., OutputFolder], things: tuple[Thing, ...], open_tab: Callable[..., Any], tmp_path: Path
) -> None:
    export_html(make_folder(tmp_path / "run", *things), tmp_path / "map.html")
    tab = open_tab(tmp_path / "map.html")
    tab.page.click('.row[data-id="thing-0001"]')
    assert "gone" in tab.text("#no-crops") and "--sequence" in tab.text("#no-crops")
    tab.page.click('.row[data-id="thing-0002"]')
    evidence = Evidence(12, 3, 1)
    assert f"{evidence.supporting} views supported it" in tab.text("#detail")
    assert "Nothing is on record" in tab.text("#detail")


def test_a_browser_without_webgl_still_lists_the_things(chromium: Any, page_file: Path) -> None:
    context = chromium.new_context()
    try:
        page = context.new_page()
        page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
        page.goto(page_file.as_uri())
        page.wait_for_selector("#list .row")
        assert "cannot draw the map in 3D" in page.locator("#message").inner_text()
        page.click('.row[data-id="thing-0001"]')
        assert "thing-0001" in page.locator("#detail").inner_text()
    finally:
        context.close()

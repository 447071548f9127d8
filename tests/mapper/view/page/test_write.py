"""The file that `export_html` writes, without a browser: what is in it, and what it says of mistakes."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Thing
from thingmap.mapper.view.page.colors import PALETTE, page_colors
from thingmap.mapper.view.page.document import SCRIPTS, part
from thingmap.mapper.view.page.start import start_view
from thingmap.mapper.view.page.write import export_html


def block(file: Path, name: str) -> bytes:
    found = re.search(f'id="data-{name}">([^<]*)<', file.read_text(encoding="utf-8"))
    assert found is not None
    return base64.b64decode(found[1])


def content(file: Path) -> dict[str, Any]:
    return json.loads(zlib.decompress(block(file, "map")))


def test_the_same_run_gives_the_same_file(folder: OutputFolder, wall_sequence: Any, tmp_path: Path) -> None:
    for name in ("a.html", "b.html"):
        export_html(folder, tmp_path / name, sequence=wall_sequence())
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_nothing_of_it_is_anywhere_else(folder: OutputFolder, tmp_path: Path) -> None:
    export_html(folder, tmp_path / "map.html")
    text = (tmp_path / "map.html").read_text(encoding="utf-8")
    assert set(re.findall(r"https?://[^\"' ]+", text)) == {"http://www.w3.org/2000/svg"}  # a name, not an address
    assert "default-src 'none'" in text and "unsafe" not in text
    assert "%%" not in text
    assert str(folder.path) not in text


def test_it_holds_the_numbers_of_the_map(folder: OutputFolder, things: tuple[Thing, ...], tmp_path: Path) -> None:
    export_html(folder, tmp_path / "map.html", points=500)
    page = content(tmp_path / "map.html")
    assert page["cloud"]["count"] <= 500 and page["cloud"]["of"] == 4000
    assert [thing["id"] for thing in page["things"]] == ["thing-0001", "thing-0002", "thing-0003"]
    cup, R = page["things"][0], folder.read_map().R_world_upright
    np.testing.assert_allclose(R @ np.array(cup["center"]), things[0].position, atol=1e-5)
    covariance = R @ np.array(cup["covariance"]).reshape(3, 3) @ R.T
    np.testing.assert_allclose(covariance, things[0].position_covariance, atol=1e-8)
    for row in cup["views"]["rows"]:
        pose = page["cameras"]["poses"][row[1]]
        np.testing.assert_allclose((R @ pose[:3])[0], 0.04 * row[0], atol=1e-3)  # 0.02 m a frame of 0.5 s


def test_an_image_that_cannot_be_read_has_no_crop(folder: OutputFolder, wall_sequence: Any, tmp_path: Path) -> None:
    export_html(folder, tmp_path / "all.html", sequence=wall_sequence())
    export_html(folder, tmp_path / "some.html", sequence=wall_sequence(broken=(7,)))
    stamps = [{c["stamp"] for c in content(tmp_path / f)["things"][0]["crops"]} for f in ("all.html", "some.html")]
    assert stamps[0] - stamps[1] == {3.5}
    crops = block(tmp_path / "all.html", "crops")
    for crop in content(tmp_path / "all.html")["things"][0]["crops"]:
        assert crops[crop["at"] :][:2] == b"\xff\xd8"  # a JPEG begins here


def test_crops_are_left_out_where_nobody_wants_them(folder: OutputFolder, wall_sequence: Any, tmp_path: Path) -> None:
    export_html(folder, tmp_path / "map.html", sequence=wall_sequence(), crops=False)
    page = content(tmp_path / "map.html")
    assert not page["things"][0]["crops"] and "without crops" in page["crops_note"]


def test_mistakes_are_named(folder: OutputFolder, wall_sequence: Any, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="--points"):
        export_html(folder, tmp_path / "map.html", points=-1)
    with pytest.raises(UserError, match="nowhere"):
        export_html(folder, tmp_path / "map.html", sequence=str(tmp_path / "nowhere"))
    other = wall_sequence()
    other.stamps = other.stamps + 0.1
    with pytest.raises(UserError, match="8 of its 8 mapped frames are not in wall"):
        export_html(folder, tmp_path / "map.html", sequence=other)
    assert not (tmp_path / "map.html").exists()


def test_a_damaged_cloud_is_named(
    make_folder: Callable[..., OutputFolder], things: tuple[Thing, ...], tmp_path: Path
) -> None:
    run = make_folder(tmp_path / "run", *things)
    run.cloud_file.write_text("nonsense")
    with pytest.raises(InputError, match="cloud"):
        export_html(run, tmp_path / "map.html")


def test_twelve_classes_have_twelve_colours_and_more_go_round_again() -> None:
    names = [f"class {k}" for k in range(30)]
    first = {tuple(rgb) for rgb in list(page_colors(names).values())[:12]}
    assert first == {tuple(rgb) for rgb in PALETTE}
    assert set(page_colors(names)) == set(names)


def test_the_first_view_has_the_things_in_its_middle_and_looks_from_the_cameras_side() -> None:
    corners = np.array([[[x, y, z] for x in (1.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]])
    start = start_view(corners, np.empty((0, 3)), np.array([[1.5, -4.0, 1.0]]))
    np.testing.assert_allclose(start["target"], [1.5, 0.5, 0.5], atol=1e-6)
    assert start["azimuth"] == pytest.approx(-np.pi / 2.0, abs=1e-3)
    among = start_view(corners, np.empty((0, 3)), np.array([[1.5, 0.4, 1.0]]))
    assert among["elevation"] > start["elevation"]
    assert start_view(np.empty((0, 8, 3)), np.empty((0, 3)), np.empty((0, 3)))["radius"] > 0.0


def test_every_part_of_the_script_is_short_and_says_what_it_is_for() -> None:
    for name in SCRIPTS:
        lines = part(name).splitlines()
        assert lines[0].startswith("// ") and len(lines) <= 260, name

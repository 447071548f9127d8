"""`thingmap view`: it writes the page, keeps it while the map is the same, and opens the browser."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from thingmap.datasets.errors import InputError
from thingmap.mapper.cli.view import PAGE_NAME, view
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Thing

app = typer.Typer()
app.command()(view)


@pytest.fixture
def run(make_folder: Callable[..., OutputFolder], things: tuple[Thing, ...], tmp_path: Path) -> OutputFolder:
    folder = make_folder(tmp_path / "run", *things)
    for file in folder.path.iterdir():
        os.utime(file, (1e9, 1e9))
    return folder


def call(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.stdout


def test_the_page_is_made_once_and_again_when_the_map_is_newer(run: OutputFolder) -> None:
    page = run.path / PAGE_NAME
    assert "3 things" in call(run.path, "--no-open") and page.is_file()
    os.utime(page, (2e9, 2e9))
    assert call(run.path, "--no-open").strip() == str(page)
    assert page.stat().st_mtime == 2e9
    assert "3 things" in call(run.path, "--no-open", "--points", 100)  # numbers were asked for
    os.utime(page, (2e9, 2e9))
    os.utime(run.map_file, (3e9, 3e9))
    assert "3 things" in call(run.path, "--no-open")


def test_the_browser_is_given_the_file(run: OutputFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(url) or True)
    call(run.path, "-o", tmp_path / "other name.html", "--no-crops")
    assert opened == [(tmp_path / "other name.html").as_uri()]


def test_a_file_that_is_no_page_stays(run: OutputFolder, tmp_path: Path) -> None:
    notes = tmp_path / "notes.html"
    notes.write_text("my notes")
    with pytest.raises(InputError, match="another file"):
        call(run.path, "-o", notes, "--no-open")
    assert notes.read_text() == "my notes"


def test_a_folder_without_a_map_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no map\.json"):
        call(tmp_path, "--no-open")

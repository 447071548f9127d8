"""How to install an extra, told from how thingmap was installed."""

import importlib.metadata
import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from thingmap.datasets import extras


def came_from(monkeypatch: pytest.MonkeyPatch, origin: str | None) -> None:
    installed = SimpleNamespace(read_text=lambda name: origin if name == "direct_url.json" else None)
    monkeypatch.setattr(extras, "distribution", lambda name: installed)


def test_from_a_folder_it_is_that_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = tmp_path / "thing map"
    folder.mkdir()
    came_from(monkeypatch, json.dumps({"url": folder.as_uri(), "dir_info": {}}))
    assert extras.install_command("view").endswith(f'pip install "{folder}[view]"')
    folder.rmdir()
    assert extras.install_command("view").endswith('pip install "thingmap[view]"')


@pytest.mark.parametrize("origin", [None, json.dumps({"url": "https://example.org/thingmap.whl", "archive_info": {}})])
def test_from_an_index_or_an_address_it_is_the_name(monkeypatch: pytest.MonkeyPatch, origin: str | None) -> None:
    came_from(monkeypatch, origin)
    assert extras.install_command("usd").endswith('pip install "thingmap[usd]"')


def test_what_is_not_installed_has_no_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(extras, "distribution", none)
    assert "thingmap[ros]" in extras.install_command("ros")


def test_an_environment_without_pip_is_told_of_uv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    assert extras.install_command("view").startswith("uv pip install ")

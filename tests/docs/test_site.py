"""The documentation site: it builds without a warning, loads nothing from elsewhere, and knows every number."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "pages"))

import draw_concepts
from commands import commands_page
from configuration import configuration_page, field_comments, sections

from thingmap.mapper.config import MapperConfig

ROOT = Path(__file__).resolve().parents[2]
ELSEWHERE = re.compile(r"""<(?:script|link|img|iframe)[^>]+(?:src|href)=["']?(https?:)?//""")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for package in ("mkdocs", "material", "mkdocstrings"):
        pytest.importorskip(package, reason="the group `docs` is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=400)
    assert done.returncode == 0, done.stderr[-3000:]  # strict: a warning is an error
    return folder


def test_every_page_is_there_and_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 25
    for page in pages:
        assert not ELSEWHERE.search(page.read_text(encoding="utf-8")), page


def test_documented_classes_are_on_the_pages(site: Path) -> None:
    for page, words in (
        ("api/mapper.html", "process_frame"),
        ("api/map.html", "where_to_look"),
        ("api/datasets.html", "open_sequence"),
        ("reference/configuration.html", "translation"),
        ("reference/commands.html", "--max-frames"),
    ):
        assert words in (site / page).read_text(encoding="utf-8"), page


def test_every_number_of_the_configuration_is_listed() -> None:
    page = configuration_page()
    for path, section in [("", MapperConfig), *sections(MapperConfig)]:
        body = page.split(f"## `{path}`\n")[1] if path else page
        for name, value in inspect.get_annotations(section).items():
            nested = f"{path}.{name}" if path else name
            assert f"| `{name}` |" in body or f"## `{nested}`" in page, (nested, value)
    assert "| `translation` | `float` | `0.06` | m; about 3 degrees of parallax at 1.2 m |" in page


@dataclass(frozen=True)
class Commented:
    """Of comments that are wrapped, and of one above its field."""

    plain: float = 1.0  # m
    wrapped: int = 2  # px; a comment so long that its end is not beside the field any more, and goes on in its own
    # continuation
    # one for the next
    last: tuple[int, int] = (1, 2)


def test_comments_find_their_fields() -> None:
    told = field_comments(Commented)
    assert told["plain"] == "m"
    assert told["wrapped"].endswith("in its own continuation")
    assert told["last"] == "one for the next"


def test_every_command_is_listed() -> None:
    page = commands_page()
    tree = ast.parse((ROOT / "mapper" / "cli" / "main.py").read_text(encoding="utf-8"))
    names = {alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    for name in {"run", "query", "export", "evaluate", "synth"} & names:
        assert f"## thingmap {name}\n" in page
    assert "Usage: thingmap train hog" in page


def test_the_pictures_are_those_that_the_script_draws() -> None:
    for name, draw in draw_concepts.PICTURES.items():
        drawn = draw()
        ElementTree.fromstring(drawn)
        assert (ROOT / "docs" / "pictures" / f"{name}.svg").read_text(encoding="utf-8") == drawn, name


def test_what_the_pictures_say() -> None:
    existence = ElementTree.fromstring(draw_concepts.existence())
    heights = [float(c.get("cy", "nan")) for c in existence.iter("{http://www.w3.org/2000/svg}circle")]
    by_kind = dict.fromkeys("shm", 0.0)
    for view, before, after in zip(draw_concepts.VIEWS[1:], heights, heights[1:], strict=False):
        by_kind[view] += after - before  # downwards is less probable
    assert by_kind["s"] < 0.0 == by_kind["h"] < by_kind["m"]

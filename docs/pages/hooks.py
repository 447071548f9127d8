"""What MkDocs calls while it builds the site: pages made from the code, and links that leave the documents."""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from commands import commands_page
from configuration import configuration_page

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "out" / "package"  # what mkdocs.yml tells mkdocstrings to read
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((\.\./[^)#]+)[^)]*\)")


def on_startup(command: str, dirty: bool) -> None:
    """Makes a folder in which the four packages lie below `thingmap`: mkdocstrings reads files and imports nothing."""
    folder = PACKAGE / "thingmap"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("mapper", "factors", "detectors", "datasets"):
        with suppress(FileExistsError):  # made before, or by another build at the same time
            (folder / name).symlink_to(ROOT / name, target_is_directory=True)


def on_files(files: Any, config: Any) -> Any:
    """Adds the pages that are made from the code."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, "reference/configuration.md", content=configuration_page()))
    files.append(File.generated(config, "reference/commands.md", content=commands_page()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """A link to a file that is no document becomes its path: the site does not have the file."""
    folder = Path(config["docs_dir"]) / Path(page.file.src_uri).parent

    def plain(match: re.Match[str]) -> str:
        target = (folder / match[2]).resolve()
        if target.is_relative_to(config["docs_dir"]) or not target.exists():
            return match[0]  # one of the documents, or a mistake that MkDocs shall report
        return f"`{target.relative_to(ROOT)}`"

    return _LINK.sub(plain, markdown)

"""`thingmap view`: a map as a page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..map.store import OutputFolder

PAGE_NAME = "map.html"


def view(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help=f"Page to write; OUT/{PAGE_NAME} by default.")
    ] = None,
    points: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Points of the cloud, at most; 300000 by default.")
    ] = None,
    sequence: Annotated[
        str | None, typer.Option(metavar="SEQUENCE", help="What was mapped, where it is elsewhere now.")
    ] = None,
    crops: Annotated[
        bool | None, typer.Option("--crops/--no-crops", help="Whether images of the things are in it; they are.")
    ] = None,
    open_page: Annotated[bool, typer.Option("--open/--no-open", help="Whether the browser opens it.")] = True,
) -> None:
    """Look at a map in the browser.

    The page is one file that works offline and can be sent to others. It is made again where the map is newer, or where
    --points, --sequence or --crops say how.
    """
    from ..map.store import OutputFolder
    from ..view.page.write import POINTS, export_html

    source = OutputFolder.open(folder)
    file = output or source.path / PAGE_NAME
    as_usual = points is None and sequence is None and crops is None
    if not (_is_ours(file) and as_usual and _is_fresh(file, source)):
        things = export_html(
            source,
            file,
            points=POINTS if points is None else points,
            sequence=sequence,
            crops=crops is not False,
        )
        typer.echo(f"{things} things, {file.stat().st_size / 1e6:.1f} MB")
    typer.echo(file)
    if open_page:
        _open(file)


def _is_ours(file: Path) -> bool:
    """Whether a page of this version is there.

    Raises:
        InputError: something else is.
    """
    from ...datasets.errors import InputError
    from ..view.page.document import GENERATOR, HEAD_BYTES, is_page

    if not file.exists():
        return False
    head = b""
    if file.is_file():
        with file.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
    if not is_page(head):
        found = "a folder" if file.is_dir() else "another file"
        raise InputError(file, "a page of a map, or nothing", found, "choose another name with -o")
    return GENERATOR.encode() in head


def _is_fresh(file: Path, source: OutputFolder) -> bool:
    """Whether nothing that the page shows has changed since it was written."""
    from ..edits.journal import journal_path

    shown = (
        source.map_file,
        journal_path(source.map_file),
        source.evidence_file,
        source.cloud_file,
        source.labels_file,
        source.trajectory_file,
        source.keyframes_file,
        source.report_file,
    )
    written = file.stat().st_mtime_ns
    return all(part.stat().st_mtime_ns < written for part in shown if part.exists())


def _open(file: Path) -> None:
    """Where there is no browser, the path that was printed is enough."""
    import webbrowser

    if not webbrowser.open(file.resolve().as_uri()):
        typer.echo("no browser was found; open that file with one", err=True)

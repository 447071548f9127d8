"""`thingmap export`: a map for other tools."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Format(StrEnum):
    JSON = "json"
    CSV = "csv"
    PLY = "ply"


def export(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote.")],
    format: Annotated[
        Format, typer.Option("--format", help="json: map and box corners; csv: a row a thing; ply: cloud and boxes.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="File to write.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it is there.")] = False,
) -> None:
    """Write a map for other tools.

    Nothing but OUT is read.
    """
    from ...datasets.errors import InputError
    from ..export import exporter
    from ..map.store import OutputFolder

    source = OutputFolder.open(folder)
    if output.exists() and not overwrite:
        raise InputError(output, "a new file", "an existing one", "choose another name or add --overwrite")
    things = exporter(format.value)(source, output)
    typer.echo(f"{things} things are in {output}")

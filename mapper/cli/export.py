"""`thingmap export`: a map for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..export.formats import FORMATS, ExportFormat


def _list_formats(wanted: bool) -> None:
    if wanted:
        for line in format_lines():
            typer.echo(line)
        raise typer.Exit


def export(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="File to write.")],
    format: Annotated[
        str | None,
        typer.Option("--format", metavar="NAME", help="Told from FILE's ending by default; --formats explains them."),
    ] = None,
    points: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="glb, gltf, usd, html: of the cloud at most.")
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON[,BEARING]",
            help="geojson: where on Earth the plan's origin is and where its y axis points, degrees (from north).",
        ),
    ] = None,
    every: Annotated[int | None, typer.Option(min=1, metavar="K", help="coco: every Kth mapped frame.")] = None,
    sequence: Annotated[
        str | None, typer.Option(metavar="SEQUENCE", help="coco, html: what was mapped, where it is elsewhere now.")
    ] = None,
    dataset: Annotated[str | None, typer.Option(metavar="NAME", help="coco: loader of the sequence.")] = None,
    min_visibility: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, metavar="SHARE", help="coco: of a thing, to be annotated; 0.25.")
    ] = None,
    keyframes: Annotated[bool | None, typer.Option("--keyframes", help="tum, kitti: poses of keyframes only.")] = None,
    table: Annotated[
        str | None, typer.Option(metavar="TABLE", help="parquet: things (default), views or trajectory.")
    ] = None,
    min_existence: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, metavar="P", help="Leave out things that less probably exist.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it is there.")] = False,
    formats: Annotated[
        bool, typer.Option("--formats", callback=_list_formats, is_eager=True, help="List the formats and exit.")
    ] = False,
) -> None:
    """Write a map for other tools.

    Nothing but OUT is read, and for coco the sequence.
    """
    from ...datasets.errors import InputError, UserError
    from ..map.store import OutputFolder

    chosen = _choose(format, output)
    asked = {
        "points": points,
        "origin": origin,
        "every": every,
        "sequence": sequence,
        "dataset": dataset,
        "min_visibility": min_visibility,
        "keyframes": keyframes,
        "table": table,
        "min_existence": min_existence,
    }
    options = _options(chosen, {name: value for name, value in asked.items() if value is not None})
    source = OutputFolder.open(folder)
    if output.is_dir():
        raise InputError(output, "a file to write", "a folder", "give the name of a file in it")
    if output.exists() and not overwrite:
        raise InputError(output, "a new file", "an existing one", "choose another name or add --overwrite")
    if not output.parent.is_dir():  # before anything that takes long
        raise UserError(f"{output}: cannot be written (there is no folder {output.parent}); make it first")
    count = chosen.load()(source, output, **options)
    typer.echo(f"{count} {chosen.counts} are in {output}")


def format_lines() -> list[str]:
    """A line for each format: name, endings, what it holds, what it needs, its options."""
    width = max(len(one.name) for one in FORMATS)
    return [f"{one.name:<{width}}  {_about(one)}" for one in FORMATS]


def _about(one: ExportFormat) -> str:
    needs = [] if one.needs is None else [f"reads {one.needs}"]
    needs += [] if one.extra is None else [f"needs the extra {one.extra}"]
    options = [_spelled(name) for name in one.options if name != "say"]
    needs += [f"options {' '.join(options)}"] if options else []
    return f"{one.help}; {', '.join([' '.join(one.endings), *needs])}"


def _choose(asked: str | None, output: Path) -> ExportFormat:
    """The format that was asked for, or that the file's ending stands for."""
    from ...datasets.errors import UserError
    from ..export import export_format, format_of

    names = ", ".join(repr(one.name) for one in FORMATS)
    if asked is not None:
        try:
            return export_format(asked)
        except ValueError:
            raise UserError(f"--format {asked!r}: there are {names}; choose one of them") from None
    found = format_of(output)
    if found is None:
        raise UserError(f"{output}: its ending does not tell the format; give --format: {names}")
    return found


def _options(chosen: ExportFormat, asked: dict[str, Any]) -> dict[str, Any]:
    """What was asked for; raises `UserError` for an option that the format does not know."""
    from ...datasets.errors import UserError

    for name in asked:
        if name not in chosen.options:
            known = ", ".join(one.name for one in FORMATS if name in one.options)
            raise UserError(f"{_spelled(name)}: the format {chosen.name} has no such option; it is one of {known}")
    if "say" in chosen.options:
        asked["say"] = lambda line: typer.echo(line, err=True)
    return asked


def _spelled(name: str) -> str:
    return "--" + name.replace("_", "-")

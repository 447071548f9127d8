"""`thingmap compare`: reports side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def compare(
    reports: Annotated[list[Path], typer.Argument(metavar="REPORT", help="What `thingmap evaluate` wrote.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the table to a .md or .html file too.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it is there.")] = False,
    across_versions: Annotated[
        bool, typer.Option("--across-versions", help="Show reports of different evaluators, without a best one.")
    ] = False,
) -> None:
    """Show reports side by side.

    The best value of each row is marked, and what else differs between the reports is named above the table.
    """
    from ...datasets.errors import InputError, UserError
    from ..evaluation.reporting.compare import compare as compare_reports
    from ..evaluation.reporting.compare import unique_names
    from ..evaluation.reporting.compare_files import to_markdown, to_page
    from ..evaluation.reporting.report import read_report
    from ..evaluation.reporting.terminal import print_comparison, terminal
    from ..map.atomic import write_atomic

    writers = {".md": to_markdown, ".html": to_page}
    if output is not None and output.suffix.lower() not in writers:
        raise UserError(f"{output}: expected a name that ends in .md or .html; choose one")
    if output is not None and output.exists() and not overwrite:
        raise InputError(output, "a new file", "an existing one", "choose another name or add --overwrite")
    names = unique_names(reports)
    comparison = compare_reports(dict(zip(names, map(read_report, reports), strict=True)), across_versions)
    if output is not None:
        write_atomic(output, writers[output.suffix.lower()](comparison).encode())
    print_comparison(comparison, terminal())
    if output is not None:
        typer.echo(f"the table is in {output}")

"""`thingmap evaluate`: a map against the truth."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def evaluate(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote.")],
    truth: Annotated[
        str, typer.Option(metavar="TRUTH", help="Folder of a sequence with truth, synth:PRESET, objects in JSON, ...")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="REPORT", help="Folder for the report.")],
    poses: Annotated[
        Path | None, typer.Option(metavar="FILE", help="True poses, where the truth has none of its own.")
    ] = None,
    detector: Annotated[
        str | None, typer.Option(metavar="SPEC", help="Detector to judge beside the map; the run's own by default.")
    ] = None,
    alias: Annotated[
        list[str] | None, typer.Option(metavar="MAP=TRUTH", help="A label of the map and what the truth calls it.")
    ] = None,
    classes: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Judge these classes of the truth only.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an earlier report.")] = False,
) -> None:
    """Judge a map by the truth.

    REPORT gets report.json and report.html, a page that opens without a network. OUT is only read.
    """
    from ...datasets.open_truth import open_truth
    from ..evaluation.config import EvaluationConfig
    from ..evaluation.evaluate import evaluate_run
    from ..evaluation.inputs.placing import restrict_classes
    from ..evaluation.reporting.page import render_page
    from ..evaluation.reporting.pictures import take_pictures
    from ..evaluation.reporting.report import check_folder, to_report, write_report
    from ..evaluation.reporting.terminal import print_report, terminal
    from ..map.store import OutputFolder

    run = OutputFolder.open(folder)
    check_folder(output, run.path, overwrite)
    config = EvaluationConfig(aliases=_aliases(alias or []))
    chosen = None if classes is None else _names(classes)
    known = open_truth(truth, poses)
    if chosen is not None:
        known = restrict_classes(known, chosen)
    report = to_report(evaluate_run(run.path, known, config, detector, on_protocol=_say))
    pictures = take_pictures((case for result in report.results for case in result.worst), known.sequence)
    _, page = write_report(report, render_page(report, pictures), output)
    print_report(report, terminal())
    typer.echo(f"the report is in {output}; open {page}")


def _names(classes: str) -> tuple[str, ...]:
    from ...datasets.errors import UserError

    names = tuple(name.strip() for name in classes.split(",") if name.strip())
    if not names:
        raise UserError(f"--classes {classes!r}: expected names of classes with commas between them, such as cup,bowl")
    return names


def _say(protocol: str) -> None:
    """What is being done, where somebody watches."""
    if sys.stderr.isatty():
        typer.echo(f"judging: {protocol}", err=True)


def _aliases(pairs: list[str]) -> dict[str, str]:
    """Label of the map -> label of the truth."""
    from ...datasets.errors import UserError

    aliases: dict[str, str] = {}
    for pair in pairs:
        label, _, meant = (part.strip() for part in pair.partition("="))
        if not label or not meant:
            raise UserError(f"--alias {pair!r}: expected LABEL_OF_THE_MAP=LABEL_OF_THE_TRUTH, such as mug=cup")
        if aliases.get(label, meant) != meant:
            raise UserError(f"--alias {pair!r}: {label!r} is {aliases[label]!r} already; give each label once")
        aliases[label] = meant
    return aliases

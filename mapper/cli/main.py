"""The program `thingmap`: its commands, and what it says and returns when something goes wrong.

Exit codes: 0 done; 2 a mistake of the user, one line on stderr; 130 interrupted; 1 anything else, with a traceback.
Modules that take long to import are imported inside the commands, so that `--help` answers at once.
"""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .compare import compare
from .detect import detect
from .edit import edit
from .evaluate import evaluate
from .export import export
from .info import info
from .label import label
from .learn import learn
from .query import query
from .run import run
from .synth import synth
from .train import train
from .view import view

# What the parser raises for a bad option; typer carries its own copy of click since 0.26 and shows only this subclass.
UsageProblem: type[Exception] = next(cls for cls in typer.BadParameter.__mro__ if cls.__name__ == "ClickException")


class Program(TyperGroup):
    """The group of commands, which turns every mistake of the user into one line."""

    def main(self, *args: Any, standalone_mode: bool = True, **extra: Any) -> Any:
        try:
            code = super().main(*args, standalone_mode=False, **extra)
        except UsageProblem as problem:
            code = _complain(_usage_message(problem))
        except typer.Abort:
            code = 130
        if standalone_mode:
            sys.exit(code if isinstance(code, int) else 0)
        return code

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            typer.echo("interrupted", err=True)
            raise typer.Exit(130) from None
        except Exception as error:
            from ...datasets.errors import UserError

            if isinstance(error, PermissionError):
                raise typer.Exit(_complain(f"{error.filename}: permission denied")) from None
            if not isinstance(error, UserError):
                raise
            raise typer.Exit(_complain(str(error))) from None


def _usage_message(problem: Any) -> str:
    message = problem.format_message().rstrip(". ")
    context = getattr(problem, "ctx", None)
    return f"{message}; see {context.command_path} --help" if context is not None else message


def _complain(message: str) -> int:
    typer.echo("error: " + " ".join(message.split()), err=True)
    return 2


app = typer.Typer(
    cls=Program,
    help="Maps of things: RGB-D frames and a detector's boxes become a probabilistic map of objects.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (run, detect, label, query, view, export, info, evaluate, compare, synth, learn):
    app.command()(command)
app.add_typer(edit, name="edit")
app.add_typer(train, name="train")


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"thingmap {version('thingmap')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def start(
    ctx: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


def main() -> None:
    """Entry point of the console script."""
    app(prog_name="thingmap")

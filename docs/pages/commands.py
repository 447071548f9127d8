"""The reference of the command line: what every command says with `--help`."""

from __future__ import annotations

from typing import Any

import typer
from typer.testing import CliRunner

from thingmap.mapper.cli.main import app

WIDTH = 100  # characters of the help's lines

HEAD = """# Command line

Exit codes: 0 done; 2 a mistake in what was given, told in one line; 130 interrupted; 1 anything else. A sequence is a
folder, a bag of ROS, `sample:tabletop`, or a line such as `"synth:kitchen?seed=3"`.
"""


def commands_page() -> str:
    """The page, in Markdown."""
    parts = [
        f"## thingmap {' '.join(words)}\n\n```text\n{_help(words)}\n```"
        for words in leaves(typer.main.get_command(app))
    ]
    return "\n\n".join([HEAD, *parts]) + "\n"


def leaves(command: Any, words: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """The words that call each command that does something, in the order of `--help`."""
    inner = getattr(command, "commands", None)
    if inner is None:
        return [words]
    return [leaf for name, child in inner.items() for leaf in leaves(child, (*words, name))]


def _help(words: tuple[str, ...]) -> str:
    # `edit` takes the folder before the name of its command
    arguments = ["edit", "OUT", *words[1:]] if words[0] == "edit" else list(words)
    size = {"COLUMNS": str(WIDTH), "TERMINAL_WIDTH": str(WIDTH)}
    result = CliRunner().invoke(app, [*arguments, "--help"], prog_name="thingmap", env=size)
    if result.exit_code != 0:
        raise RuntimeError(f"thingmap {' '.join(arguments)} --help: {result.output}")
    return result.output.rstrip()

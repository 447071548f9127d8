"""`thingmap edit`: people correct a map; what they say is recorded and can be undone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..edits.defaults import MOVE_STD, RESIZE_STD, SAID_PROBABILITY

if TYPE_CHECKING:
    from ..edits.edit import Edit
    from ..edits.editor import MapEditor
    from ..edits.journal import Reversal

edit = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Correct a map: relabel, delete, move, resize, merge or name its things. Everything is recorded in "
    "OUT/edits.jsonl with who, when and why, can be undone, and is done again when the sequence is mapped anew into "
    "OUT.",
)

ThingArgument = Annotated[str, typer.Argument(metavar="THING", help="Id of a thing, such as thing-0003.")]
WhyOption = Annotated[str, typer.Option("--why", metavar="TEXT", help="Reason, for those who come after.")]
WhoOption = Annotated[
    str | None, typer.Option("--who", metavar="NAME", help="Who says so; your login name by default.")
]
CountOption = Annotated[int | None, typer.Option("-n", "--count", min=1, metavar="N", help="How many; 1 by default.")]


@edit.callback()
def choose(
    ctx: typer.Context,
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote, or a map.json.")],
) -> None:
    ctx.obj = folder


@edit.command()
def relabel(
    ctx: typer.Context,
    thing: ThingArgument,
    label: Annotated[str, typer.Argument(metavar="LABEL", help="What it is; a new label is fine.")],
    probability: Annotated[
        float, typer.Option(metavar="P", help="How sure you are: at least 0.5, below 1.")
    ] = SAID_PROBABILITY,
    why: WhyOption = "",
    who: WhoOption = None,
) -> None:
    """Say what a thing is."""
    _tell(_editor(ctx, who).relabel(thing, label, why=why, probability=probability))


@edit.command()
def delete(ctx: typer.Context, thing: ThingArgument, why: WhyOption = "", who: WhoOption = None) -> None:
    """Say that a thing is not there."""
    _tell(_editor(ctx, who).delete(thing, why=why))


@edit.command()
def move(
    ctx: typer.Context,
    thing: ThingArgument,
    to: Annotated[
        tuple[float, float, float], typer.Option(metavar="X Y Z", help="Its centre, metres in the map's frame.")
    ],
    std: Annotated[float, typer.Option(metavar="M", help="How sure that is: standard deviation, metres.")] = MOVE_STD,
    why: WhyOption = "",
    who: WhoOption = None,
) -> None:
    """Say where the centre of a thing is."""
    _tell(_editor(ctx, who).move(thing, to, std, why=why))


@edit.command()
def resize(
    ctx: typer.Context,
    thing: ThingArgument,
    to: Annotated[
        tuple[float, float, float],
        typer.Option(metavar="X Y Z", help="Its full extents along its box's own axes, metres; Z is the height."),
    ],
    std: Annotated[float, typer.Option(metavar="M", help="How sure that is: standard deviation, metres.")] = RESIZE_STD,
    why: WhyOption = "",
    who: WhoOption = None,
) -> None:
    """Say how large a thing is."""
    _tell(_editor(ctx, who).resize(thing, to, std, why=why))


@edit.command()
def merge(
    ctx: typer.Context,
    things: Annotated[list[str], typer.Argument(metavar="THING THING ...", help="Ids; the first one stays.")],
    why: WhyOption = "",
    who: WhoOption = None,
) -> None:
    """Say that several things are one."""
    _tell(_editor(ctx, who).merge(things, why=why))


@edit.command()
def name(
    ctx: typer.Context,
    thing: ThingArgument,
    name: Annotated[str, typer.Argument(metavar="NAME", help='Such as "my mug"; "" takes the name away.')],
    why: WhyOption = "",
    who: WhoOption = None,
) -> None:
    """Give a thing a name, by which `thingmap query` finds it."""
    _tell(_editor(ctx, who).name(thing, name, why=why))


@edit.command()
def undo(
    ctx: typer.Context,
    number: Annotated[
        int | None, typer.Argument(metavar="NUMBER", help="Of the edit, as `log` has it; the last one by default.")
    ] = None,
    count: CountOption = None,
    why: WhyOption = "",
    who: WhoOption = None,
) -> None:
    """Undo the last edits, or the one of a NUMBER; they stay in the journal."""
    from ...datasets.errors import UserError

    if number is not None and count is not None:
        raise UserError("undo: give the NUMBER of one edit, or with -n how many of the last ones")
    editor = _editor(ctx, who)
    _tell(editor.undo(count or 1, why=why) if number is None else editor.undo_edit(number, why=why))


@edit.command()
def redo(ctx: typer.Context, count: CountOption = None, why: WhyOption = "", who: WhoOption = None) -> None:
    """Do edits again that were undone."""
    _tell(_editor(ctx, who).redo(count or 1, why=why))


@edit.command()
def log(ctx: typer.Context) -> None:
    """List everything that was recorded, and what it comes to now."""
    lines = _editor(ctx, "reader").history()
    if not lines:
        typer.echo("nothing was edited")
    for line in lines:
        entry = line.entry
        state = f"[{line.state}] " if line.state else ""
        about = f", because: {entry.why}" if entry.why else ""
        reason = f" ({line.reason})" if line.reason else ""
        typer.echo(f"{entry.number:4d}  {entry.when}  {entry.who}: {state}{entry}{about}{reason}")


def _editor(ctx: typer.Context, who: str | None) -> MapEditor:
    from ..edits.editor import MapEditor

    return MapEditor(ctx.obj, who)


def _tell(entry: Edit | Reversal) -> None:
    typer.echo(f"{entry.number}: {entry}")

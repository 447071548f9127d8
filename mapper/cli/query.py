"""`thingmap query`: where is it, how far, and how sure is that."""

from __future__ import annotations

import difflib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ..map.object_map import ObjectMap
    from ..queries.answer import Answer

LISTED = 30  # labels named in a message


def query(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote, or a map.json.")],
    label: Annotated[str, typer.Argument(metavar="LABEL", help="What to look for.")],
    near: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y Z", help="Sort by distance from this point, metres in the map's frame."),
    ] = None,
    min_probability: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="P", help="Leave out what is less probably a LABEL.")
    ] = 0.05,
    why: Annotated[
        bool, typer.Option("--why", help="Say after each answer which views spoke for it, and which against.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Answer in JSON, with --why every view on record.")] = False,
) -> None:
    """Find the things that may be a LABEL.

    The likeliest or, with --near, the nearest come first, each with its probability and uncertainty.
    """
    from ...datasets.errors import UserError
    from ..map.object_map import ObjectMap
    from .tables import print_answers, print_explained

    object_map = ObjectMap.load(folder)
    if not object_map.knows(label):
        raise UserError(_unknown(label, object_map))
    if near is None:
        answers = object_map.find(label, min_probability)
    else:
        answers = object_map.nearest(near, label, min_probability=min_probability)
    explained = [(answer, answer.thing.explain(label)) for answer in answers] if why else []
    if as_json:
        documents = [_answer_to_dict(answer) for answer in answers]
        for document, (_, explanation) in zip(documents, explained, strict=False):
            document["why"] = explanation.to_dict()
        typer.echo(json.dumps(documents, indent=1, ensure_ascii=False))
    elif explained:
        print_explained(explained)
    elif answers:
        print_answers(answers)
    else:
        typer.echo(f"no {label} with a probability of at least {min_probability:g} among {len(object_map)} things")


def _unknown(label: str, object_map: ObjectMap) -> str:
    classes = sorted(object_map.classes)
    near = difflib.get_close_matches(label.casefold(), classes, n=1)
    guess = f"did you mean {near[0]}? " if near else ""
    more = f" and {len(classes) - LISTED} more" if len(classes) > LISTED else ""
    known = ", ".join(classes[:LISTED]) or "none"
    return f"no label {label!r} in this map; {guess}its labels are: {known}{more}"


def _answer_to_dict(answer: Answer) -> dict[str, Any]:
    from ..map.map_file import thing_to_dict

    distance = {} if answer.distance is None else {"distance": answer.distance, "distance_std": answer.distance_std}
    return {"answer_probability": answer.probability, **distance, **thing_to_dict(answer.thing)}

"""`thingmap query`: where is it, how far, and how sure is that; what is on, in, under and next to what."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ..map.explanation import Explanation
    from ..map.object_map import ObjectMap
    from ..queries.answer import Answer
    from .query_questions import Question

WHAT = "THING|LABEL"
Corners = tuple[float, float, float, float, float, float]
Centre = tuple[float, float, float, float]


def query(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `thingmap run` wrote, or a map.json.")],
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LABEL",
            help='A label, the name or the id of a thing, or a question: "what is on the table?".',
            show_default=False,
        ),
    ] = None,
    near: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y Z", help="Sort by distance from this point, metres in the map's frame."),
    ] = None,
    on: Annotated[str | None, typer.Option(metavar=WHAT, help="What rests on it.")] = None,
    supports_of: Annotated[str | None, typer.Option(metavar=WHAT, help="What it rests on.")] = None,
    inside: Annotated[str | None, typer.Option(metavar=WHAT, help="What is in it.")] = None,
    under: Annotated[str | None, typer.Option(metavar=WHAT, help="What is below it.")] = None,
    next_to: Annotated[str | None, typer.Option(metavar=WHAT, help="What is side by side with it.")] = None,
    within_box: Annotated[
        Corners | None, typer.Option(metavar="X Y Z X Y Z", help="What is between two corners, metres, map's frame.")
    ] = None,
    within_ball: Annotated[
        Centre | None, typer.Option(metavar="X Y Z R", help="What is within R metres of a point.")
    ] = None,
    within_polygon: Annotated[
        str | None,
        typer.Option(metavar='"X,Y X,Y X,Y"', help="What is over a polygon of the floor plan, metres, upright frame."),
    ] = None,
    heights: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Of the polygon, metres along up.")
    ] = None,
    last_seen: Annotated[str | None, typer.Option(metavar=WHAT, help="When it was seen last, and from where.")] = None,
    visible_from: Annotated[
        str | None,
        typer.Option(metavar="POSE", help='What is seen from "tx ty tz qx qy qz qw", or a stamp of the trajectory.'),
    ] = None,
    expected_at: Annotated[
        str | None, typer.Option(metavar="POSE", help="What the detector should find from there.")
    ] = None,
    where_to_look: Annotated[
        str | None, typer.Option(metavar=WHAT, help="From where a look would tell most about it.")
    ] = None,
    min_probability: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="P", help="Leave out what is less probably a LABEL.")
    ] = 0.05,
    why: Annotated[
        bool, typer.Option("--why", help="Say after each answer which views spoke for it, and which against.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Answer in JSON, a list of answers; with --why every view on record.")
    ] = False,
) -> None:
    """Find the things that may be a LABEL, or answer a question about places.

    The likeliest or, with --near, the nearest come first, each with its probability and uncertainty. One question at a
    time; a LABEL with it leaves only answers that may be one.

    In JSON, answer_probability is that of being what was asked for. Lengths are metres in the map's frame, covariances
    square metres, stamps seconds, angles radians, boxes in images (xyxy) pixels, T_world_camera 4 x 4, shares of what
    is visible from 0 to 1, log ratios nats.
    """
    from ...datasets.errors import UserError
    from ..map.object_map import ObjectMap
    from .query_places import ball_of, box_of, polygon_of
    from .query_questions import ask, question_of, remark
    from .query_sentence import Kind

    if heights is not None and within_polygon is None:
        raise UserError("--heights goes with --within-polygon")
    regions = [
        None if within_box is None else box_of(within_box),
        None if within_ball is None else ball_of(within_ball),
        None if within_polygon is None else polygon_of(within_polygon, heights),
    ]
    chosen = [region for region in regions if region is not None]
    if len(chosen) > 1:
        raise UserError("--within-box, --within-ball and --within-polygon are different questions; ask one at a time")
    options = {
        **{Kind.ON: on, Kind.SUPPORTS: supports_of, Kind.INSIDE: inside, Kind.UNDER: under, Kind.NEXT_TO: next_to},
        **{Kind.WITHIN: chosen[0] if chosen else None, Kind.LAST_SEEN: last_seen, Kind.VISIBLE: visible_from},
        **{Kind.EXPECTED: expected_at, Kind.LOOK: where_to_look},
    }
    asked = {kind: value for kind, value in options.items() if value is not None}
    label = " ".join(words) if words else None  # a question is understood without quotes, too
    object_map = ObjectMap.load(folder)
    question = question_of(label, asked, near, min_probability, object_map)
    note = remark(question, object_map)
    answers = ask(question, object_map, folder)
    if note is not None:
        typer.echo(note, err=True)
    _show(question, answers, object_map, why, as_json)


def _show(question: Question, answers: list[Any], object_map: ObjectMap, why: bool, as_json: bool) -> None:
    from ...datasets.errors import UserError
    from . import query_answers as shown
    from .query_questions import nothing_found
    from .query_sentence import Kind
    from .tables import print_answers, print_explained

    tables = {
        Kind.LAST_SEEN: (shown.last_view_to_dict, shown.print_last_views),
        Kind.VISIBLE: (shown.sighting_to_dict, lambda rows: shown.print_sightings(rows, "P(seen)")),
        Kind.EXPECTED: (shown.sighting_to_dict, lambda rows: shown.print_sightings(rows, "P(found)")),
        Kind.LOOK: (shown.viewpoint_to_dict, shown.print_viewpoints),
    }
    if why and question.kind in tables:
        raise UserError(f"--why explains what things are; it does not go with {question.kind.value}")
    to_dict, print_all = tables.get(question.kind, (shown.answer_to_dict, print_answers))
    explained = [(answer, _explanation(answer, question, object_map)) for answer in answers] if why else []
    if as_json:
        documents = [to_dict(answer) for answer in answers]
        for document, (_, explanation) in zip(documents, explained, strict=False):
            document["why"] = explanation.to_dict()
        typer.echo(json.dumps(documents, indent=1, ensure_ascii=False, allow_nan=False))
    elif explained:
        print_explained(explained)
    elif answers:
        print_all(answers)
    else:
        typer.echo(nothing_found(question, object_map))


def _explanation(answer: Answer, question: Question, object_map: ObjectMap) -> Explanation:
    """Why the thing is what was asked for: of several labels that were meant, the one that it most probably is."""
    named = question.label is None or object_map.called(question.label)
    labels = () if named else object_map.understand(str(question.label)).labels
    thing = answer.thing
    return thing.explain(max(labels, key=thing.belief) if labels else None)

"""A map as one HTML file: `export_html`."""

from __future__ import annotations

import json
import zlib
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....datasets.errors import UserError
from ....datasets.sequence import Sequence
from ...map.atomic import write_atomic
from ...map.boxes import EDGES
from ...map.explanation import Explanation
from ...map.object_map import ObjectMap
from ...map.store import OutputFolder
from ...map.thing import Thing
from ...queries.synonyms import normal_words, synonyms
from .cameras import Cameras
from .cloud import COMPRESSION, PageCloud, pack, page_cloud
from .colors import page_colors
from .crops import Crop, choose, cut, per_thing
from .document import document
from .source import Images, images_of
from .start import start_view
from .things import explain, thing_values, view_names

POINTS = 300_000  # by default: 2.7 MB of a page (benchmarks/page.py)
SURE = 0.5  # P from which a thing is among what the page first looks at
MOST_CROPPED = 300  # things with crops, likeliest first


def export_html(
    folder: OutputFolder,
    file: Path,
    *,
    points: int = POINTS,
    sequence: Sequence | str | None = None,
    crops: bool = True,
) -> int:
    """Write the page of a map; returns the number of things. The same run and numbers give the same file.

    Args:
        folder: of the run.
        file: to write, replaced if it is there.
        points: at most so many of the cloud, evenly spread; 0 for none.
        sequence: that was mapped, for crops of its images; None to open what the run's report names, and where that is
            gone the page says so.
        crops: whether there are any.

    Raises:
        UserError: `points` is negative; a given sequence cannot be opened; the place cannot be written.
        InputError: a file of the run is damaged.
    """
    if points < 0:
        raise UserError(f"--points: expected a number of points from 0, found {points}; change it")
    object_map = folder.read_map()
    things = sorted(object_map.things, key=lambda thing: (-thing.belief(thing.label), thing.id))
    R = object_map.R_world_upright
    cameras = Cameras.read(folder)
    cloud = _cloud(folder, cameras, R, points)
    explained = {thing.id: explanation for thing in things if (explanation := explain(thing)) is not None}
    images = images_of(folder, sequence, cameras.stamps) if crops else Images(None, "This page was made without crops.")
    about = _about(object_map)
    found, jpegs = _crops(things, explained, cameras, images, R, about["colors"])
    shown = [
        thing_values(thing, R, explained.get(thing.id), cameras) | {"crops": found.get(thing.id, [])}
        for thing in things
    ]
    sure = [t.corners(R) @ R for t in things if t.belief(t.label) >= SURE] or [t.corners(R) @ R for t in things]
    start = start_view(np.array(sure).reshape(-1, 8, 3), cloud.points, cameras.positions @ R)
    content = {
        **about,
        "things": shown,
        "verdicts": view_names(),
        "crops_note": images.why_not,
        "cloud": _cloud_values(cloud),
        "cameras": cameras.to_page(R),
        "start": start,
        "edges": EDGES.tolist(),
    }
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    blocks = {"map": zlib.compress(text.encode(), COMPRESSION), "cloud": pack(cloud), "crops": b"".join(jpegs)}
    write_atomic(file, document(f"{object_map.source} · thingmap", blocks).encode())
    return len(things)


def _about(object_map: ObjectMap) -> dict[str, Any]:
    """The map as a whole; of the classes, those that something may be come with a colour."""
    number = Counter(thing.label for thing in object_map.things)
    counts = dict(sorted(number.items(), key=lambda item: (-item[1], item[0])))
    labels = [*counts, *sorted({label for thing in object_map.things for label in thing.class_posterior} - set(counts))]
    return {
        "source": object_map.source,
        "frame": str(object_map.frame),
        "up": {"std_deg": round(float(np.degrees(object_map.up.std_rad)), 2), "source": object_map.up.source},
        "classes": len(object_map.classes),
        "counts": counts,
        "colors": {label: rgb.tolist() for label, rgb in page_colors(labels).items()},
        "synonyms": _synonyms(labels),
    }


def _synonyms(labels: list[str]) -> Mapping[str, list[str]]:
    """Label -> other words for it, by which a search finds it too."""
    found = {label: synonyms().of(normal_words(label)) - {normal_words(label)} for label in labels}
    return {label: sorted(" ".join(words) for words in phrases) for label, phrases in found.items() if phrases}


def _cloud(folder: OutputFolder, cameras: Cameras, R_world_upright: np.ndarray, count: int) -> PageCloud:
    """The run's cloud in the upright frame; an empty one where it wrote none."""
    if not folder.cloud_file.is_file():
        nothing = np.empty((0, 3))
        return page_cloud(nothing, nothing.astype(np.uint8), nothing, 0)
    places, colors = folder.read_cloud()
    viewpoints = cameras.positions @ R_world_upright
    return page_cloud(places @ R_world_upright, colors, viewpoints, count)


def _cloud_values(cloud: PageCloud) -> dict[str, Any]:
    low, high = cloud.bounds
    values = {"count": len(cloud.points), "of": cloud.of, "voxel": round(cloud.voxel, 5)}
    return values | {"low": low.tolist(), "high": high.tolist()}


def _crops(
    things: list[Thing],
    explained: Mapping[str, Explanation],
    cameras: Cameras,
    images: Images,
    R_world_upright: np.ndarray,
    colors: Mapping[str, list[int]],
) -> tuple[dict[str, list[dict[str, Any]]], list[bytes]]:
    """Thing's id -> its crops, the strongest first, those that speak for it before the others; and their JPEGs.

    An image is read once, whatever is cut from it.
    """
    if images.sequence is None:
        return {}, []
    wanted: dict[float, list[tuple[Thing, int, int]]] = {}  # stamp -> thing, side, rank
    count = per_thing(len(explained))
    for thing in [thing for thing in things if thing.id in explained][:MOST_CROPPED]:
        for side in (0, 1):
            for rank, view in enumerate(choose(explained[thing.id].views, side == 0, count)):
                wanted.setdefault(view.stamp, []).append((thing, side, rank))
    made: dict[tuple[str, int, int], tuple[float, Crop]] = {}
    for stamp, cuts in sorted(wanted.items()):
        place, frame = cameras.at(stamp), images.frame(stamp)
        if place is None or frame is None:
            continue
        for thing, side, rank in cuts:
            corners, rgb = thing.corners(R_world_upright), np.array(colors[thing.label])
            if (crop := cut(frame, cameras.poses[place], corners, rgb)) is not None:
                made[thing.id, side, rank] = stamp, crop
    found: dict[str, list[dict[str, Any]]] = {}
    jpegs: list[bytes] = []
    at = 0
    for (thing_id, side, _), (stamp, crop) in sorted(made.items()):
        place = {"at": at, "bytes": len(crop.jpeg), "width": crop.width, "height": crop.height}
        found.setdefault(thing_id, []).append({"stamp": round(stamp, 6), "against": bool(side), **place})
        jpegs.append(crop.jpeg)
        at += len(crop.jpeg)
    return found, jpegs

"""GeoJSON floor plan: footprints, 95 % ellipses of the positions and the way of the camera, seen from above.

The plan is the map's upright frame (`upright_rotation`: z up, x along the map's x axis as far as that is horizontal)
without its height. RFC 7946 knows only longitude and latitude, and a map made indoors has neither: with an origin the
coordinates are WGS84 degrees; without one they are metres of the plan, and the member "thingmap" says so. Tools then
draw the plan around 0 N, 0 E, in true shape but at a false scale, until they are told that the numbers are metres.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..map.atomic import write_atomic
from ..map.map_file import thing_to_dict
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from ..map.thing import Thing
from .chosen import read_path, read_things
from .plan_origin import PlanOrigin

CHI_SQUARE_95 = 5.991464547107979  # 95 % of two degrees of freedom: -2 log 0.05
ELLIPSE_CORNERS = 48
THING, ELLIPSE, PATH = "thing", "position ellipse", "trajectory"  # property "kind" of a feature


def export_geojson(
    folder: OutputFolder, file: Path, *, origin: str | PlanOrigin | None = None, min_existence: float = 0.0
) -> int:
    """Write a FeatureCollection; returns the number of things.

    Each thing has a Polygon (its footprint) with all that `map.json` says of it, in the map's axes, and `plan`: its
    place in the upright frame; and another Polygon, in which it stands with a probability of 95 %.

    Args:
        folder: of the run.
        file: to write.
        origin: where the plan's origin is, as "LAT,LON" or "LAT,LON,BEARING" (`PlanOrigin`); None for metres.
        min_existence: things below it are left out.

    Raises:
        UserError: the origin is none.
    """
    place = PlanOrigin.parse(origin) if isinstance(origin, str) else origin
    object_map = read_things(folder, min_existence)
    features = []
    for thing in object_map.things:
        features += _thing_features(thing, object_map.R_world_upright, place)
    features += _path_features(*read_path(folder), object_map.R_world_upright, place)
    head = {"type": "FeatureCollection", "thingmap": _about(object_map, place)}
    lines = ",\n".join(json.dumps(feature, ensure_ascii=False, allow_nan=False) for feature in features)
    text = json.dumps(head, ensure_ascii=False)[:-1] + f', "features": [\n{lines}\n]}}\n'
    write_atomic(file, text.encode())
    return len(object_map)


def _about(object_map: ObjectMap, place: PlanOrigin | None) -> dict[str, Any]:
    """The foreign member that says what the coordinates are."""
    metres = "metres of a local plan, not degrees: x and y of the map's upright frame"
    degrees = "longitude and latitude, degrees, WGS84"
    about = {
        "source": object_map.source,
        "coordinates": metres if place is None else degrees,
        "frame": str(object_map.frame),
        "R_map_plan": object_map.R_world_upright.tolist(),
    }
    if place is not None:
        about["origin"] = {"latitude": place.latitude, "longitude": place.longitude, "bearing_deg": place.bearing}
    return about


def _thing_features(thing: Thing, R_world_upright: np.ndarray, place: PlanOrigin | None) -> list[dict[str, Any]]:
    position = R_world_upright.T @ thing.position
    covariance = R_world_upright.T @ thing.position_covariance @ R_world_upright
    half_axes, angle = ellipse_95(covariance[:2, :2])
    plan = {
        "position": position.tolist(),
        "bottom": float(position[2] - thing.size[2] / 2.0),
        "top": float(position[2] + thing.size[2] / 2.0),
        "position_covariance": covariance.tolist(),
        "ellipse_95": {"half_axes": half_axes.tolist(), "angle": angle},
    }
    footprint = thing.corners(R_world_upright)[:4] @ R_world_upright[:, :2]  # round the bottom, counter-clockwise
    around = np.linspace(0.0, 2.0 * np.pi, ELLIPSE_CORNERS, endpoint=False)
    x, y = half_axes[0] * np.cos(around), half_axes[1] * np.sin(around)
    cosine, sine = np.cos(angle), np.sin(angle)
    ellipse = position[:2] + np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)
    short = {"id": thing.id, "label": thing.label, "kind": ELLIPSE, "probability": 0.95}
    return [
        _feature(_polygon(footprint, place), {"kind": THING, **thing_to_dict(thing), "plan": plan}, thing.id),
        _feature(_polygon(ellipse, place), short),
    ]


def ellipse_95(covariance: np.ndarray) -> tuple[np.ndarray, float]:
    """Half-axes (2,), metres, the longer first, and the longer one's angle from x, radians, of a (2, 2) covariance.

    A point of that Gaussian lies within with a probability of 0.95.
    """
    values, vectors = np.linalg.eigh(covariance)
    longest = vectors[:, 1]
    half_axes = np.sqrt(CHI_SQUARE_95 * np.maximum(values[::-1], 0.0))
    return half_axes, float(np.arctan2(longest[1], longest[0]))


def _path_features(
    stamps: np.ndarray, T_world_camera: np.ndarray, R_world_upright: np.ndarray, place: PlanOrigin | None
) -> list[dict[str, Any]]:
    if len(stamps) < 2:  # a line has two ends
        return []
    way = T_world_camera[:, :3, 3] @ R_world_upright
    line = {"type": "LineString", "coordinates": _coordinates(way[:, :2], place)}
    return [_feature(line, {"kind": PATH, "stamps": stamps.tolist(), "heights": way[:, 2].tolist()})]


def _polygon(corners: np.ndarray, place: PlanOrigin | None) -> dict[str, Any]:
    """(M, 2) metres, counter-clockwise as RFC 7946 asks, closed here."""
    return {"type": "Polygon", "coordinates": [_coordinates(np.concatenate([corners, corners[:1]]), place)]}


def _coordinates(plan: np.ndarray, place: PlanOrigin | None) -> list[list[float]]:
    return (plan if place is None else place.to_lon_lat(plan)).tolist()


def _feature(geometry: dict[str, Any], properties: dict[str, Any], name: str | None = None) -> dict[str, Any]:
    named = {} if name is None else {"id": name}
    return {"type": "Feature", **named, "geometry": geometry, "properties": properties}

"""Floor plans, read by shapely."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.errors import UserError
from thingmap.mapper.export.chosen import read_path
from thingmap.mapper.export.geojson_file import ellipse_95, export_geojson
from thingmap.mapper.export.plan_origin import EQUATOR_M, FLATTENING, PlanOrigin


def features(file) -> dict[str, list]:
    document = json.loads(file.read_text(encoding="utf-8"))
    assert document["type"] == "FeatureCollection"
    found: dict[str, list] = {"thing": [], "position ellipse": [], "trajectory": []}
    for feature in document["features"]:
        found[feature["properties"]["kind"]].append(feature)
    return found


def test_footprints_are_those_of_the_boxes(folder, tmp_path):
    shapely = pytest.importorskip("shapely.geometry")
    file = tmp_path / "plan.geojson"
    assert export_geojson(folder, file) == 2
    found, object_map = features(file), folder.read_map()
    for feature, thing in zip(found["thing"], object_map.things, strict=True):
        polygon = shapely.shape(feature["geometry"])
        assert polygon.is_valid and polygon.exterior.is_ccw
        assert polygon.area == pytest.approx(thing.size[0] * thing.size[1])
        middle = object_map.R_world_upright.T @ thing.position
        assert (polygon.centroid.x, polygon.centroid.y) == pytest.approx(tuple(middle[:2]))
        own = feature["properties"]
        assert (feature["id"], own["label"], own["existence"]) == (thing.id, thing.label, thing.existence)
        assert own["position"] == thing.position.tolist()
        assert own["plan"]["top"] - own["plan"]["bottom"] == pytest.approx(thing.size[2])
    line = shapely.shape(found["trajectory"][0]["geometry"])
    way = read_path(folder)[1][:, :3, 3] @ object_map.R_world_upright
    np.testing.assert_allclose(np.array(line.coords), way[:, :2])
    assert json.loads(file.read_text())["thingmap"]["coordinates"].startswith("metres of a local plan, not degrees")


def test_ellipses_hold_95_percent(folder, tmp_path):
    shapely = pytest.importorskip("shapely")
    export_geojson(folder, tmp_path / "plan.geojson")
    feature, thing = features(tmp_path / "plan.geojson")["position ellipse"][0], folder.read_map().things[0]
    R = folder.read_map().R_world_upright
    drawn = np.random.default_rng(0).multivariate_normal(thing.position, thing.position_covariance, 20_000) @ R
    polygon = shapely.geometry.shape(feature["geometry"])
    inside = shapely.contains_xy(polygon, drawn[:, 0], drawn[:, 1]).mean()
    assert inside == pytest.approx(0.95, abs=0.006)  # 48 corners cut off 0.3 % of its area


def test_an_ellipse_by_hand():
    half_axes, angle = ellipse_95(np.diag([1.0, 4.0]))
    np.testing.assert_allclose(half_axes, np.sqrt(5.991464547) * np.array([2.0, 1.0]))
    assert abs(angle) == pytest.approx(np.pi / 2)


def test_with_an_origin_coordinates_are_degrees(folder, tmp_path):
    export_geojson(folder, tmp_path / "plan.geojson")
    export_geojson(folder, tmp_path / "earth.geojson", origin="52.5163,13.3777,90")
    plan, earth = (features(tmp_path / name)["thing"][0]["geometry"] for name in ("plan.geojson", "earth.geojson"))
    x, y = np.array(plan["coordinates"][0]).T
    longitude, latitude = np.array(earth["coordinates"][0]).T
    # the plan's y axis points east, so its x axis points south; a degree of latitude is 111.26 km there
    np.testing.assert_allclose((latitude - 52.5163) * 111_266.0, -x, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose((longitude - 13.3777) * 67_900.0, y, rtol=2e-3, atol=1e-6)
    about = json.loads((tmp_path / "earth.geojson").read_text())["thingmap"]
    assert "WGS84" in about["coordinates"] and about["origin"]["bearing_deg"] == 90.0


def exact(origin: PlanOrigin, x: float, y: float) -> tuple[float, float]:
    """Longitude and latitude of a point of the tangent plane, by way of geocentric coordinates."""
    turn, lat, lon = np.radians([origin.bearing, origin.latitude, origin.longitude])
    east, north = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    squared = FLATTENING * (2.0 - FLATTENING)
    normal = EQUATOR_M / np.sqrt(1.0 - squared * np.sin(lat) ** 2)
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    to_east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    place = normal * up - np.array([0.0, 0.0, squared * normal * np.sin(lat)])
    place = place + east * to_east + north * np.cross(up, to_east)
    across, phi = np.hypot(place[0], place[1]), lat
    for _ in range(20):
        normal = EQUATOR_M / np.sqrt(1.0 - squared * np.sin(phi) ** 2)
        phi = np.arctan2(place[2] + squared * normal * np.sin(phi), across)
    return float(np.degrees(np.arctan2(place[1], place[0]))), float(np.degrees(phi))


@given(st.floats(-60, 60), st.floats(-179, 179), st.floats(-360, 360), st.floats(-100, 100), st.floats(-100, 100))
def test_places_are_right_to_a_few_millimetres(latitude, longitude, bearing, x, y):
    origin = PlanOrigin(latitude, longitude, bearing)
    got, wanted = origin.to_lon_lat(np.array([x, y])), exact(origin, x, y)
    metres = np.radians(got - wanted) * EQUATOR_M * [np.cos(np.radians(latitude)), 1.0]
    assert np.abs(metres).max() < 5e-3


@pytest.mark.parametrize("text", ["52.5", "north,13", "91,0", "0,181", "1,2,3,4", "nan,0", ""])
def test_origins_that_are_none(folder, tmp_path, text):
    with pytest.raises(UserError, match="origin"):
        export_geojson(folder, tmp_path / "plan.geojson", origin=text)
    assert not (tmp_path / "plan.geojson").exists()


def test_the_antimeridian_is_refused(folder, tmp_path):
    with pytest.raises(UserError, match="antimeridian"):
        export_geojson(folder, tmp_path / "plan.geojson", origin="0,180")


def test_a_map_of_nothing(empty_folder, tmp_path):
    assert export_geojson(empty_folder, tmp_path / "plan.geojson") == 0
    assert json.loads((tmp_path / "plan.geojson").read_text())["features"] == []

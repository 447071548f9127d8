"""USD stages, read by usd-core."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.export.chosen import read_path
from thingmap.mapper.export.colors import linear_color
from thingmap.mapper.export.usd_file import export_usd
from thingmap.mapper.map.store import OutputFolder

Usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
UsdGeom = pytest.importorskip("pxr.UsdGeom")


@pytest.mark.parametrize("ending", ["usda", "usdc", "usd"])
def test_things_stand_where_the_map_has_them(folder, tmp_path, ending):
    file = tmp_path / f"map.{ending}"
    assert export_usd(folder, file) == 2
    stage = Usd.Stage.Open(str(file))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0 and UsdGeom.GetStageUpAxis(stage) == "Z"
    assert stage.GetDefaultPrim().GetPath() == "/Map"
    object_map = folder.read_map()
    R = object_map.R_world_upright
    for thing in object_map.things:
        box = stage.GetPrimAtPath(f"/Map/Things/{thing.id.replace('-', '_')}/Box")
        to_stage = np.array(UsdGeom.Xformable(box).ComputeLocalToWorldTransform(0.0))  # rows, as Gf has it
        cube = UsdGeom.Cube(box).GetSizeAttr().Get() / 2.0
        signs = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        corners = np.column_stack([cube * signs, np.ones(8)]) @ to_stage
        np.testing.assert_allclose(corners[:, :3], thing.corners(R) @ R, atol=1e-9)


def test_attributes_are_the_numbers_of_the_map(folder, tmp_path):
    export_usd(folder, tmp_path / "map.usda")
    stage = Usd.Stage.Open(str(tmp_path / "map.usda"))
    thing = folder.read_map().things[0]
    prim = stage.GetPrimAtPath("/Map/Things/thing_0001")
    assert prim.GetDisplayName() == "cup thing-0001"
    values = {
        a.GetName().split(":", 1)[1]: a.Get() for a in prim.GetAttributes() if a.GetName().startswith("thingmap:")
    }
    assert (values["label"], values["id"]) == ("cup", "thing-0001")
    assert (values["probability"], values["existence"]) == (thing.probability, thing.existence)
    posterior = dict(zip(values["classes"], values["classProbabilities"], strict=True))
    assert posterior == pytest.approx(dict(thing.class_posterior))
    np.testing.assert_array_equal(np.array(values["positionCovariance"]), thing.position_covariance)
    np.testing.assert_array_equal(values["size"], thing.size)
    np.testing.assert_array_equal(values["sizeStd"], thing.size_std)
    assert (values["supportingViews"], values["contradictingViews"]) == (12, 1)
    about = stage.GetDefaultPrim().GetCustomDataByKey("thingmap")
    assert about["frame"] == "first camera"
    np.testing.assert_allclose(about["up"], folder.read_map().up.direction)


def test_cloud_and_path(folder, tmp_path):
    export_usd(folder, tmp_path / "map.usdc", points=400)
    stage = Usd.Stage.Open(str(tmp_path / "map.usdc"))
    cloud = UsdGeom.Points(stage.GetPrimAtPath("/Map/Cloud"))
    assert len(cloud.GetPointsAttr().Get()) == 400
    light = np.array(cloud.GetDisplayColorPrimvar().Get())
    np.testing.assert_allclose(light[0], linear_color(np.array([200, 20, 0])), atol=1e-6)
    curve = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Map/Trajectory"))
    stamps, poses = read_path(folder)
    assert list(curve.GetCurveVertexCountsAttr().Get()) == [5]
    np.testing.assert_allclose(np.array(curve.GetPointsAttr().Get()), poses[:, :3, 3], atol=1e-6)
    np.testing.assert_allclose(curve.GetPrim().GetAttribute("thingmap:stamps").Get(), stamps)
    box = UsdGeom.BBoxCache(0.0, ["default"]).ComputeWorldBound(stage.GetPrimAtPath("/Map/Things/thing_0001"))
    assert np.prod(box.ComputeAlignedRange().GetSize()) >= 0.2**3 - 1e-6


def test_ids_that_usd_does_not_allow(make_thing, make_map, tmp_path):
    folder = OutputFolder.create(tmp_path / "out")
    ids = ["7 up", "a-b", "a b", "größe"]
    folder.write_map(make_map(*(make_thing(n, id=name) for n, name in enumerate(ids))))
    assert export_usd(folder, tmp_path / "map.usda") == 4
    stage = Usd.Stage.Open(str(tmp_path / "map.usda"))
    things = stage.GetPrimAtPath("/Map/Things").GetChildren()
    assert [prim.GetAttribute("thingmap:id").Get() for prim in things] == ids


def test_a_map_of_nothing(empty_folder, tmp_path):
    assert export_usd(empty_folder, tmp_path / "map.usda") == 0
    stage = Usd.Stage.Open(str(tmp_path / "map.usda"))
    assert not stage.GetPrimAtPath("/Map/Things").GetChildren()


def test_mistakes_are_named(folder, tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"\.usdc"):
        export_usd(folder, tmp_path / "map.xyz")
    with pytest.raises(UserError, match="cannot be written"):
        export_usd(folder, tmp_path / "absent" / "map.usda")
    assert not (tmp_path / "absent").exists()
    monkeypatch.setitem(sys.modules, "pxr.Usd", None)  # makes its import fail
    with pytest.raises(UserError, match=r"\[usd\]"):
        export_usd(folder, tmp_path / "map.usda")
    assert not list(tmp_path.glob("*.usda"))

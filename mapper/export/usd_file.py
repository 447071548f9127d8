"""USD: boxes, cloud and path as a stage for Omniverse, Blender, usdview and simulators.

    /Map                 turns the map's axes to the stage's z up; custom data say what the map's axes are
      /Things/thing_0007 an Xform a thing (moved, turned, scaled to its size) over a unit Cube; attributes `thingmap:*`
      /Cloud             UsdGeomPoints
      /Trajectory        UsdGeomBasisCurves through the cameras, `thingmap:stamps`

Metres; below /Map everything is in the map's own axes. Needs usd-core (`pip install "thingmap[usd]"`).
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ..map.atomic import write_atomic
from ..map.boxes import box_axes
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from ..map.thing import Thing
from .chosen import DEFAULT_POINTS, read_path, read_points, read_things, title
from .colors import class_color, linear_color
from .optional import optional_module
from .rotations import quaternions

ENDINGS = (".usd", ".usda", ".usdc")
POINT_WIDTH, PATH_WIDTH = 0.01, 0.01  # m, as they are drawn; a cloud has one point in 2 cm by default
OPACITY = 0.35  # of boxes
SMALLEST = 1e-6  # m; a scale of zero cannot be inverted


def export_usd(folder: OutputFolder, file: Path, *, points: int = DEFAULT_POINTS, min_existence: float = 0.0) -> int:
    """Write a stage, as text for `.usda` and in binary for `.usd` and `.usdc`; returns the number of things.

    Args:
        folder: of the run.
        file: to write; its ending chooses the encoding.
        points: of the cloud at most; 0 for none.
        min_existence: things below it are left out.

    Raises:
        UserError: usd-core is not installed.
        InputError: another ending.
    """
    pxr = {name: optional_module(f"pxr.{name}", "usd-core", "usd") for name in ("Gf", "Sdf", "Usd", "UsdGeom")}
    if file.suffix not in ENDINGS:
        raise InputError(file, f"a file name ending in {', '.join(ENDINGS)}", repr(file.suffix), "choose one of them")
    object_map = read_things(folder, min_existence)
    cloud, path = read_points(folder, points), read_path(folder)
    stage = _Stage(pxr, object_map)
    for thing in object_map.things:
        stage.add_thing(thing, object_map.R_world_upright)
    stage.add_cloud(*cloud)
    stage.add_path(*path)
    write_atomic(file, stage.encode(file.suffix))
    return len(object_map)


class _Stage:
    """A stage that is being filled, with the modules of pxr by name."""

    def __init__(self, pxr: dict[str, Any], object_map: ObjectMap) -> None:
        self._gf, self._sdf, self._geom = pxr["Gf"], pxr["Sdf"], pxr["UsdGeom"]
        self._stage = pxr["Usd"].Stage.CreateInMemory()
        self._geom.SetStageUpAxis(self._stage, self._geom.Tokens.z)
        self._geom.SetStageMetersPerUnit(self._stage, 1.0)
        root = self._geom.Xform.Define(self._stage, "/Map")
        self._stage.SetDefaultPrim(root.GetPrim())
        root.AddOrientOp(self._geom.XformOp.PrecisionDouble).Set(self._quaternion(object_map.R_world_upright.T))
        about = {
            "source": object_map.source,
            "frame": str(object_map.frame),
            "units": "metres, seconds, radians",
            "up": self._gf.Vec3d(*object_map.up.direction.tolist()),
            "axes": "children are in the map's axes, in which `up` is; this prim turns them to z up",
        }
        root.GetPrim().SetCustomDataByKey("thingmap", about)
        self._geom.Scope.Define(self._stage, "/Map/Things")

    def add_thing(self, thing: Thing, R_world_upright: np.ndarray) -> None:
        """An Xform with the thing's numbers over a Cube."""
        name = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in thing.id)
        path = f"/Map/Things/{name if name[:1].isalpha() else f'_{name}'}"
        while self._stage.GetPrimAtPath(path):  # ids that differ only in what USD does not allow
            path += "_"
        form = self._geom.Xform.Define(self._stage, path)
        form.GetPrim().SetDisplayName(title(thing))
        double = self._geom.XformOp.PrecisionDouble
        form.AddTranslateOp(double).Set(self._gf.Vec3d(*thing.position.tolist()))
        form.AddOrientOp(double).Set(self._quaternion(box_axes(thing.yaw, R_world_upright)))
        form.AddScaleOp(double).Set(self._gf.Vec3d(*np.maximum(thing.size, SMALLEST).tolist()))
        self._add_numbers(form.GetPrim(), thing)
        box = self._geom.Cube.Define(self._stage, f"{path}/Box")
        box.CreateSizeAttr(1.0)
        box.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
        box.CreateDisplayColorAttr([self._gf.Vec3f(*linear_color(class_color(thing.label)).tolist())])
        box.CreateDisplayOpacityAttr([OPACITY])

    def add_cloud(self, points: np.ndarray, colors: np.ndarray) -> None:
        """(M, 3) metres and (M, 3) uint8 sRGB."""
        if not len(points):
            return
        cloud = self._geom.Points.Define(self._stage, "/Map/Cloud")
        positions = np.ascontiguousarray(points, dtype=np.float32)
        cloud.CreatePointsAttr(positions)
        cloud.CreateExtentAttr(np.stack([positions.min(axis=0), positions.max(axis=0)]))
        cloud.CreateWidthsAttr(np.array([POINT_WIDTH], dtype=np.float32))
        cloud.SetWidthsInterpolation(self._geom.Tokens.constant)
        light = cloud.CreateDisplayColorPrimvar(self._geom.Tokens.vertex)
        light.Set(linear_color(colors).astype(np.float32))

    def add_path(self, stamps: np.ndarray, T_world_camera: np.ndarray) -> None:
        """(N,) seconds and (N, 4, 4), at least two."""
        if len(stamps) < 2:
            return
        curve = self._geom.BasisCurves.Define(self._stage, "/Map/Trajectory")
        positions = T_world_camera[:, :3, 3].astype(np.float32)
        curve.CreateTypeAttr(self._geom.Tokens.linear)
        curve.CreateCurveVertexCountsAttr([len(stamps)])
        curve.CreatePointsAttr(positions)
        curve.CreateExtentAttr(np.stack([positions.min(axis=0), positions.max(axis=0)]))
        curve.CreateWidthsAttr(np.array([PATH_WIDTH], dtype=np.float32))
        curve.SetWidthsInterpolation(self._geom.Tokens.constant)
        self._set(curve.GetPrim(), "stamps", self._sdf.ValueTypeNames.DoubleArray, stamps.tolist())

    def encode(self, ending: str) -> bytes:
        """The stage as a file of that ending. USD writes to files alone, and makes folders that nobody asked for."""
        with TemporaryDirectory() as folder:
            file = Path(folder) / f"map{ending}"
            self._stage.GetRootLayer().Export(str(file))
            return file.read_bytes()

    def _add_numbers(self, prim: Any, thing: Thing) -> None:
        """What `map.json` says of a thing, as attributes in the map's axes."""
        types, gf = self._sdf.ValueTypeNames, self._gf
        ranked = sorted(thing.class_posterior.items(), key=lambda item: (-item[1], item[0]))
        values = {
            "id": (types.String, thing.id),
            "label": (types.String, thing.label),
            "name": (types.String, thing.name or ""),
            "probability": (types.Double, thing.probability),
            "existence": (types.Double, thing.existence),
            "classes": (types.StringArray, [label for label, _ in ranked]),
            "classProbabilities": (types.DoubleArray, [p for _, p in ranked]),
            "position": (types.Double3, gf.Vec3d(*thing.position.tolist())),
            "positionCovariance": (types.Matrix3d, gf.Matrix3d(*thing.position_covariance.ravel().tolist())),
            "size": (types.Double3, gf.Vec3d(*thing.size.tolist())),
            "sizeStd": (types.Double3, gf.Vec3d(*thing.size_std.tolist())),
            "yaw": (types.Double, thing.yaw),
            "firstSeen": (types.Double, thing.first_seen),
            "lastSeen": (types.Double, thing.last_seen),
            "supportingViews": (types.Int, thing.evidence.supporting),
            "occludedViews": (types.Int, thing.evidence.occluded),
            "contradictingViews": (types.Int, thing.evidence.contradicting),
        }
        for name, (kind, value) in values.items():
            self._set(prim, name, kind, value)

    def _set(self, prim: Any, name: str, kind: Any, value: Any) -> None:
        prim.CreateAttribute(f"thingmap:{name}", kind, True).Set(value)

    def _quaternion(self, R: np.ndarray) -> Any:
        x, y, z, w = quaternions(R).tolist()
        return self._gf.Quatd(w, x, y, z)

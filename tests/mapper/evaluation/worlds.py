"""A small scene known exactly, and the run of a mapper that found all of it: NumPy only, nothing is rendered.

Eight boxes of four classes stand on a table; the camera goes round them at 10 Hz and sees all of them in every frame.
Nothing hides anything here: `visibility` is 1 by definition.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.truth import NO_OBJECT, FrameTruth, PointTruth, TrueObject
from thingmap.detectors.detections import Detections
from thingmap.mapper.evaluation.inputs.case import KeyframePoses, MappedRun, Snapshot
from thingmap.mapper.map.boxes import box_corners
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection
from thingmap.mapper.map.upright import upright_rotation

CLASSES = ("bowl", "cereal box", "cup", "soda can")
INTRINSICS = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
FRAMES = 40
RATE = 10.0  # Hz
TABLE_HEIGHT = 0.72  # m
UP = np.array([0.0, 0.0, 1.0])
SURE = 1.0 - 1e-6  # probabilities of a perfect map; a logarithm of exactly 0 helps no test

# class, x and y on the table, size (metres), yaw (radians)
_OBJECTS = (
    ("bowl", (-0.28, -0.20), (0.16, 0.16, 0.07), 0.0),
    ("bowl", (0.26, 0.18), (0.18, 0.18, 0.08), 0.7),
    ("cereal box", (0.02, 0.28), (0.19, 0.06, 0.26), 0.4),
    ("cereal box", (-0.05, -0.30), (0.20, 0.07, 0.24), -0.5),
    ("cup", (0.05, 0.02), (0.12, 0.09, 0.10), 1.1),
    ("cup", (-0.31, 0.10), (0.11, 0.08, 0.09), -2.0),
    ("soda can", (0.27, -0.15), (0.066, 0.066, 0.12), 0.0),
    ("soda can", (-0.15, 0.20), (0.066, 0.066, 0.12), 0.3),
)


def make_truth() -> GroundTruth:
    """The scene, with what can be seen of it in every frame and a labelled cloud."""
    objects = tuple(
        TrueObject(k, label, np.array([x, y, TABLE_HEIGHT + size[2] / 2]), np.array(size), yaw)
        for k, (label, (x, y), size, yaw) in enumerate(_OBJECTS)
    )
    poses = orbit(FRAMES)
    return GroundTruth(
        name="eight boxes",
        classes=CLASSES,
        objects=objects,
        up=UP,
        intrinsics=INTRINSICS,
        names=tuple(f"frame-{k:06d}" for k in range(FRAMES)),
        stamps=100.0 + np.arange(FRAMES) / RATE,
        poses=poses,
        frame_truth=lambda index: see_boxes(objects, poses[index]),
        point_truth=lambda: labelled_cloud(objects),
    )


def orbit(count: int) -> np.ndarray:
    """(N, 4, 4) `T_world_camera` on two thirds of a circle about the table, rising and falling, eyes on its middle."""
    angle = np.linspace(0.0, 4.0 * np.pi / 3.0, count)
    positions = np.stack([1.25 * np.cos(angle), 1.25 * np.sin(angle), 1.45 + 0.1 * np.sin(2.0 * angle)], axis=1)
    forward = np.array([0.0, 0.0, TABLE_HEIGHT + 0.05]) - positions
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    right = np.cross(forward, UP)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = right, np.cross(forward, right), forward
    poses[:, :3, 3] = positions
    return poses


def see_boxes(objects: Sequence[TrueObject], T_world_camera: np.ndarray) -> FrameTruth:
    """The image boxes of the objects' corners; all of every object is visible."""
    corners = np.stack([box_corners(thing.position, thing.size, thing.yaw, np.eye(3)) for thing in objects])
    R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
    uv = INTRINSICS.project((corners.reshape(-1, 3) - t) @ R).reshape(len(objects), 8, 2)
    xyxy = np.concatenate([uv.min(axis=1), uv.max(axis=1)], axis=1)
    ids, count = np.array([thing.id for thing in objects]), len(objects)
    return FrameTruth(ids, xyxy, xyxy.copy(), np.ones(count), np.ones((count, 5)))


def labelled_cloud(objects: Sequence[TrueObject]) -> PointTruth:
    """Points 1 mm inside the surfaces of the boxes, their bottoms left out, and of the table beside them."""
    points, owners = [], []
    for thing in objects:
        surface = _box_surface(thing.size - 0.002, 0.01)
        points.append(surface @ _turn(thing.yaw).T + thing.position)
        owners.append(np.full(len(surface), thing.id))
    across = np.arange(-0.6, 0.6001, 0.02)
    table = np.stack([*np.meshgrid(across, across), np.full((len(across),) * 2, TABLE_HEIGHT)], axis=-1).reshape(-1, 3)
    beside = np.ones(len(table), dtype=bool)
    for thing in objects:
        local = np.abs((table - thing.position) @ _turn(thing.yaw))[:, :2]
        beside &= np.any(local > thing.size[:2] / 2 + 0.005, axis=1)
    points.append(table[beside])
    owners.append(np.full(int(beside.sum()), NO_OBJECT))
    object_id = np.concatenate(owners)
    class_of = np.array([*(CLASSES.index(thing.label) for thing in objects), NO_OBJECT])
    return PointTruth(np.concatenate(points).astype(np.float32), class_of[object_id], object_id)


def make_perfect_run(truth: GroundTruth, labelled: bool = False) -> MappedRun:
    """What a mapper without any error would leave, in the axes of the first camera.

    Its things are those of the truth in the same order, "thing-0000" being object 0; the truth needs poses and
    objects of known position and size. With `labelled` the points of the cloud carry their classes.
    """
    assert truth.poses is not None
    T_map_world = np.linalg.inv(truth.poses[0])
    poses = T_map_world @ truth.poses
    up = T_map_world[:3, :3] @ (UP if truth.up is None else truth.up)
    things = tuple(perfect_thing(thing, truth, T_map_world, up) for thing in truth.objects)
    object_map = ObjectMap(things, truth.classes, truth.name, MapFrame.FIRST_CAMERA, UpDirection(up, 1e-4, "planes"))
    keys = np.arange(0, len(poses), 4)
    return MappedRun(
        folder=Path("perfect-run"),
        object_map=object_map,
        stamps=truth.stamps.copy(),
        poses=poses,
        report=make_report(truth, len(keys)),
        snapshots=tuple(Snapshot(k + 1, truth.stamps[k], poses[k], object_map) for k in range(len(poses))),
        keyframes=KeyframePoses(truth.stamps[keys], poses[keys], np.tile(1e-6 * np.eye(6), (len(keys), 1, 1))),
        cloud=lambda: _mapped_cloud(truth, T_map_world, labelled),
    )


def perfect_thing(true: TrueObject, truth: GroundTruth, T_map_world: np.ndarray, up: np.ndarray) -> Thing:
    """An object of the truth as a map of the same classes would hold it; `up` (3,) is the map's."""
    along = upright_rotation(up).T @ T_map_world[:3, :3] @ _turn(true.yaw)[:, 0]
    others = [label for label in truth.classes if label != true.label]
    return Thing(
        id=f"thing-{true.id:04d}",
        label=true.label,
        probability=SURE,
        existence=SURE,
        class_posterior={true.label: SURE, **dict.fromkeys(others, (1.0 - SURE) / max(len(others), 1))},
        position=T_map_world[:3, :3] @ true.position + T_map_world[:3, 3],
        position_covariance=1e-8 * np.eye(3),
        size=true.size,
        size_std=np.full(3, 1e-4),
        yaw=float(np.arctan2(along[1], along[0])),
        first_seen=float(truth.stamps[0]),
        last_seen=float(truth.stamps[-1]),
        evidence=Evidence(len(truth.stamps), 0, 0),
    )


def with_things(run: MappedRun, things: Sequence[Thing]) -> MappedRun:
    """The run with other things, in the final map and in all snapshots."""
    object_map = replace(run.object_map, things=tuple(things))
    snapshots = tuple(replace(snapshot, object_map=object_map) for snapshot in run.snapshots)
    return replace(run, object_map=object_map, snapshots=snapshots)


def perfect_detections(truth: GroundTruth, score: float = 1.0) -> Callable[[int], Detections]:
    """A detector that finds every visible box of the truth, by index of the frame."""

    def detect(index: int) -> Detections:
        assert truth.frame_truth is not None
        seen = truth.frame_truth(index)
        if seen is None:
            return Detections.empty(truth.classes)
        labels = {thing.id: truth.classes.index(thing.label) for thing in truth.objects}
        rows = np.flatnonzero(np.isfinite(seen.xyxy_visible).all(axis=1))
        class_id = [labels[int(seen.object_id[row])] for row in rows]
        edges = seen.xyxy_visible[rows] + 0.5  # detections count from the image's outer edge
        return Detections.from_best_class(truth.classes, edges, class_id, np.full(len(rows), score))

    return detect


def make_report(truth: GroundTruth, keyframes: int) -> dict:
    """`report.json` of a run over all frames of the truth at 20 frames per second."""
    count = len(truth.stamps)
    stage = {"mean_ms": 40.0, "median_ms": 38.0, "p95_ms": 61.0, "total_ms": 40.0 * count}
    return {
        "source": truth.name,
        "frames_total": count,
        "frames_used": count,
        "frames_skipped": 0,
        "skipped": {},
        "keyframes": keyframes,
        "things": len(truth.objects),
        "stopped": None,
        "seconds": count / 20.0,
        "frames_per_second": 20.0,
        "stages": {"reading": {name: value / 4.0 for name, value in stage.items()}, "mapping": stage},
        "peak_memory_mb": 512.0,
        "command": {"sequence": truth.name, "detector": "none", "stride": 1, "max_frames": None},
        "mapper": {},
    }


def _mapped_cloud(truth: GroundTruth, T_map_world: np.ndarray, labelled: bool) -> tuple[np.ndarray, np.ndarray | None]:
    assert truth.point_truth is not None
    true = truth.point_truth()
    points = true.points.astype(np.float64) @ T_map_world[:3, :3].T + T_map_world[:3, 3]
    return points, true.class_id.copy() if labelled else None


def _box_surface(size: np.ndarray, step: float) -> np.ndarray:
    """(N, 3) points on all faces but the bottom, box axes, at most `step` metres apart along each edge."""
    grids = [np.linspace(-s / 2, s / 2, int(np.ceil(s / step)) + 1) for s in size]
    points = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3)
    outer = np.isclose(np.abs(points), size / 2)
    return points[outer[:, 0] | outer[:, 1] | (outer[:, 2] & (points[:, 2] > 0.0))]


def _turn(yaw: float) -> np.ndarray:
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

"""A finished map for rerun's viewer: cloud, things and path, without time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..map.atomic import replacing
from ..map.store import OutputFolder
from .rerun_cloud import CLOUD
from .rerun_layout import send_map_layout
from .rerun_package import import_rerun, new_recording
from .rerun_path import PathDrawer
from .rerun_things import ThingDrawer
from .shown_things import shown_map

POINT_RADIUS = 0.01  # m: half a voxel of the cloud as it is by default
ELEVATION, DISTANCE = 0.6, 1.3  # of the eye: rise over run, and distance over the map's extent


def export_rrd(folder: OutputFolder, file: Path) -> int:
    """Write a map as a recording that rerun opens; returns the number of things.

    Entities are those of the live view: `world/cloud`, `world/things` (labelled boxes), `world/positions` (where their
    centres are with 95 %), `world/doubtful` and `world/path`; all are static. What is absent from the folder is left
    out, but for the map.

    Raises:
        UserError: rerun is not installed, or the file cannot be written.
        InputError: a file of the folder is damaged.
    """
    rr, object_map = import_rerun(), folder.read_map()
    recording = new_recording(object_map.source)
    points, colors = folder.read_cloud() if folder.cloud_file.is_file() else (np.empty((0, 3)), np.empty((0, 3)))
    places = np.empty((0, 3))
    with replacing(file) as temporary:
        recording.save(temporary)
        if len(points):
            shapes = rr.Points3D(points.astype(np.float32), colors=colors, radii=POINT_RADIUS)
            recording.log(CLOUD, shapes, static=True)
        if folder.trajectory_file.is_file():
            _, poses = folder.read_trajectory()
            places = poses[:, :3, 3]
            no_loops = np.empty((0, 2), dtype=np.int64)
            PathDrawer(recording, static=True).draw(np.ones(len(poses), dtype=bool), poses, no_loops)
        things = shown_map(object_map)
        ThingDrawer(recording, static=True).draw(things)
        eye, target = _eye(things.position if len(things) else places, places, object_map.up.direction)
        send_map_layout(recording, eye, target, object_map.up.direction)
        recording.flush()
        recording.disconnect()  # the file is whole only then
    return len(object_map)


def _eye(middle: np.ndarray, places: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) eye and (3,) what it looks at: the middle of some places, from the side from which the camera saw them.

    Args:
        middle: (N, 3) places of which the middle is looked at.
        places: (M, 3) of the camera.
        up: (3,).
    """
    target = middle.mean(axis=0) if len(middle) else np.zeros(3)
    extent = float(np.linalg.norm(np.ptp(middle, axis=0))) if len(middle) else 0.0
    back = (places.mean(axis=0) if len(places) else np.array([0.3, 0.4, 0.5])) - target
    back = back - (back @ up) * up
    length = float(np.linalg.norm(back))
    back = back / length if length > 1e-6 else np.cross(up, np.roll(up, 1))  # the camera went all around
    return target + max(DISTANCE * extent, 1.0) * (back + ELEVATION * up), target

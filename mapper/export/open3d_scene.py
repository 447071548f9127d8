"""A finished map as Open3D geometries, for Open3D's viewers and algorithms.

Open3D is imported here and nowhere else: it needs shared libraries that a clean machine does not have.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ...datasets.errors import UserError
from ..map.boxes import box_axes
from ..map.store import OutputFolder
from .colors import class_color

PACKAGES = "libusb-1.0-0 libegl1 libgl1 libx11-6 libudev1 libidn2-0 libgomp1"


def load_open3d() -> ModuleType:
    """The `open3d` module.

    Raises:
        UserError: where it cannot be loaded; it names the Debian packages that bring what is missing.
    """
    try:
        import open3d
    except (ImportError, OSError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(f"Open3D cannot be loaded ({reason}); on Debian: apt install {PACKAGES}") from None
    return open3d


def to_open3d(out: str | Path) -> list[Any]:
    """The cloud and the oriented boxes of a run's output folder, in the map's frame, metres.

        open3d.visualization.draw_geometries(to_open3d("out/tabletop"))

    Returns:
        One `PointCloud`, then one `OrientedBoundingBox` a thing, in the map's order and its class colour.

    Raises:
        UserError: where Open3D cannot be loaded.
        InputError: where `out` is not a run's output folder.
    """
    o3d = load_open3d()
    folder = OutputFolder.open(Path(out))
    things = folder.read_map()
    points, colors = folder.read_cloud()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(points, dtype=np.float64)))
    cloud.colors = o3d.utility.Vector3dVector(colors / 255.0)
    boxes = []
    for thing in things.things:
        axes = box_axes(thing.yaw, things.R_world_upright)
        box = o3d.geometry.OrientedBoundingBox(thing.position, axes, thing.size)
        box.color = np.array(class_color(thing.label)) / 255.0
        boxes.append(box)
    return [cloud, *boxes]

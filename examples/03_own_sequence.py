"""Frames of your own, from a camera's driver or any files: no folder has to be written.

A frame is colour, depth in metres registered to it, a stamp, and the pinhole camera. Here they come from a function
that stands for your camera: it renders.
"""

from collections.abc import Iterator

import numpy as np

from thingmap.datasets import Frame, Intrinsics, open_sequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper import SemanticMapper

rendered = open_sequence("synth:tabletop?seed=4&objects=6&frames=45&width=320")


def camera() -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """Stamp in seconds, (H, W, 3) uint8 RGB, (H, W) uint16 millimetres: what a driver gives."""
    for frame in rendered:
        yield frame.stamp, frame.color, (frame.depth * 1000.0).astype(np.uint16)


k = rendered.intrinsics
intrinsics = Intrinsics(k.width, k.height, fx=k.fx, fy=k.fy, cx=k.cx, cy=k.cy)
mapper = SemanticMapper(make_detector("simulated", rendered), source="my camera")
for index, (stamp, rgb, millimetres) in enumerate(camera()):
    frame = Frame(
        index=index,
        name=f"{index:06d}",
        stamp=stamp,
        color=rgb,
        depth=millimetres.astype(np.float32) / 1000.0,  # metres, 0 where there is no reading
        intrinsics=intrinsics,
    )
    mapper.process_frame(frame)

stamps, poses = mapper.trajectory()  # (N,) seconds, (N, 4, 4) T_world_camera
print(f"{len(stamps)} poses, the last at {poses[-1, :3, 3].round(3)} m from the first camera")
for thing in mapper.object_map().things:
    print(f"{thing.label} of {(100 * thing.size).round(1)} ± {(100 * thing.size_std).round(1)} cm")

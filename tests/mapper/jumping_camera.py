"""A camera over a table (`lasting_world`) whose pose jumps by 30 cm and 10 degrees, of which its odometry tells.

The mapper is `SemanticMapper` itself with given poses; loops are closed by the tests.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from lasting_world import Block, Film, around
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import CloudConfig, KeyframeConfig, LoopConfig, MapperConfig, OdometryConfig, OdometrySource
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.records import Loop
from thingmap.mapper.estimation.scene import Scene
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.estimation.tracks import Track
from thingmap.mapper.mapper import SemanticMapper

CONFIG = MapperConfig(
    odometry=OdometryConfig(source=OdometrySource.POSES),
    keyframes=KeyframeConfig(max_gap=1),
    loops=LoopConfig(enabled=False),  # the tests close them
    cloud=CloudConfig(pixel_step=1, max_range=1.6),  # where depth is good to 4 mm
)
CUP = Block("cup", (0.3, 0.0), (0.09, 0.09, 0.1))
CEREAL = Block("cereal box", (-0.05, 0.25), (0.2, 0.07, 0.3))
BOOK = Block("book", (-0.35, -0.05), (0.2, 0.15, 0.04))
BOWL = Block("bowl", (0.0, -0.2), (0.15, 0.15, 0.07))
TABLE = (CUP, CEREAL, BOOK, BOWL)
FIRST, SECOND, THIRD = np.arange(-25.0, 25.0, 5.0), np.arange(22.0, -28.0, -5.0), np.arange(-20.0, 30.0, 5.0)
JUMPS = {  # (3,) metres, camera axes; axis of the turn by 10 degrees, camera axes
    "up": ([0.0, -0.3, 0.0], [0.0, -1.0, 0.3]),
    "up and to the left": ([-0.21, -0.21, 0.0], [0.0, -1.0, 0.0]),
    "up and away": ([0.0, -0.25, 0.16], [1.0, 0.0, 0.0]),
    "to the right": ([0.3, 0.0, 0.0], [0.0, 1.0, 0.0]),
}
LOOSE = np.diag(np.repeat([0.2**2, 0.4**2], 3))  # rad, m: what the odometry says of the jump
TIGHT = np.diag(np.repeat([0.002**2, 0.004**2], 3))  # of the loop closure
NEAR = 0.05  # m from the middle of a block to what stands for it
Member = TypeVar("Member", Landmark, Track)


class Drive:
    """A mapper under way; from `jump` on its camera's poses are off by `T_jump` in camera axes."""

    def __init__(self, shift: list[float], axis: list[float], config: MapperConfig = CONFIG) -> None:
        self.film, self.T_jump = Film(), np.eye(4)
        self.T_jump[:3, :3] = Rotation.from_rotvec(np.radians(10.0) * np.array(axis) / np.linalg.norm(axis)).as_matrix()
        self.T_jump[:3, 3] = shift
        self.mapper = SemanticMapper(self.film.detect, config, gravity=np.array([0.0, 0.0, -1.0]))
        self.T_wrong_true = np.eye(4)
        self.truth: list[np.ndarray] = []

    def go(self, angles: Iterable[float], *blocks: Block) -> None:
        for frame in self.film.walk(angles, *(blocks or TABLE)):
            self.feed(frame)

    def feed(self, frame: Frame) -> None:
        assert frame.T_world_camera is not None
        self.truth.append(frame.T_world_camera)
        self.mapper.process_frame(replace(frame, T_world_camera=self.T_wrong_true @ frame.T_world_camera))

    def jump(self, angle: float, *blocks: Block) -> None:
        """The first frame after the jump."""
        T_true, add = around(angle), self.smoother.add_keyframe
        self.T_wrong_true = T_true @ self.T_jump @ np.linalg.inv(T_true)
        self.smoother.add_keyframe = lambda T_a_b, _, T: add(T_a_b, LOOSE, T)  # type: ignore[method-assign]
        self.go([angle], *blocks)
        self.smoother.add_keyframe = add  # type: ignore[method-assign]

    def close_loop(self, a: int, b: int) -> None:
        """Keyframe b is seen to be where it is from keyframe a; everything follows."""
        self.smoother.add(Loop(a, b, np.linalg.inv(self.truth[a]) @ self.truth[b], TIGHT))
        self.smoother.update()
        assert self.follow()

    def follow(self) -> bool:
        assert self.mapper._followers is not None
        if not self.mapper._followers.follow():
            return False
        self.mapper._cloud.rebuild(self.smoother.poses())
        return True

    @property
    def smoother(self) -> Smoother:
        return self.mapper._camera.smoother

    @property
    def scene(self) -> Scene:
        return self.mapper._scene

    @property
    def landmarks(self) -> list[Landmark]:
        return list(self.mapper._scene.landmarks.values())


def at(members: Iterable[Member], block: Block) -> list[Member]:
    """What stands for a block."""
    return [x for x in members if np.linalg.norm(x.position - block.centre) < NEAR]


def mapped_twice(
    jump: tuple[list[float], list[float]], config: MapperConfig = CONFIG, second: Iterable[float] = SECOND
) -> Drive:
    """A table, the jump (as of `JUMPS`), and the table again; no loop was closed yet."""
    drive = Drive(*jump, config)
    drive.go(FIRST)
    drive.jump(24.0)
    drive.go(second)
    return drive


def drive_across(yaw: float, bearing: float) -> Drive:
    """`mapped_twice` with a jump of 30 cm across the table: bearing in degrees from the camera's right; turn by yaw."""
    a = np.radians(bearing)
    return mapped_twice(([0.3 * np.cos(a), 0.0, 0.3 * np.sin(a)], [0.0, yaw, 0.0]))


def worst_pose(drive: Drive) -> float:
    """Metres, of the keyframes so far."""
    off = drive.smoother.poses()[:, :3, 3] - np.array(drive.truth)[:, :3, 3]
    return float(np.linalg.norm(off, axis=1).max())

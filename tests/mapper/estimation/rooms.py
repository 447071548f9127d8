"""A room of known cameras and objects, and the smoother that is told what those cameras see of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.odometry import pose3
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import SmootherConfig
from thingmap.mapper.estimation.records import Box, DepthCentre
from thingmap.mapper.estimation.size_site import SizeSite
from thingmap.mapper.estimation.smoother import Smoother

KINECT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
EXACT = SmootherConfig(
    relinearize_skip=1,
    threshold_rotation=1e-6,
    threshold_translation=1e-6,
    threshold_position=1e-6,
    threshold_size=1e-6,
    threshold_up=1e-6,
)
STEP = np.diag(np.repeat([0.005**2, 0.01**2], 3))  # covariance of a step of odometry, rad^2 and m^2


def look_at(position: Sequence[float], target: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """(4, 4) `T_world_camera` of an upright camera; the world's z is up."""
    forward = np.subtract(target, position) / np.linalg.norm(np.subtract(target, position))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T[:3, 3] = position
    return T


class Room:
    """A smoother that is told what true cameras see of true objects.

    Attributes:
        smoother: what is tested; `EXACT` thresholds unless told otherwise.
        cameras: (4, 4) true `T_world_camera`, by keyframe.
        objects: landmark -> true (3,) position and (3,) log half-axes.
    """

    def __init__(self, config: SmootherConfig = EXACT, up_sigma: float = 0.01, tolerance: float = 0.026) -> None:
        self.smoother = Smoother(config, KINECT, tolerance)
        self.cameras: list[np.ndarray] = []
        self.objects: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._up_sigma = up_sigma

    def add_camera(self, T: np.ndarray, error: np.ndarray | None = None, covariance: np.ndarray = STEP) -> int:
        """The next keyframe; its odometry is off by the (6,) tangent `error`."""
        if self.cameras:
            self.smoother.update()
            motion = pose3(np.linalg.inv(self.cameras[-1]) @ T).retract(np.zeros(6) if error is None else error)
            self.smoother.add_keyframe(motion.matrix(), covariance)
        else:
            self.smoother.add_first(T, np.full(6, 1e-3), np.array([0.0, 0.0, 1.0]), self._up_sigma)
        self.cameras.append(T)
        return len(self.cameras) - 1

    def add_object(
        self, number: int, position: Sequence[float], half_axes: Sequence[float], site: SizeSite | None = None
    ) -> None:
        """A landmark that starts 2 cm and 0.1 log units off."""
        place, log_size = np.array(position, dtype=float), np.log(half_axes)
        self.objects[number] = place, log_size
        own = SizeSite(log_size, 4.0 * np.eye(3)) if site is None else site
        self.smoother.add_landmark(number, place + 0.02, log_size + 0.1, own)

    def see(self, keyframe: int, number: int, sigma_px: float = 2.0, sides: np.ndarray | None = None) -> None:
        """An exact measurement of an object, or one whose box `sides` are off by (4,) pixels."""
        self.see_centre(keyframe, number)
        self.see_box(keyframe, number, sigma_px, sides)

    def see_centre(self, keyframe: int, number: int) -> None:
        """The exact centre from depth, known to 2 cm across and 5 cm along the ray."""
        T, (position, _) = self.cameras[keyframe], self.objects[number]
        self.smoother.add(DepthCentre(keyframe, number, T[:3, :3].T @ (position - T[:3, 3]), 0.02, 0.05, 1.0))

    def see_box(self, keyframe: int, number: int, sigma_px: float = 2.0, sides: np.ndarray | None = None) -> None:
        """The exact box, or one whose `sides` are off by (4,) pixels."""
        position, log_size = self.objects[number]
        box = project_solids(self.cameras[keyframe], np.eye(3), position[None], log_size[None], KINECT)[0][0]
        box = box if sides is None else box + sides
        self.smoother.add(Box(keyframe, number, box, np.ones(4, bool), sigma_px))

    @classmethod
    def seen_from(cls, positions: Sequence[Sequence[float]], *objects: Sequence[float], **kwargs) -> Room:
        """Objects 1, 2, ... of half-axes 0.1, 0.15, 0.2 m, each seen exactly from every camera position, and solved."""
        room = cls(**kwargs)
        for position in positions:
            room.add_camera(look_at(position))
        for number, place in enumerate(objects, 1):
            room.add_object(number, place, (0.1, 0.15, 0.2))
            for keyframe in range(len(positions)):
                room.see(keyframe, number)
        room.smoother.update()
        return room

"""A street of boxes under a spinning scanner with a camera beside it: LiDAR recordings with exact truth.

World axes: x along the street, y to the left, z up, ground at z = 0.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.synthetic.rendering.casting import Caster
from thingmap.detectors.detections import Detections

CAMERA = Intrinsics(480, 160, 280.0, 280.0, 239.5, 69.5)
T_CAMERA0_LIDAR = np.array([[0.0, -1, 0, 0.0], [0, 0, -1, -0.1], [1, 0, 0, -0.3], [0, 0, 0, 1]])
T_CAMERA_CAMERA0 = np.array([[1.0, 0, 0, 0.06], [0, 1, 0, 0.0], [0, 0, 1, 0.005], [0, 0, 0, 1]])
T_CAMERA_LIDAR = T_CAMERA_CAMERA0 @ T_CAMERA0_LIDAR
CLASSES = ("car", "bench", "waste bin")
HEIGHT = 1.7  # m, of the scanner above the ground
HZ = 10.0
SPEED = 6.0  # m/s
RANGE = 80.0  # m
NOISE = 0.02  # m
LINES = np.radians(np.linspace(-24.0, 6.0, 32))
AZIMUTHS = np.radians(np.arange(180.0, -180.0, -0.8))  # clockwise from behind, as a Velodyne turns
# triangles of a box by its corners, which count x, y and z low and high as (y, x, z) binary digits
FACES = np.array(
    [t for a, b, c, d in ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
     for t in ((a, b, c), (a, c, d))]
)  # fmt: skip


@dataclass(frozen=True)
class Box:
    """A box along the world's axes that stands on the ground: class (empty for buildings), (x, y), (x, y, z) sizes."""

    label: str
    place: tuple[float, float]
    size: tuple[float, float, float]
    color: tuple[int, int, int] = (90, 90, 90)

    @property
    def low(self) -> np.ndarray:
        return np.array([self.place[0] - self.size[0] / 2, self.place[1] - self.size[1] / 2, 0.0])

    @property
    def high(self) -> np.ndarray:
        return self.low + self.size

    @property
    def centre(self) -> np.ndarray:
        return (self.low + self.high) / 2

    @property
    def corners(self) -> np.ndarray:
        return np.array(np.meshgrid(*zip(self.low, self.high, strict=True))).reshape(3, -1).T


def street(seed: int = 0) -> tuple[Box, ...]:
    """Buildings of unequal depth with gaps, poles, and things between them and the road."""
    rng = np.random.default_rng(seed)
    boxes = []
    for side in (-1.0, 1.0):
        x = -30.0
        while x < 90.0:
            length, depth = rng.uniform(6.0, 14.0), rng.uniform(4.0, 8.0)
            front = rng.uniform(8.0, 11.0)
            boxes.append(Box("", (x + length / 2, side * (front + depth / 2)), (length, depth, rng.uniform(5.0, 9.0))))
            x += length + rng.uniform(1.0, 5.0)
        boxes += [Box("", (float(x), side * 6.5), (0.3, 0.3, 5.0)) for x in np.arange(-20.0, 80.0, 13.0) + 5 * side]
    boxes += [Box("", (95.0, 0.0), (4.0, 60.0, 8.0)), Box("", (-35.0, 0.0), (4.0, 60.0, 8.0))]
    return (
        *boxes,
        Box("car", (14.0, 4.2), (4.3, 1.8, 1.5), (200, 30, 30)),
        Box("car", (26.0, -4.4), (4.3, 1.8, 1.5), (30, 30, 200)),
        Box("bench", (20.0, 5.5), (1.5, 0.6, 0.85), (160, 110, 40)),
        Box("waste bin", (17.0, -4.8), (0.5, 0.5, 0.9), (30, 160, 60)),
    )


def drive(frames: int) -> tuple[np.ndarray, np.ndarray]:
    """(N,) seconds and (N, 4, 4) T_world_lidar of the drive."""
    stamps = 100.0 + np.arange(frames) / HZ
    return stamps, np.stack([pose_at(t) for t in stamps])


def pose_at(stamp: float) -> np.ndarray:
    """(4, 4) T_world_lidar of a vehicle that weaves along the street."""
    t = stamp - 100.0
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("zy", [0.24 * np.sin(1.2 * t), 0.01 * np.sin(3.0 * t)]).as_matrix()
    T[:3, 3] = SPEED * t, 0.8 * np.sin(0.7 * t), HEIGHT
    return T


def sweep(
    stamp: float,
    boxes: tuple[Box, ...],
    pose: Callable[[float], np.ndarray] = pose_at,
    moving: bool = False,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) float32 points in lidar axes and (N,) seconds after the stamp, which is the middle of the turn.

    Without `moving` every ray is cast from where the scanner is at the stamp.
    """
    azimuth, line = (a.ravel() for a in np.meshgrid(AZIMUTHS, LINES, indexing="ij"))
    rays = np.stack([np.cos(line) * np.cos(azimuth), np.cos(line) * np.sin(azimuth), np.sin(line)], axis=1)
    times = (np.arange(len(AZIMUTHS)) / len(AZIMUTHS) - 0.5) / HZ
    if moving:
        poses = np.stack([pose(stamp + t) for t in times]).repeat(len(LINES), axis=0)
    else:
        poses = pose(stamp)[None]
    distance, _ = cast(
        poses[:, :3, 3], np.einsum("nij,nj->ni", np.broadcast_to(poses[:, :3, :3], (len(rays), 3, 3)), rays), boxes
    )
    distance = distance + NOISE * np.random.default_rng([seed, round(stamp * 1e3)]).normal(size=len(rays))
    hit = distance < RANGE
    return (rays[hit] * distance[hit, None]).astype(np.float32), times.repeat(len(LINES))[hit]


def cast(origins: np.ndarray, rays: np.ndarray, boxes: tuple[Box, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(N,) distance in lengths of the rays, infinite where nothing is hit, and (N,) index of the box, -1 for ground."""
    caster, corners = _caster(boxes)
    origins = np.broadcast_to(origins, rays.shape)
    triangle = caster.first_hit(np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(rays, np.float32))
    a, b, c = np.swapaxes(corners[triangle], 0, 1)
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.einsum("ni,ni->n", normal, a - origins) / np.einsum("ni,ni->n", normal, rays)
    missed = triangle < 0
    return np.where(missed, np.inf, distance), np.where(missed, -1, triangle // len(FACES) - 1)


@cache
def _caster(boxes: tuple[Box, ...]) -> tuple[Caster, np.ndarray]:
    """Triangles of the ground, a flat box, and of the boxes, twelve each: (T, 3, 3)."""
    ground = np.array(np.meshgrid((-300.0, 300.0), (-300.0, 300.0), (-1.0, 0.0))).reshape(3, -1).T
    corners = np.concatenate([c[FACES] for c in (ground, *(box.corners for box in boxes))])
    return Caster(corners.astype(np.float32)), corners


def image(T_world_camera: np.ndarray, boxes: tuple[Box, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(H, W, 3) uint8 RGB in flat colours, (H, W) exact depth along z (inf for sky) and (H, W) index of the box."""
    k = CAMERA
    v, u = np.mgrid[0 : k.height, 0 : k.width]
    rays = k.back_project(np.stack([u.ravel(), v.ravel()], axis=1), np.ones(u.size)) @ T_world_camera[:3, :3].T
    depth, index = cast(T_world_camera[None, :3, 3], rays, boxes)
    colors = np.array([*(box.color for box in boxes), (60, 70, 60), (170, 200, 230)], dtype=np.uint8)
    shown = np.where(np.isfinite(depth), np.where(index < 0, len(boxes), index), len(boxes) + 1)
    return colors[shown].reshape(k.height, k.width, 3), depth.reshape(u.shape), index.reshape(u.shape)


class Finder:
    """A detector that knows the street: the box, with some noise, of every thing that is large and mostly in view."""

    classes = CLASSES

    def __init__(self, boxes: tuple[Box, ...], pose: Callable[[float], np.ndarray] = pose_at) -> None:
        self._boxes, self._pose = boxes, pose

    def __call__(self, frame: Frame, /) -> Detections:
        T_world_camera = self._pose(frame.stamp) @ np.linalg.inv(T_CAMERA_LIDAR)
        index = image(T_world_camera, self._boxes)[2]
        rng = np.random.default_rng(round(frame.stamp * 1e3))
        found, scores = [], []
        for i, box in enumerate(self._boxes):
            points = (box.corners - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
            if not box.label or points[:, 2].min() < 1.0:
                continue
            uv = CAMERA.project(points)
            if np.count_nonzero(index == i) < max(60.0, 0.6 * np.prod(np.ptp(uv, axis=0))):
                continue
            xyxy = np.r_[uv.min(axis=0), uv.max(axis=0)] + 0.5 + rng.normal(0.0, 0.7, 4)
            found.append(xyxy)
            row = rng.uniform(0.0, 0.04, len(CLASSES))
            row[CLASSES.index(box.label)] = rng.uniform(0.7, 0.95)
            scores.append(row)
        if not found:
            return Detections.empty(CLASSES)
        return Detections(CLASSES, np.array(found), np.array(scores)).clip(CAMERA.width, CAMERA.height)


def write_kitti(root: Path, frames: int, boxes: tuple[Box, ...], with_images: bool = True) -> Path:
    """Sequence 07 of the odometry layout under `root`, with poses of camera 0; returns its folder."""
    folder = root / "sequences" / "07"
    stamps, poses = drive(frames)
    (folder / "velodyne").mkdir(parents=True)
    (root / "poses").mkdir()
    T_lidar_camera0 = np.linalg.inv(T_CAMERA0_LIDAR)
    first = poses[0] @ T_lidar_camera0
    rows = []
    for i, (stamp, T) in enumerate(zip(stamps, poses, strict=True)):
        points, _ = sweep(stamp, boxes)
        np.c_[points, np.ones(len(points))].astype("<f4").tofile(folder / "velodyne" / f"{i:06d}.bin")
        rows.append(row_text((np.linalg.inv(first) @ T @ T_lidar_camera0)[:3]))
        if with_images:
            write_image(folder / "image_2" / f"{i:06d}.png", T @ np.linalg.inv(T_CAMERA_LIDAR), boxes)
    (root / "poses" / "07.txt").write_text("\n".join(rows) + "\n")
    (folder / "times.txt").write_text("".join(f"{t:.6e}\n" for t in stamps))
    P2 = CAMERA.matrix @ T_CAMERA_CAMERA0[:3]
    P0 = np.c_[CAMERA.matrix, np.zeros(3)]
    rows = {"P0": P0, "P1": P0, "P2": P2, "P3": P2, "Tr": T_CAMERA0_LIDAR[:3]}
    (folder / "calib.txt").write_text("".join(f"{key}: {row_text(matrix)}\n" for key, matrix in rows.items()))
    return folder


def write_pcd_folder(folder: Path, frames: int, boxes: tuple[Box, ...], with_images: bool = True) -> Path:
    """Moving sweeps with times, named by their stamps, with poses of the LiDAR."""
    stamps, poses = drive(frames)
    folder.mkdir(parents=True)
    rows = []
    for stamp, T in zip(stamps, poses, strict=True):
        points, times = sweep(stamp, boxes, moving=True)
        write_pcd(folder / f"{stamp:.6f}.pcd", points, times)
        rows.append(
            f"{stamp:.6f} " + " ".join(f"{x:.9f}" for x in (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()))
        )
        if with_images:
            write_image(folder / "images" / f"{stamp:.6f}.png", T @ np.linalg.inv(T_CAMERA_LIDAR), boxes)
    (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    k = CAMERA
    camera = {"width": k.width, "height": k.height, "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy}
    camera |= {"T_camera_lidar": T_CAMERA_LIDAR.tolist()}
    if with_images:
        (folder / "calibration.json").write_text(json.dumps(camera))
    return folder


def write_pcd(path: Path, points: np.ndarray, times: np.ndarray) -> None:
    """Binary, with the fields x y z time."""
    table = np.zeros(len(points), dtype=[("xyz", "<f4", 3), ("time", "<f4")])
    table["xyz"], table["time"] = points, times
    header = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z time\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {len(points)}\n"
    )
    header += f"HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA binary\n"
    path.write_bytes(header.encode() + table.tobytes())


def write_image(path: Path, T_world_camera: np.ndarray, boxes: tuple[Box, ...]) -> None:
    path.parent.mkdir(exist_ok=True)
    assert cv2.imwrite(str(path), image(T_world_camera, boxes)[0][:, :, ::-1])


def row_text(matrix: np.ndarray) -> str:
    return " ".join(f"{x:.12e}" for x in np.asarray(matrix).ravel())

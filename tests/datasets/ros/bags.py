"""Bags of all kinds, written by the library's own writers from a few known images."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("bag", "db3", "mcap")
WIDTH, HEIGHT = 64, 48
K = (60.0, 62.0, 31.0, 24.0)
FRAME = "camera_color_optical_frame"
NAMES = {"color": "/camera/color/image_raw", "depth": "/camera/aligned_depth_to_color/image_raw"}
NAMES["info"] = "/camera/color/camera_info"
TF = "tf2_msgs/msg/TFMessage"
START = 1_700_000_000_000_000_000  # ns
PERIOD = 33_333_333  # ns


class Messages:
    """Messages of one version of ROS."""

    def __init__(self, kind: str) -> None:
        self.is1 = kind == "bag"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.is1 else Stores.ROS2_HUMBLE)
        if self.is1:  # the library's ROS 1 comes without
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))

    def make(self, name: str, **fields: Any) -> Any:
        return self.store.types[name](**fields)

    def header(self, stamp: int, frame: str = FRAME) -> Any:
        time = self.make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        extra = {"seq": 0} if self.is1 else {}
        return self.make("std_msgs/msg/Header", stamp=time, frame_id=frame, **extra)

    def image(self, stamp: int, pixels: np.ndarray, encoding: str, frame: str = FRAME, pad: int = 0, big=False) -> Any:
        height, width = pixels.shape[:2]
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
        rows = np.pad(rows, ((0, 0), (0, pad)), constant_values=77)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(stamp, frame),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=int(big),
            step=rows.shape[1],
            data=rows.ravel(),
        )

    def compressed(self, stamp: int, data: bytes, format_: str, frame: str = FRAME) -> Any:
        return self.make(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(stamp, frame),
            format=format_,
            data=np.frombuffer(data, dtype=np.uint8),
        )

    def info(self, stamp: int, distortion: Iterable[float] = (), model: str = "plumb_bob", **changes: Any) -> Any:
        fx, fy, cx, cy = changes.pop("k", K)
        offset, binning = changes.pop("offset", 0), changes.pop("binning", 0)
        matrix = np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0 if fx else 0.0])
        arrays = {"d": np.array(list(distortion), dtype=np.float64), "k": matrix, "r": np.eye(3).ravel()}
        arrays["p"] = changes.pop("p", np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1.0, 0]))
        if self.is1:
            arrays = {name.upper(): value for name, value in arrays.items()}
        roi = self.make(
            "sensor_msgs/msg/RegionOfInterest", x_offset=offset, y_offset=0, height=0, width=0, do_rectify=False
        )
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp, changes.pop("frame", FRAME)),
            height=HEIGHT,
            width=WIDTH,
            distortion_model=model,
            binning_x=binning,
            binning_y=binning,
            roi=roi,
            **arrays,
        )

    def transform(self, stamp: int, parent: str, child: str, T: np.ndarray, q: np.ndarray) -> Any:
        translation = self.make("geometry_msgs/msg/Vector3", x=T[0], y=T[1], z=T[2])
        rotation = self.make("geometry_msgs/msg/Quaternion", x=q[0], y=q[1], z=q[2], w=q[3])
        transform = self.make("geometry_msgs/msg/Transform", translation=translation, rotation=rotation)
        header = self.header(stamp, parent)
        return self.make("geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=transform)

    def tf(self, *transforms: Any) -> Any:
        return self.make(TF, transforms=list(transforms))

    def odometry(self, stamp: int, parent: str, child: str, T: np.ndarray, q: np.ndarray) -> Any:
        position = self.make("geometry_msgs/msg/Point", x=T[0], y=T[1], z=T[2])
        rotation = self.make("geometry_msgs/msg/Quaternion", x=q[0], y=q[1], z=q[2], w=q[3])
        pose = self.make("geometry_msgs/msg/Pose", position=position, orientation=rotation)
        zero = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        twist = self.make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(stamp, parent),
            child_frame_id=child,
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
        )

    def imu(self, stamp: int, force: Iterable[float], frame: str) -> Any:
        x, y, z = force
        zero = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(stamp, frame),
            orientation=self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.zeros(9),
            angular_velocity=zero,
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            linear_acceleration_covariance=np.zeros(9),
        )

    def write(self, path: Path, rows: Iterable[tuple[str, int, Any]], compress: bool = False) -> Path:
        """Rows of a topic, the time of recording in ns, and a message or raw bytes; the path as the user gives it."""
        rows = sorted(rows, key=lambda row: row[1])
        types = {topic: m.__msgtype__ for topic, _, m in rows if not isinstance(m, bytes)}
        if self.is1:
            writer: Any = Writer1(path)
        else:
            plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
            writer = Writer2(path.with_suffix(""), version=9, storage_plugin=plugin)
            if compress:
                writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        with writer:
            made = {topic: writer.add_connection(topic, type_, typestore=self.store) for topic, type_ in types.items()}
            serialize = self.store.serialize_ros1 if self.is1 else self.store.serialize_cdr
            for topic, logged, message in rows:
                raw = message if isinstance(message, bytes) else serialize(message, message.__msgtype__)
                writer.write(made[topic], logged, bytes(raw))
        return path if self.is1 else path.with_suffix("")


@dataclass
class Recording:
    """What was put into a bag.

    Attributes:
        rgb: (N, H, W, 3) uint8.
        depth: (N, H, W) uint16 millimetres.
        stamps: N header stamps of colour, nanoseconds.
        rows: of `Messages.write`; more may be added.
    """

    rgb: np.ndarray
    depth: np.ndarray
    stamps: list[int]
    messages: Messages
    rows: list[tuple[str, int, Any]] = field(default_factory=list)

    def write(self, path: Path, **options: Any) -> Path:
        return self.messages.write(path, self.rows, **options)


def record(kind: str = "mcap", frames: int = 3, lag: int = 3_000_000, distortion: Iterable[float] = ()) -> Recording:
    """`lag` nanoseconds from colour to depth; both are recorded 20 ms after their stamps, colour last."""
    rng = np.random.default_rng(5)
    rgb = rng.integers(0, 256, (frames, HEIGHT // 8, WIDTH // 8, 3), dtype=np.uint8).repeat(8, 1).repeat(8, 2)
    depth = rng.integers(500, 4000, (frames, HEIGHT // 8, WIDTH // 8), dtype=np.uint16).repeat(8, 1).repeat(8, 2)
    depth[:, 0, 0] = 0
    made = Recording(rgb, depth, [START + i * PERIOD for i in range(frames)], Messages(kind))
    late = 20_000_000
    for i, stamp in enumerate(made.stamps):
        made.rows += [
            (NAMES["depth"], stamp + late, made.messages.image(stamp + lag, depth[i], "16UC1")),
            (NAMES["color"], stamp + late + 1000, made.messages.image(stamp, rgb[i], "rgb8")),
            (NAMES["info"], stamp + late, made.messages.info(stamp, distortion)),
        ]
    return made

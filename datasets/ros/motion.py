"""What a bag tells of the camera's motion: poses that somebody else estimated, and the readings of an accelerometer."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError
from ..stamps import MAX_FORCE_DIFFERENCE, nearest
from .bag import BadMessage, Bag
from .transforms import TF_TYPES, Transforms, pose_row, read_transforms, seconds_of, stamped_poses

IMU = "sensor_msgs/msg/Imu"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE_TYPES = (
    ODOMETRY,
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
)
AT_REST = (5.0, 15.0)  # m/s^2, the median length of what is taken for an accelerometer's readings


def read_poses(bag: Bag, topic: str, camera_frame: str, stamps: np.ndarray) -> np.ndarray:
    """(N, 4, 4) `T_world_camera` at (N,) seconds, NaN where the bag has none.

    Args:
        bag: the recording.
        topic: `/tf` (the world is the root of the tree that the camera's frame is in), or one of `POSE_TYPES`. Those
            that name the frame they are of (odometry, transforms) are carried on to the camera by `/tf_static`; the
            others are poses of the camera.
        camera_frame: that of the colour images.
        stamps: seconds.

    Raises:
        InputError: there is no such topic, it is of another type, no static transform leads from its frame to the
            camera's, or it has a pose at none of the stamps.
    """
    known = bag.topics.get(topic)
    if known is None or known.type not in (*TF_TYPES, *POSE_TYPES) or not known.count:
        usable = ", ".join(str(found) for found in bag.of_type(*TF_TYPES, *POSE_TYPES)) or "no topic with poses"
        found = f"{known if known else 'no such topic'}; those with poses: {usable}"
        raise InputError(bag.path, f"poses in {topic}", found, "name one of these, or leave poses out")
    camera = camera_frame.lstrip("/")
    if known.type in TF_TYPES:
        tree = read_transforms(bag, moving=True)
        poses = tree.T_root(camera, stamps)
        way = f"from {tree.root_of(camera)} to {camera}"
        if camera not in tree.edges:
            remedy = "name an odometry topic, or leave poses out"
            raise InputError(bag.path, f"the frame {camera} in {topic}", "a tree of frames without it", remedy)
    else:
        poses, way = _of_topic(bag, topic, camera, stamps)
    if np.isnan(poses[:, 0, 0]).all():
        remedy = "check that both use one clock, or leave poses out"
        raise InputError(bag.path, f"poses {way} at the stamps of the images", "none", remedy)
    return poses


def read_force(bag: Bag, topic: str | None, camera_frame: str, stamps: np.ndarray) -> np.ndarray | None:
    """(N, 3) accelerometer reading nearest to each of (N,) seconds, in camera axes, m/s^2; NaN where none is near.

    Args:
        bag: the recording.
        topic: of `sensor_msgs/Imu`; None to take the only one that is usable, "" to take none.
        camera_frame: that of the colour images.
        stamps: seconds.

    Returns:
        None where no topic is asked for and there is not exactly one whose frame is fixed to the camera's and whose
        readings are an accelerometer's (of length 9.81 m/s^2 at rest; a gyroscope alone sends zeros).

    Raises:
        InputError: the topic that is named is not usable.
    """
    candidates = [found.name for found in bag.of_type(IMU)]
    if topic == "" or (topic is None and not candidates):
        return None
    tree = read_transforms(bag, moving=False)
    if topic:
        if topic not in candidates:
            found = ", ".join(candidates) or "no topic of this type"
            raise InputError(bag.path, f"{IMU} messages in {topic}", found, "name one of these, or leave imu out")
        force = _force(bag, topic, tree, camera_frame, stamps)
        if isinstance(force, str):
            raise InputError(bag.path, f"an accelerometer in {topic}", force, 'leave it out with "imu="')
        return force
    readings = [_force(bag, name, tree, camera_frame, stamps) for name in candidates]
    usable = [force for force in readings if not isinstance(force, str)]
    return usable[0] if len(usable) == 1 else None


def _of_topic(bag: Bag, topic: str, camera: str, stamps: np.ndarray) -> tuple[np.ndarray, str]:
    rows, child, parent = [], camera, "the world"
    try:
        for _, message in bag.messages(topic):
            rows.append(_row(message))
            child = (getattr(message, "child_frame_id", "") or child).lstrip("/")
            parent = message.header.frame_id
    except BadMessage as error:
        raise InputError(bag.path, f"poses in {topic}", str(error), "leave poses out") from None
    T_child_camera = read_transforms(bag, moving=False).rigid(child, camera)
    if T_child_camera is None:
        expected = f"static transforms from {child}, whose poses {topic} has, to {camera}"
        raise InputError(bag.path, expected, "none in /tf_static", "record /tf_static, or leave poses out")
    return stamped_poses(np.array(rows)).at(stamps) @ T_child_camera, f"from {parent} to {child}"


def _row(message: Any) -> tuple[float, ...]:
    transform = getattr(message, "transform", None)
    if transform is not None:
        return pose_row(message.header, transform.translation, transform.rotation)
    pose = getattr(message.pose, "pose", message.pose)  # with covariance it is one deeper
    return pose_row(message.header, pose.position, pose.orientation)


def _force(bag: Bag, topic: str, tree: Transforms, camera: str, stamps: np.ndarray) -> np.ndarray | str:
    """The readings at the stamps in camera axes, or why they cannot be used."""
    rows, frame = [], ""
    try:
        for _, message in bag.messages(topic):
            a, frame = message.linear_acceleration, message.header.frame_id
            rows.append((seconds_of(message.header), a.x, a.y, a.z))
    except BadMessage as error:
        return str(error)
    table = np.array(rows)
    table = table[np.isfinite(table).all(axis=1) & table[:, 1:].any(axis=1)]
    table = table[np.argsort(table[:, 0], kind="stable")]
    length = float(np.median(np.linalg.norm(table[:, 1:], axis=1))) if len(table) else 0.0
    if not AT_REST[0] < length < AT_REST[1]:
        return f"readings of a median length of {length:.3g} m/s^2"
    T_camera_imu = tree.rigid(camera.lstrip("/"), frame.lstrip("/"))
    if T_camera_imu is None:
        return f"no static transform from {frame} to {camera} in /tf_static"
    index = nearest(stamps, table[:, 0], MAX_FORCE_DIFFERENCE)
    return np.where((index >= 0)[:, None], table[index, 1:] @ T_camera_imu[:3, :3].T, np.nan)

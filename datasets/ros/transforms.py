"""Frames of ROS: how each stands to its parent, from `/tf` and `/tf_static`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from ..poses import MAX_ROTATION_ERROR, StampedPoses, pose_matrices
from .bag import NANO, BadMessage, Bag

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
STATIC = "/tf_static"


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """How a frame stands to its parent.

    Attributes:
        parent: name of the parent's frame.
        poses: `T_parent_child`; of one row where it never changes.
        static: it never changes, whatever the stamps.
    """

    parent: str
    poses: StampedPoses
    static: bool

    def at(self, stamps: np.ndarray) -> np.ndarray:
        """(M, 4, 4) `T_parent_child` at (M,) seconds; NaN where it is not known."""
        return np.repeat(self.poses.matrices[:1], len(stamps), axis=0) if self.static else self.poses.at(stamps)


@dataclass(frozen=True, slots=True, eq=False)
class Transforms:
    """The tree of frames.

    Attributes:
        edges: by the name of the child's frame.
    """

    edges: Mapping[str, Edge]

    def root_of(self, frame: str) -> str:
        """The frame at the top of the tree that `frame` is in."""
        return self._ancestors(frame)[-1]

    def T_root(self, frame: str, stamps: np.ndarray) -> np.ndarray:
        """(M, 4, 4) `T_root_frame` at (M,) seconds; NaN where a part of the way is not known."""
        poses = np.repeat(np.eye(4)[None], len(stamps), axis=0)
        for name in self._ancestors(frame)[:-1]:
            poses = self.edges[name].at(stamps) @ poses
        return poses

    def rigid(self, to: str, frame: str) -> np.ndarray | None:
        """(4, 4) `T_to_frame` where both are fixed to each other, else None."""
        if to == frame:
            return np.eye(4)
        above_to, above = self._ancestors(to), self._ancestors(frame)
        shared = next((name for name in above if name in above_to), None)
        if shared is None:
            return None
        T_shared_to, T_shared_frame = self._fixed(above_to, shared), self._fixed(above, shared)
        if T_shared_to is None or T_shared_frame is None:
            return None
        return np.linalg.inv(T_shared_to) @ T_shared_frame

    def _fixed(self, names: list[str], shared: str) -> np.ndarray | None:
        """`T_shared_first` along a way up where every step is static."""
        pose = np.eye(4)
        for name in names[: names.index(shared)]:
            if not self.edges[name].static:
                return None
            pose = self.edges[name].poses.matrices[0] @ pose
        return pose

    def _ancestors(self, frame: str) -> list[str]:
        names = [frame]
        while names[-1] in self.edges:
            parent = self.edges[names[-1]].parent
            if parent in names:
                break  # a circle: two publishers disagree
            names.append(parent)
        return names


def read_transforms(bag: Bag, moving: bool) -> Transforms:
    """The tree of frames of a bag; only the static ones unless `moving`.

    Raises:
        InputError: a message cannot be read.
    """
    topics = [topic.name for topic in bag.of_type(*TF_TYPES)]
    rows: dict[str, tuple[str, bool, list[tuple[float, ...]]]] = {}
    for topic in sorted(topics, key=lambda name: name.endswith(STATIC)):
        static = topic.endswith(STATIC)
        if not (static or moving):
            continue
        try:
            for _, message in bag.messages(topic):
                for transform in message.transforms:
                    _add(rows, transform, static)
        except BadMessage as error:
            raise InputError(bag.path, f"transforms in {topic}", str(error), "leave poses and imu out") from None
    edges = {
        child: Edge(parent, stamped_poses(np.array(values)), static) for child, (parent, static, values) in rows.items()
    }
    return Transforms({child: edge for child, edge in edges.items() if len(edge.poses.stamps)})


def stamped_poses(rows: np.ndarray) -> StampedPoses:
    """(N, 8) rows of a stamp in seconds, a position in metres and a quaternion x y z w, to a trajectory.

    Rows that are not finite or whose quaternion is not of length one are left out; of equal stamps the first counts.
    """
    rows = rows.reshape(-1, 8)
    norm = np.linalg.norm(rows[:, 4:], axis=1)
    rows = rows[np.isfinite(rows).all(axis=1) & (np.abs(norm - 1.0) <= MAX_ROTATION_ERROR)]
    _, first = np.unique(rows[:, 0], return_index=True)
    rows = rows[first]
    quaternions = rows[:, 4:] / np.linalg.norm(rows[:, 4:], axis=1, keepdims=True)
    return StampedPoses(rows[:, 0], rows[:, 1:4], quaternions)


def pose_matrix(position: Any, orientation: Any) -> np.ndarray:
    """(4, 4) pose of a message's position and unit quaternion."""
    p = np.array([[position.x, position.y, position.z]])
    q = np.array([[orientation.x, orientation.y, orientation.z, orientation.w]])
    return pose_matrices(p, q)[0]


def seconds_of(header: Any) -> float:
    """A header's stamp in seconds."""
    return header.stamp.sec + header.stamp.nanosec / NANO


def pose_row(header: Any, position: Any, orientation: Any) -> tuple[float, ...]:
    """`stamp x y z qx qy qz qw` of a message."""
    o = orientation
    return (seconds_of(header), position.x, position.y, position.z, o.x, o.y, o.z, o.w)


def _add(rows: dict[str, tuple[str, bool, list[tuple[float, ...]]]], transform: Any, static: bool) -> None:
    child, parent = _frame(transform.child_frame_id), _frame(transform.header.frame_id)
    entry = rows.get(child)
    if entry is None or entry[0] != parent:  # a frame has one parent: the last one told, as in tf itself
        entry = rows[child] = (parent, static, [])
    entry[2].append(pose_row(transform.header, transform.transform.translation, transform.transform.rotation))


def _frame(name: str) -> str:
    return name.lstrip("/")  # tf of ROS 1 wrote a slash, which tf2 does not

"""Takes a saved ledger over into a smoother, record by record, with the numbers that the records had."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from ...factors.odometry import pose3
from .ledger import Ledger
from .live_records import LiveRecords
from .pose_graph import PoseGraph, solve_poses
from .records import DepthCentre, DropLoop, DropMeasurement, Merge, Motion, Retire, Site
from .size_site import SizeSite

if TYPE_CHECKING:
    from .smoother import Smoother


def replay(ledger: Ledger, smoother: Smoother) -> None:
    """Everything that happened happens again, unsolved."""
    for record in ledger:
        match record:
            case Merge():
                smoother.merge(record.kept, record.absorbed)
            case Retire():
                smoother.retire(record.landmark)
            case Site():
                smoother.set_site(record.landmark, SizeSite(record.mean, record.information))
            case DropLoop():
                smoother.drop_loops([record.record])
            case DropMeasurement():
                smoother.drop_measurements([record.record])
            case _:
                smoother.add(record)


def close_start(values: gtsam.Values, ledger: Ledger, live: LiveRecords) -> None:
    """Moves poses to where the loop closures among them want them, and landmarks to where these poses saw them.

    Odometry alone has drifted, and landmarks were born partly before and partly after loops were closed: starting from
    both, things may stand behind the cameras that saw them.
    """
    graph = PoseGraph.of(ledger)
    keyframes = 1 + sum(isinstance(link, Motion) for link in graph.motions)
    start = np.array([values.atPose3(X(t)).matrix() for t in range(keyframes)])
    start_from(solve_poses(graph, start), values, ledger, live)


def start_from(poses: np.ndarray, values: gtsam.Values, ledger: Ledger, live: LiveRecords) -> None:
    """Moves the keyframes to (M, 4, 4) poses, and landmarks to where these saw them."""
    for t, T in enumerate(poses):
        values.update(X(t), pose3(T))
    for landmark, numbers in live.landmarks().items():
        seen = [record for record in map(ledger.__getitem__, numbers) if isinstance(record, DepthCentre)]
        if seen:
            places = [poses[r.keyframe, :3, :3] @ r.centre + poses[r.keyframe, :3, 3] for r in seen]
            if values.exists(L(landmark)):
                values.erase(L(landmark))
            values.insertPoint3(L(landmark), np.median(places, axis=0))

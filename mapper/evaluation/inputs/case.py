"""What every protocol is given: a finished run, the truth, and how the two lie to each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....datasets.ground_truth import GroundTruth
from ....detectors.detections import Detections
from ...map.object_map import ObjectMap
from ...map.thing import Thing
from ...map.upright import upright_rotation
from ..config import EvaluationConfig


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The map as it was after some frames.

    Attributes:
        frames: how many frames had been mapped.
        stamp: of the last of them, seconds.
        T_world_camera: (4, 4) pose of that frame as estimated then.
        object_map: with doubtful things.
    """

    frames: int
    stamp: float
    T_world_camera: np.ndarray
    object_map: ObjectMap


@dataclass(frozen=True, slots=True, eq=False)
class KeyframePoses:
    """(M,) stamps, (M, 4, 4) `T_world_camera` and (M, 6, 6) covariances in the pose's right tangent [rad, m]."""

    stamps: np.ndarray
    poses: np.ndarray
    covariances: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class MappedRun:
    """The output folder of a run.

    Attributes:
        folder: where it is.
        object_map: the final map, with whatever doubtful things were written.
        stamps: (N,) seconds, and
        poses: (N, 4, 4) `T_world_camera` in the map's frame, of every mapped frame.
        report: `report.json`.
        snapshots: maps on the way, by growing number of frames; often none.
        keyframes: keyframe poses with covariances; None where the run wrote none.
        cloud: the cloud, (M, 3) metres in the map's frame, and (M,) int64 labels of its points where the run labelled
            them, else None: indices into `object_map.classes`, `NO_OBJECT` for what is none of them. Raises
            `NotEvaluated` where there is no cloud and `InputError` where it is damaged.
    """

    folder: Path
    object_map: ObjectMap
    stamps: np.ndarray
    poses: np.ndarray
    report: Mapping[str, Any]
    snapshots: tuple[Snapshot, ...]
    keyframes: KeyframePoses | None
    cloud: Callable[[], tuple[np.ndarray, np.ndarray | None]]


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """p -> R p + t from the map's axes to the truth's; `method` says how it was found ("SE(3) by positions", ...).

    `R` is (3, 3), `t` (3,) metres.
    """

    R: np.ndarray
    t: np.ndarray
    method: str = ""

    def apply(self, points: np.ndarray) -> np.ndarray:
        """(3,) or (N, 3) points in the truth's axes, metres."""
        return np.asarray(points) @ self.R.T + self.t

    def pose(self, T_map_camera: np.ndarray) -> np.ndarray:
        """(..., 4, 4) poses in the truth's axes."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.R, self.t
        return T @ T_map_camera

    def angle_to(self, other: Alignment) -> float:
        """Angle between two alignments' rotations, rad."""
        cosine = (np.trace(self.R.T @ other.R) - 1.0) / 2.0
        return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class PlacedThing:
    """A thing of the map in the truth's axes: centre (3,) metres, yaw about the truth's up, `label` in its words.

    `yaw` is radians from the x axis of `Case.R_truth_upright`. `probability` is P(label | it exists): that of the
    thing's own label, and of those others that mean the same in the truth's words; None for the former alone.
    """

    thing: Thing
    label: str
    position: np.ndarray
    yaw: float
    probability: float = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.probability is None:
            object.__setattr__(self, "probability", self.thing.probability)

    @property
    def belief(self) -> float:
        """P(it exists and is a `label`)."""
        return self.thing.existence * self.probability


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One evaluation.

    Attributes:
        run: what was mapped.
        truth: what is true.
        truth_index: (M,) frames of the truth that were mapped, and
        run_index: (M,) their rows in the run's trajectory.
        alignment: by which objects and clouds are compared.
        anchored: by which covariances are judged: the first common pose is made the same, as the graph's gauge is.
        things: of the final map, in the truth's axes and words; things whose label the truth does not know are absent.
        detections: of frames of the truth, by index, from the detector under test; None where there is none.
        config: every number of the evaluator.
        notes: what a reader of all numbers must know, such as things that were left out.
    """

    run: MappedRun
    truth: GroundTruth
    truth_index: np.ndarray
    run_index: np.ndarray
    alignment: Alignment
    anchored: Alignment
    things: tuple[PlacedThing, ...]
    detections: Callable[[int], Detections] | None
    config: EvaluationConfig
    notes: tuple[str, ...] = ()

    @property
    def up(self) -> np.ndarray:
        """(3,) unit vector up in the truth's axes: the truth's own, or the map's where the truth does not know."""
        return self.alignment.R @ self.run.object_map.up.direction if self.truth.up is None else self.truth.up

    @property
    def R_truth_upright(self) -> np.ndarray:
        """(3, 3) axes in which boxes stand upright in the truth, as `upright_rotation`; `box_corners` takes it."""
        return upright_rotation(self.up)

    def to_truth_label(self, label: str) -> str | None:
        """A label of the map in the truth's words; None for a class that the truth does not know."""
        return in_truth_words(label, self.truth.classes, self.config.aliases)


def in_truth_words(label: str, classes: tuple[str, ...], aliases: Mapping[str, str]) -> str | None:
    """What `label` of a map is called among the truth's `classes`, by `aliases` or by itself; None where it is not.

    Upper and lower case are the same.
    """
    meant = {name.casefold(): other.casefold() for name, other in aliases.items()}
    wanted = meant.get(label.casefold(), label.casefold())
    return next((name for name in classes if name.casefold() == wanted), None)

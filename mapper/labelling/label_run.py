"""The labelling job: a run's output folder, its sequence and a detector become a cloud with labels.

    mapped frames -> detector -> evidence of pixels -> voxels -> random field -> things' points
                                                                          -> labels.ply, counts in map.json

What is gathered stays in the folder (voxels.npz): the next time, only frames that are new, or that have moved against
their keyframe, are looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ...datasets.errors import UserError
from ...datasets.lidar_sequence import is_lidar
from ...datasets.sequence import Sequence
from ...detectors.detector import Detector
from ..config_file import dump_config
from ..evaluation.inputs.case import MappedRun
from ..evaluation.inputs.load_run import load_run
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from ..stages import StageClock
from .gathering import Gathered, Gatherer, check_classes
from .instances import Instances, find_instances
from .label_state import LabelState
from .labelled_files import read_volumes, write_labelling
from .labelling import Labels, label_voxels
from .labelling_config import LabellingConfig
from .mapped_frames import MappedFrames, mapped_frames
from .volumes_evidence import weighted_volumes
from .voxels import VoxelEvidence, Voxels

FindInstances = Callable[[Voxels, Labels, ObjectMap, LabellingConfig], Instances]


@dataclass(frozen=True, slots=True, eq=False)
class LabelReport:
    """What labelling did.

    Attributes:
        frames: held by the voxels, and
        added: of those, looked at this time.
        anew: whether voxels were there that no longer fitted, and all was looked at again.
        skipped: problem -> names of frames that could not be read.
        stopped: whether Ctrl-C came before all were added; nothing is labelled then, and the rest is None.
        seconds: per stage.
        voxels: N.
        points: class -> voxels of it, those that have any, and of the background.
        labels: of the voxels.
        instances: whose they are; None too where that was left out.
    """

    frames: int
    added: int
    anew: bool
    skipped: Mapping[str, list[str]]
    stopped: bool
    seconds: Mapping[str, float]
    voxels: int | None = None
    points: Mapping[str, int] | None = None
    labels: Labels | None = None
    instances: Instances | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LabelJob:
    """Everything that is needed to label the points of a run.

    Attributes:
        folder: of the run.
        sequence: as it was mapped.
        detector: of classes of the map.
        spec: what sequence and detector are called: voxels that were gathered from others are not gone on from.
        config: numbers.
        again: gather anew whatever there is.
        find_instances: what says which thing of the map each voxel is of; None to leave that out.
    """

    folder: OutputFolder
    sequence: Sequence
    detector: Detector
    spec: str
    config: LabellingConfig = field(default_factory=LabellingConfig)
    again: bool = False
    find_instances: FindInstances | None = find_instances

    def execute(
        self,
        on_frame: Callable[[int, int], None] = lambda done, total: None,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> LabelReport:
        """Gather, label and write. What was gathered is kept also where it ends early.

        Raises:
            InputError: the folder holds no run, or one of its files is damaged.
            UserError: sequence or detector do not fit the run.
        """
        run, clock = replace(load_run(self.folder.path), object_map=read_volumes(self.folder)), StageClock()
        check_can_be_labelled(run, self.sequence, self.detector)
        frames = mapped_frames(run, self.sequence, self.config.stride)
        state, gathered, anew = self._gather(run, frames, clock, on_frame, should_stop)
        done = len(state.frames), gathered.added, anew, gathered.skipped, gathered.stopped
        report = LabelReport(*done, _totals(clock))
        if gathered.stopped:
            return report
        if not state.frames:
            raise UserError(f"{self.sequence.name}: none of the {len(frames.stamps)} frames chosen can be read")
        with clock.stage("assembling"):
            voxels = state.evidence.assemble(frames.T_world_keyframe)
            volumes = weighted_volumes(voxels.points, run.object_map, self.config)
        with clock.stage("labelling"):
            labels = label_voxels(voxels, self.config.mrf, volumes)
        find = self.find_instances
        with clock.stage("instances"):
            instances = find(voxels, labels, run.object_map, self.config) if find else None
        with clock.stage("writing"):
            points = write_labelling(self.folder, run.object_map, voxels, labels, instances)
        found = {"points": points, "labels": labels, "instances": instances}
        return replace(report, seconds=_totals(clock), voxels=len(voxels.points), **found)

    def _gather(
        self,
        run: MappedRun,
        frames: MappedFrames,
        clock: StageClock,
        on_frame: Callable[[int, int], None],
        should_stop: Callable[[], bool],
    ) -> tuple[LabelState, Gathered, bool]:
        """The state with all frames in it, what had to be done, and whether an earlier state did not fit."""
        classes = run.object_map.classes
        about = describe(self.spec, classes, self.config)
        state = None if self.again else _earlier(self.folder, about)
        lacking = None if state is None else state.lacking(frames, self.config.moved, self.config.turned)
        anew = lacking is None and not self.again and self.folder.voxels_file.is_file()
        if state is None or lacking is None:
            state = LabelState(about, VoxelEvidence(classes, self.config.voxels))
            lacking = np.arange(len(frames.stamps))
        gatherer = Gatherer(self.sequence, self.detector, classes, self.config, clock)
        before = len(state.frames)
        try:
            gathered = gatherer.gather(state, frames, lacking, on_frame, should_stop)
        finally:
            if len(state.frames) > before:
                with clock.stage("saving"):
                    state.save(self.folder.voxels_file)
        return state, gathered, anew


def check_can_be_labelled(run: MappedRun, sequence: Sequence, detector: Detector) -> None:
    """Raises `UserError` where there are no images to look at, no classes, or others than the detector's."""
    if is_lidar(sequence) or sequence.intrinsics.width == 0:
        raise UserError(
            f"{run.folder}: {sequence.name} is a LiDAR's, and labels of points come from RGB-D images: a sweep has no "
            "depth for most pixels, and points farther apart than voxels are wide; label the run of a depth camera"
        )
    if not run.object_map.classes:
        raise UserError(f"{run.folder}: the map has no classes; map with a detector to have something to label")
    check_classes(getattr(detector, "classes", None) or (), run.object_map.classes)


def describe(spec: str, classes: tuple[str, ...], config: LabellingConfig) -> str:
    """All on which the content of the voxels depends, the choice of frames and their poses aside."""
    sources: dict[str, Any] = {name: value for name, value in asdict(config.sources).items() if name != "volumes"}
    return f"{spec}\nclasses: {', '.join(classes)}\nsources: {sources}\nvoxels: {dump_config(config.voxels)}"


def _earlier(folder: OutputFolder, about: str) -> LabelState | None:
    """What was gathered before, if it is of the same."""
    if not folder.voxels_file.is_file():
        return None
    state = LabelState.load(folder.voxels_file)
    return state if state.about == about else None


def _totals(clock: StageClock) -> dict[str, float]:
    return {name: times["total_s"] for name, times in clock.summary().items()}

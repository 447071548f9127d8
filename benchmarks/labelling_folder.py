"""Where a scene, its map and what was gathered of it are, and how they come there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from suite import Scene
from suite_job import scene_folder

from thingmap.datasets.open import open_sequence
from thingmap.datasets.sequence import Sequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper.config_file import dump_config
from thingmap.mapper.evaluation.inputs.case import MappedRun
from thingmap.mapper.labelling.gathering import Gatherer
from thingmap.mapper.labelling.label_run import describe
from thingmap.mapper.labelling.label_state import LabelState
from thingmap.mapper.labelling.labelling_config import LabellingConfig
from thingmap.mapper.labelling.mapped_frames import mapped_frames
from thingmap.mapper.labelling.voxels import VoxelEvidence, Voxels
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.runner import SequenceRun
from thingmap.mapper.saving import save_run
from thingmap.mapper.stages import StageClock


@dataclass(frozen=True, slots=True)
class Job:
    """A rendered scene in a folder, the detector that looks at it, and whether what is there of both is taken again."""

    scene: Scene
    folder: Path
    detector: str
    reuse: bool = False

    @property
    def place(self) -> Path:
        """Of the sequence."""
        return scene_folder(self.scene, self.folder)

    @property
    def out(self) -> Path:
        """Of the map."""
        return self.folder / "maps" / f"labelling-{self.detector.partition('?')[0]}" / self.scene.name


def mapped(job: Job) -> OutputFolder:
    """The scene's map, as `thingmap run` makes it."""
    if job.reuse and (job.out / "map.json").is_file():
        return OutputFolder.open(job.out)
    sequence = open_sequence(job.place)
    mapper = SemanticMapper(make_detector(job.detector, sequence), source=sequence.name, gravity=sequence.gravity)
    report = SequenceRun(sequence, mapper).execute()
    out = OutputFolder.create(job.out, overwrite=True)
    command = {"sequence": job.scene.name, "detector": job.detector}
    save_run(out, mapper, report, config=dump_config(mapper.config), command=command)
    return out


def gather(job: Job, run: MappedRun, sequence: Sequence, config: LabellingConfig) -> Voxels:
    """Evidence of every so many frames, from a file beside the map where that holds it."""
    classes, frames = run.object_map.classes, mapped_frames(run, sequence, config.stride)
    about, file = describe(job.detector, classes, config), job.out / f"voxels-{config.stride}.npz"
    state = LabelState.load(file) if job.reuse and file.is_file() else None
    lacking = None if state is None or state.about != about else state.lacking(frames, config.moved, config.turned)
    if state is None or lacking is None:
        state, lacking = LabelState(about, VoxelEvidence(classes, config.voxels)), np.arange(len(frames.stamps))
    if len(lacking):
        gatherer = Gatherer(sequence, make_detector(job.detector, sequence), classes, config, StageClock())
        gatherer.gather(state, frames, lacking, lambda done, total: None, lambda: False)
        state.save(file)
    return state.evidence.assemble(frames.T_world_keyframe)

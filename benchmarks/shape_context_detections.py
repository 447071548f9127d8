"""Everything that the shape-context detector says of a scene, on file: all mappers then get the same."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from suite import Scene
from suite_job import scene_folder

from thingmap.datasets.open import open_sequence
from thingmap.detectors.detections import Detections
from thingmap.detectors.recorded.thingmap_json import write_detections
from thingmap.detectors.shape_context.detector import ShapeContextDetector


@dataclass(frozen=True, slots=True)
class Detected:
    """Where the detections of a scene are, and the detector's median milliseconds a frame, writing left out."""

    file: Path
    milliseconds: float


def detect(scene: Scene, model: Path, folder: Path, step: int) -> Detected:
    """Looks at every `step`-th frame of a rendered scene; what is there from before is made anew.

    Raises:
        UserError: the model or the scene cannot be read.
    """
    sequence = open_sequence(scene_folder(scene, folder), stride=step)
    # The paper's tracks are of proposals: one that a view could not tell goes on a track, which may know it by others.
    detector, seconds = ShapeContextDetector(model, confidence=0.0), []

    def found() -> Iterator[tuple[str, Detections]]:
        for frame in sequence:
            start = time.perf_counter()
            one = detector(frame)
            seconds.append(time.perf_counter() - start)
            yield frame.name, one

    file = folder / "detections" / model.stem / f"{scene.name}-step{step}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    write_detections(file, detector.classes, found(), overwrite=True)
    return Detected(file, 1e3 * float(np.median(seconds)))

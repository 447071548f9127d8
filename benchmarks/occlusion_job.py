"""One scene of the occlusion benchmark: rendered, read and detected in once, and judged by every method.

A method's judgement of a scene is one small JSON file, so that a benchmark that was interrupted goes on where it was.
The file names the code that it comes from; one of other code is made again.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from occlusion_methods import METHODS, Claims, Judgement, Material, Method
from suite import Scene
from suite_job import is_rendered, render, scene_folder

import thingmap.datasets
import thingmap.detectors
import thingmap.factors
import thingmap.mapper
from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.detectors.spec import make_detector
from thingmap.mapper.evaluation.boxes.outcomes import read_outcomes, write_outcomes
from thingmap.mapper.map.atomic import make_folder, write_atomic

# The detector's luck hangs on its seed and the frame's name: with one seed for all scenes, every scene would have the
# same false box in the same frame, and a number of views would stand or fall with it.
DETECTOR = "simulated?seed={seed}&parts=1"
PACKAGES = (thingmap.datasets, thingmap.detectors, thingmap.factors, thingmap.mapper)
SUFFIXES = (".py", ".json", ".yaml")


@dataclass(frozen=True, slots=True)
class Job:
    """A scene, the names of the methods that are to judge it, where everything is kept, and `code_mark()`."""

    scene: Scene
    methods: tuple[str, ...]
    folder: Path
    code: str


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """A judgement as its file has it; `seconds` by stage: those that all methods share, and the method's own."""

    judgement: Judgement
    seconds: Mapping[str, float]


def code_mark() -> str:
    """Stands for the code that results depend on: thingmap with its learned numbers, the methods, the detector."""
    digest = hashlib.sha256(DETECTOR.encode())
    own = (Path(__file__), Path(__file__).with_name("occlusion_methods.py"))
    folders = [Path(package.__path__[0]) for package in PACKAGES]
    theirs = [file for folder in folders for file in sorted(folder.rglob("*")) if file.suffix in SUFFIXES]
    for file in (*own, *theirs):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


def missing(job: Job) -> list[Method]:
    """The methods that have not judged the scene yet."""
    return [method for method in METHODS if method.name in job.methods and read(job, method) is None]


def run(job: Job) -> Job:
    """Let the `missing` methods judge the scene; it is rendered if it is not there.

    Raises:
        UserError: the scene in the folder is not what it should be, the folder cannot be written, or the code is not
            that of the job.
    """
    if code_mark() != job.code:
        raise UserError("thingmap's code was changed while the benchmark ran; start it again")
    numba.set_num_threads(1)
    marks = [time.perf_counter()]
    if not is_rendered(job.scene, job.folder):
        render(job.scene, job.folder)
    marks.append(time.perf_counter())
    material = read_material(scene_folder(job.scene, job.folder), job.scene.seed)
    marks.append(time.perf_counter())
    shared = dict(zip(("rendering", "reading and detecting"), np.diff(marks).tolist(), strict=True))
    for method in missing(job):
        start = time.perf_counter()
        judgement = method.judge(material)
        write(job, method, Stored(judgement, {**shared, method.name: time.perf_counter() - start}))
    return job


def read_material(place: Path, seed: int = 1) -> Material:
    """All frames of a rendered scene, and what the detector of a seed finds in them.

    Raises:
        UserError: they are none.
    """
    sequence = open_sequence(place)
    detector, frames = make_detector(DETECTOR.format(seed=seed), sequence), tuple(sequence)
    return Material(sequence.name, frames, tuple(detector(frame) for frame in frames), open_truth(place))


def result_file(job: Job, method: Method) -> Path:
    """Where a judgement is."""
    return job.folder / "judged" / method.name / f"{job.scene.name}.json"


def read(job: Job, method: Method) -> Stored | None:
    """The judgement of this code; None where there is none, or not a whole one."""
    try:
        content = json.loads(result_file(job, method).read_text("utf-8"))
        return _stored(content) if content["code"] == job.code else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write(job: Job, method: Method, stored: Stored) -> None:
    """Keep a judgement; raises `UserError` where it cannot be written."""
    judgement, file = stored.judgement, result_file(job, method)
    claims = None if judgement.claims is None else {k: v.tolist() for k, v in asdict(judgement.claims).items()}
    table = asdict(write_outcomes(judgement.outcomes))
    content = {"code": job.code, "seconds": dict(stored.seconds), "tables": [table], "claims": claims}
    make_folder(file.parent)
    write_atomic(file, json.dumps(content).encode())


def _stored(content: dict[str, Any]) -> Stored:
    claims = content["claims"]
    arrays = {} if claims is None else {key: np.asarray(values) for key, values in claims.items()}
    judgement = Judgement(read_outcomes(content), Claims(**arrays) if arrays else None)
    return Stored(judgement, content["seconds"])

"""Scenes judged one after the other, or several at a time, each in a process of its own."""

from __future__ import annotations

import multiprocessing
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import numba
from suite import Scene
from suite_job import is_rendered, render


class SceneJob(Protocol):
    """Work on a scene that is rendered in a folder."""

    @property
    def scene(self) -> Scene: ...

    @property
    def folder(self) -> Path: ...


Job = TypeVar("Job", bound=SceneJob)
Result = TypeVar("Result")


def name_of_scene(job: SceneJob) -> str:
    """Enough where each scene is judged once."""
    return job.scene.name


def judge_all(
    judge: Callable[[Job], Result],
    jobs: Sequence[Job],
    processes: int,
    name: Callable[[Job], str] = name_of_scene,
) -> list[Result]:
    """What `judge` makes of each job, in their order; scenes are rendered if absent, and `name` is what is reported."""
    for job in jobs:
        if not is_rendered(job.scene, job.folder):
            render(job.scene, job.folder)
    judged, start = [], time.perf_counter()
    with multiprocessing.get_context("spawn").Pool(processes, numba.set_num_threads, (1,)) as pool:
        for job, one in zip(jobs, pool.imap(judge, jobs), strict=True):
            judged.append(one)
            minutes = (time.perf_counter() - start) / 60.0
            print(f"judged {name(job)} after {minutes:.1f} min", file=sys.stderr, flush=True)
    return judged

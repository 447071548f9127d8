"""Scenes judged in processes of their own."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path

import judging
from labelling_folder import Job
from suite import Scene
from suite_job import scene_folder

from thingmap.datasets.synthetic.config import ClutterLevel, Preset


def test_every_job_is_judged_in_its_place_and_rendered_before(tmp_path, monkeypatch, capsys):
    scenes = [Scene(Preset.TABLETOP, ClutterLevel.LOW, seed, 20) for seed in (5, 3, 4)]
    rendered: list[int] = []

    def render(scene: Scene, folder: Path) -> None:
        rendered.append(scene.seed)
        place = scene_folder(scene, folder)
        place.mkdir(parents=True)
        (place / "poses.txt").touch()

    monkeypatch.setattr(judging, "render", render)
    render(scenes[0], tmp_path)
    jobs = [Job(scene, tmp_path, "none") for scene in scenes]
    assert judging.judge_all(attrgetter("scene.seed"), jobs, 2, attrgetter("scene.name")) == [5, 3, 4]
    assert rendered == [5, 3, 4]  # the first was there
    said = capsys.readouterr().err.splitlines()
    assert [line.split()[1] for line in said] == [scene.name for scene in scenes]

"""The labelling benchmarks: what they count is right, and one tiny scene goes through all of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import labelling
import labelling_fusion
import labelling_job
import numpy as np
import pytest
from labelling_folder import Job
from labelling_job import FEW, JudgedScene, Points, Variant, judge_scene
from labelling_report import box_table, category_table, clutter_table, f_table, most_recall, precision_at, verdicts
from suite import Scene
from suite_job import scene_folder
from tiny_hog import cells

from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.evaluation.boxes.curves import Scored
from thingmap.mapper.labelling.mrf_config import Smoothness

FRAMES, SEED = 16, 3
SCENE = Scene(Preset.TABLETOP, ClutterLevel.LOW, SEED, FRAMES)
DETECTOR = "simulated?half_side=6&score_side=7&background_spots=0&chance_rate=0"  # one for small images
CLASSES = ("bowl", "cap")


def made_up(accuracy: dict[Variant, float], before: Scored, after: Scored) -> JudgedScene:
    """A scene of 1000 points, half of them background, of which each variant labels a share right."""
    true = np.repeat(np.array([NO_OBJECT, NO_OBJECT, 0, 1], np.int8), 250)
    points = {}
    for variant in labelling_job.VARIANTS:
        wrong = np.arange(len(true)) % 250 >= 250 * accuracy.get(variant, 0.5)
        points[variant] = Points(np.where(wrong & (true != NO_OBJECT), NO_OBJECT, true).astype(np.int8), true)
    return JudgedScene(Job(SCENE, Path(), "none"), CLASSES, points, before, AGREED, after)


def boxes(*right: bool, objects: int = 5) -> Scored:
    """Ranked boxes, the surest first."""
    return Scored(np.linspace(1.0, 0.1, len(right)), np.array(right), objects, 1)


BEFORE, AFTER = boxes(True, False, True, False, True), boxes(True, True, True)
AGREED = boxes(True, False, True, True)


def test_precision_at_a_recall_and_the_most_recall():
    assert precision_at(BEFORE) == pytest.approx(3 / 5) and precision_at(AFTER) == 1.0
    assert precision_at(boxes(True, True)) is None  # 40 % is all it finds
    assert most_recall(BEFORE) == pytest.approx(0.6) and most_recall(boxes(objects=0)) is None


@pytest.mark.parametrize("rises", [True, False])
def test_verdicts_tell_the_order_and_the_aim(rises):
    shares = (0.6, 0.7, 0.8, 0.96) if rises else (0.6, 0.8, 0.7, 0.75)
    accuracy = {Variant(True, term): share for term, share in zip(labelling_job.TERMS, shares, strict=True)}
    lines = verdicts([made_up(accuracy, BEFORE, AFTER)]).split("\n")
    assert ("NOT the paper's order" in lines[2]) is not rises and "with the map's volumes" in lines[2]
    assert ("does NOT reach 0.90" in lines[2]) is not rises
    assert "NOT the paper's order" in lines[0]  # all the same
    assert "improves precision on 1 of the 1 scenes" in lines[-1]
    assert "on 0 of the 1 scenes" in verdicts([made_up({}, AFTER, BEFORE)])
    assert "on 1 of the 2 scenes" in (said := verdicts([made_up({}, BEFORE, AFTER), made_up({}, AFTER, AFTER)]))
    assert "on 1 it was 1 before" in said and "on 0 it was 1 before" in lines[-1]


def test_tables_say_what_was_labelled_right():
    judged = [made_up({Variant(True, Smoothness.NORMALS): 0.8}, BEFORE, AFTER)]
    rows = {row[1]: row for row in cells(f_table(judged))}
    assert rows["AllBG"][2:4] == ["0.500", "0.000"]
    assert rows["Det3DMRF"][6] == f"{2 * 0.8 / 1.8:.3f}"  # precision 1, recall 0.8
    assert rows["Det3DMRF"][3] == f"{2 * 0.5 / 1.5:.3f}" == rows[f"Det3DMRF, every {FEW}th frame"][3]
    by_category = {row[1]: row for row in cells(category_table(judged, volumes=True))}
    assert by_category["Det3DMRF"][2:4] == ["100.0 / 80.0"] * 2
    assert "0.889" in clutter_table(judged) and "low" in clutter_table(judged)
    assert "0.600 -> 0.750 -> 1.000" in box_table(judged)


def test_a_tiny_scene_is_judged_and_found_again(tmp_path, monkeypatch):
    config = SyntheticConfig(Preset.TABLETOP, clutter=ClutterLevel.LOW, seed=SEED, frames=FRAMES, width=240)
    write_sequence(SyntheticSequence(config), scene_folder(SCENE, tmp_path))
    monkeypatch.setattr(labelling_job, "MANY", 4)
    monkeypatch.setattr(labelling_job, "BETWEEN", 2)
    terms = (Smoothness.NORMALS, 4), (Smoothness.NONE, 4), (Smoothness.NORMALS, FEW)
    variants = tuple(Variant(True, *one) for one in terms)
    monkeypatch.setattr(labelling_job, "VARIANTS", variants)
    monkeypatch.setattr(labelling_job, "CHECKED", variants[0])
    job = Job(SCENE, tmp_path, DETECTOR)
    judged = judge_scene(job)
    assert set(judged.points) == set(variants)
    share = {v: np.mean((p.found == p.true)[p.true != NO_OBJECT]) for v, p in judged.points.items()}
    assert share[variants[0]] > 0.5 and share[variants[2]] < share[variants[0]]
    assert judged.before.images == 4 and 0 < len(judged.after.scores) <= len(judged.agreed.scores)
    assert len(judged.agreed.scores) <= len(judged.before.scores)
    times = {file: file.stat().st_mtime_ns for file in (job.out / "map.json", job.out / "voxels-4.npz")}
    again = judge_scene(replace(job, reuse=True))
    assert {file: file.stat().st_mtime_ns for file in times} == times
    assert all(np.array_equal(again.points[v].found, judged.points[v].found) for v in variants)


def test_writing_is_for_the_whole_benchmark():
    for wrong in (["--quick"], ["--first-seed", "41"], ["--detectors", "HOG maps"], ["--seeds", "1"]):
        with pytest.raises(SystemExit):
            labelling.main([*wrong, "--write"])


def write_views(folder: Path, poses: bool = True) -> None:
    """Six views from one place of a box before a wall, with its label map."""
    folder.mkdir()
    (folder / "camera-intrinsics.color.txt").write_text("200 0 80\n0 200 60\n0 0 1\n")
    depth, label = np.full((120, 160), 1.0), np.zeros((120, 160), np.uint8)
    depth[40:80, 60:100], label[40:80, 60:100] = 0.8, 7
    raw = np.round(depth * 10000).astype(np.uint32)
    for k in range(6):
        name = str(folder / f"frame-{k:06d}")
        cv2.imwrite(f"{name}.color.png", np.full((120, 160, 3), 90, np.uint8))
        cv2.imwrite(f"{name}.depth.png", (((raw << 3) | (raw >> 13)) & 0xFFFF).astype(np.uint16))
        cv2.imwrite(f"{name}.segm.png", label)
        if poses:
            np.savetxt(f"{name}.pose.txt", np.eye(4))


def test_masks_of_views_label_the_points_of_the_others(tmp_path, capsys):
    write_views(tmp_path / "views")
    assert labelling_fusion.main([str(tmp_path / "views")]) == 0
    rows = [row for row in cells(capsys.readouterr().out) if len(row) > 1 and row[1] == "views"]
    exact = next(row for row in rows if row[3] == "as they are")
    assert exact[2] == "100%" and float(exact[4]) > 0.9
    shrunk = next(row for row in rows if row[3] == "grown by -6 px")
    assert float(shrunk[4]) < float(exact[4])


def test_views_without_poses_are_a_mistake(tmp_path, capsys):
    write_views(tmp_path / "views", poses=False)
    assert labelling_fusion.main([str(tmp_path / "views")]) == 2
    assert "frame-000000.pose.txt" in capsys.readouterr().err

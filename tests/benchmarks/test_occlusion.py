"""The occlusion benchmark: its methods are judged as the evaluator judges, and its draws are measured so too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import occlusion
import occlusion_job
import pytest
from hypothesis import given
from hypothesis import strategies as st
from occlusion_bootstrap import draw_scenes, mean_difference, measure, weighted
from occlusion_job import Job, Stored, code_mark, missing, read, read_material, result_file, run, write
from occlusion_methods import (
    ALWAYS,
    DETECTOR_ALONE,
    FULL,
    JUDGED,
    NO_OCCLUSION,
    VIEWS,
    Claims,
    Judgement,
    as_wholes,
)
from occlusion_plots import write_plots
from occlusion_report import calibration_table, difference_tables, metric_tables, summary_table, verdict_table
from suite import Scene
from suite_job import scene_folder

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.detectors.detections import Detections, Part
from thingmap.mapper.evaluation.boxes.curves import Scored, average_precision, recall_at
from thingmap.mapper.evaluation.boxes.outcomes import ALL, Outcomes
from thingmap.mapper.evaluation.inputs.build_case import build_case
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.evaluation.protocols import honesty, meger
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.runner import SequenceRun
from thingmap.mapper.saving import save_run
from thingmap.mapper.snapshots import SnapshotWriter

FRAMES = 6
SEED = 3  # not one of those held out


def outcome(right: int, wrong: int, objects: int = 10) -> Scored:
    """Right claims above false ones."""
    return Scored(np.arange(right + wrong, 0, -1) / 10.0, np.arange(right + wrong) < right, objects, 1)


def judged(right: int, wrong: int = 2, claims: Claims | None = None) -> Judgement:
    """The same after every number of views, all of one class."""
    outcomes: Outcomes = {(n, label): outcome(right, wrong) for n in VIEWS for label in ("cup", ALL)}
    return Judgement(outcomes, claims)


@st.composite
def scored_scenes(draw: st.DrawFn) -> list[Scored]:
    scenes = []
    for _ in range(draw(st.integers(1, 4))):
        claims = draw(st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=6))
        scores = np.array([score for score, _ in claims], dtype=float)
        right = np.array([flag for _, flag in claims], dtype=bool)
        scenes.append(Scored(scores, right, int(right.sum()) + draw(st.integers(0, 2)), 1))
    return scenes


@given(scored_scenes(), st.integers(0, 100))
def test_a_draw_is_what_the_evaluator_makes_of_its_scenes(scenes: list[Scored], seed: int) -> None:
    weights = np.concatenate([np.ones((1, len(scenes)), dtype=int), draw_scenes(len(scenes), seed, 5)])
    for row, values in zip(weights, weighted(scenes, weights), strict=True):
        pooled = Scored.pooled(scene for scene, times in zip(scenes, row, strict=True) for _ in range(times))
        expected = [recall_at(pooled, 1.0), average_precision(pooled)]
        np.testing.assert_allclose(values, [np.nan if v is None else v for v in expected], atol=1e-12)


def test_draws_repeat_and_have_as_many_scenes() -> None:
    draws = draw_scenes(7)
    assert draws.shape == (500, 7)
    assert (draws.sum(axis=1) == 7).all()
    np.testing.assert_array_equal(draws, draw_scenes(7))
    assert len(np.unique(draws, axis=0)) > 100


def test_a_difference_is_that_of_the_same_scenes() -> None:
    rng, draws = np.random.default_rng(0), draw_scenes(20)
    low = [outcome(int(k), 3) for k in rng.integers(2, 8, 20)]
    high = [outcome(int(np.sum(scene.right)) + 1, 3) for scene in low]
    one, other = measure(high, draws), measure(low, draws)
    lead = mean_difference([one], [other], 0)
    assert lead.value == pytest.approx(0.1)  # one of ten objects more in every scene, and so in every draw
    assert (lead.low, lead.high) == (pytest.approx(0.1), pytest.approx(0.1))
    assert lead.sure and not mean_difference([one], [one], 0).sure
    assert np.ptp(one.drawn[:, 0]) > 0.05


def test_parts_become_the_wholes_they_imply_and_the_best_box_remains() -> None:
    boxes = [[10, 10, 30, 30], [10, 10, 19.5, 30], [100, 40, 120, 50]]
    scores = np.array([[0.5], [0.8], [0.3]])
    found = as_wholes(Detections(("cup",), boxes, scores, np.array([Part.WHOLE, Part.LEFT, Part.BOTTOM])))
    np.testing.assert_allclose(found.xyxy, [[10, 10, 29, 30], [100, 30, 120, 50]])
    np.testing.assert_allclose(found.confidence, [0.8, 0.3])
    assert (found.part == Part.WHOLE).all()
    assert len(as_wholes(Detections.empty(("cup",)))) == 0


@pytest.fixture(scope="module")
def fixed_code() -> Iterator[str]:
    """Whoever edits thingmap while its tests run does not disturb these."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(occlusion_job, "code_mark", lambda: "as tested")
        yield "as tested"


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory, fixed_code: str) -> Job:
    """A short scene that the full model, the detector and a poorer mapper have judged."""
    scene = Scene(Preset.SURVEY, ClutterLevel.LOW, SEED, FRAMES)
    names = FULL.name, DETECTOR_ALONE.name, NO_OCCLUSION.name
    return run(Job(scene, names, tmp_path_factory.mktemp("occlusion"), fixed_code))


def test_a_map_is_judged_as_by_thingmap_evaluate(job: Job, tmp_path: Path) -> None:
    material, stored = read_material(scene_folder(job.scene, job.folder), job.scene.seed), read(job, FULL)
    found = {frame.index: found for frame, found in zip(material.frames, material.detections, strict=True)}
    mapper, out = SemanticMapper(lambda frame: found[frame.index]), OutputFolder.create(tmp_path / "out")
    report = SequenceRun(open_sequence(scene_folder(job.scene, job.folder)), mapper, SnapshotWriter(out, mapper, VIEWS))
    save_run(out, mapper, report.execute(), config="", include_doubtful=True)
    case = build_case(load_run(out.path), material.truth, JUDGED)
    expected = meger.read_outcomes(meger.evaluate(case))
    assert stored is not None and stored.judgement.claims is not None
    assert {views for views, _ in expected} == set(range(2, FRAMES)) == {n for n, _ in stored.judgement.outcomes}
    assert len(expected[FRAMES - 1, ALL].scores) > 3
    for key, one in expected.items():
        mine = stored.judgement.outcomes[key]
        assert (mine.objects, mine.images) == (one.objects, one.images)
        np.testing.assert_array_equal(mine.right, one.right)
        np.testing.assert_allclose(mine.scores, one.scores, atol=1e-3)  # a map's file rounds
    claims, honest = stored.judgement.claims, honesty.evaluate(case)
    assert len(claims.existence) == honest.value("existence samples")
    assert len(claims.probability) == honest.value("class samples") > 0
    assert calibration_table({"low": [claims]}).count(f"{honest.value('existence ECE'):.3f}") >= 1


def test_the_detector_is_judged_in_the_view_after_the_maps(job: Job) -> None:
    material, stored = read_material(scene_folder(job.scene, job.folder), job.scene.seed), read(job, DETECTOR_ALONE)
    assert stored is not None and material.truth.frame_truth is not None
    seen, classes = material.truth.frame_truth(4), material.truth.classes
    assert seen is not None
    labels = {thing.id: classes.index(thing.label) for thing in material.truth.objects}
    rows = [row for row, id_ in enumerate(seen.object_id) if int(id_) in labels and seen.visibility[row] > 0.25]
    class_id = [labels[int(seen.object_id[row])] for row in rows]
    edges = seen.xyxy_visible[rows] + 0.5  # detections count from the image's outer edge
    exact = Detections.from_best_class(classes, edges, class_id, np.full(len(rows), 0.9))
    nothing = Detections.empty(classes)
    only_there = tuple(exact if k == 4 else nothing for k in range(FRAMES))
    outcomes = DETECTOR_ALONE.judge(replace(material, detections=only_there)).outcomes
    assert {views for views, _ in outcomes} == set(range(2, FRAMES))
    assert recall_at(outcomes[4, ALL], 0.0) == 1.0 and len(outcomes[4, ALL].scores) == len(rows) > 3
    assert all(len(outcomes[views, ALL].scores) == 0 < outcomes[views, ALL].objects for views in (2, 3, 5))
    assert sum(outcomes[4, label].objects for label in classes) == outcomes[4, ALL].objects
    assert 0 < len(stored.judgement.outcomes[4, ALL].scores) <= np.sum(material.detections[4].part == Part.WHOLE)


def test_an_interrupted_benchmark_goes_on(job: Job) -> None:
    assert missing(job) == []
    times = {method.name: result_file(job, method).stat().st_mtime_ns for method in (FULL, NO_OCCLUSION)}
    text = result_file(job, DETECTOR_ALONE).read_text()
    result_file(job, DETECTOR_ALONE).write_text(text[:100])
    assert missing(job) == [DETECTOR_ALONE]
    run(job)
    assert missing(job) == []
    assert times == {method.name: result_file(job, method).stat().st_mtime_ns for method in (FULL, NO_OCCLUSION)}
    assert len(missing(replace(job, code="of another day"))) == 3
    with pytest.raises(UserError, match="code was changed"):
        run(replace(job, code="of another day"))


def test_results_of_another_detector_are_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    before = code_mark()
    monkeypatch.setattr(occlusion_job, "DETECTOR", "simulated?seed={seed}")
    assert code_mark() != before


def made_up(rights: dict[str, int]) -> dict[ClutterLevel, occlusion.Judged]:
    """Three scenes a level; the detector finds one object less a step of clutter, what the others find stays."""
    claims = Claims(np.array([0.9, 0.2]), np.array([True, False]), np.array([0.8]), np.array([True]))
    return {
        level: {
            name: [
                Stored(
                    judged(right - step * (name == "detector"), claims=claims if name == "full" else None), {name: 2.0}
                )
                for _ in range(3)
            ]
            for name, right in rights.items()
        }
        for step, level in enumerate(ClutterLevel)
    }


RIGHTS = {"full": 8, "detector": 7, "no-occlusion": 7, "no-depth": 8, "no-parts": 9}


def test_tables_say_who_leads_and_by_how_much() -> None:
    levels = {level: occlusion.pool_scenes(several) for level, several in made_up(RIGHTS).items()}
    low = levels[ClutterLevel.LOW]
    assert "| 12    | 0.800 | 0.700        |" in metric_tables(low)
    assert "+10.0 [+10.0, +10.0]" in difference_tables(low)
    summary = {row[2]: row[3:6] for row in cells(summary_table(levels)) if row[1] == "recall at 1 FPPI"}
    assert [cell[:5] for cell in summary["full - (a) detector"]] == ["+10.0", "+20.0", "+30.0"]
    assert summary["full - (c) no depth"][0].endswith("ahead at 0 of 9")
    verdicts = {(row[1], row[2]): row[3:5] for row in cells(verdict_table(levels))}
    recall = "recall at 1 FPPI"
    assert verdicts["above (a) from 4 views on", recall] == ["at every number of views", "yes"]
    assert verdicts["above (b) no occlusion in high clutter", recall][1] == "yes"
    assert verdicts["above (b) no occlusion by more as clutter grows", recall] == ["+10.0, +10.0, +10.0", "no"]
    assert verdicts["above (d) no parts in medium clutter", recall] == ["-10.0 [-10.0, -10.0]", "no"]
    assert verdicts["at least 10 points above (a) in high clutter", recall][1] == "yes"


def test_verdicts_name_where_the_detector_is_not_behind() -> None:
    levels = {level: occlusion.pool_scenes(several) for level, several in made_up({**RIGHTS, "detector": 8}).items()}
    row = next(row for row in cells(verdict_table(levels)) if row[1].startswith("above (a)"))
    assert row[3].startswith("not at low 4, low 5") and "medium" not in row[3] and row[4] == "no"


def test_calibration_pools_claims() -> None:
    sure = Claims(np.array([0.95] * 4), np.array([1, 1, 1, 0]), np.array([0.55]), np.array([0]))
    doubt = Claims(np.array([0.05] * 4), np.zeros(4), np.empty(0), np.empty(0))
    row = cells(calibration_table({"all": [sure, doubt]}))[-1]
    assert row[1:5] == ["all", "2", "8", "0.125"]  # (4 x 0.20 + 4 x 0.05) / 8
    assert row[6:9] == ["1", "0.550", "no"]


def test_pictures_are_the_same_every_time(tmp_path: Path) -> None:
    levels = {level: occlusion.pool_scenes(several) for level, several in made_up(RIGHTS).items()}
    first, second = write_plots(levels, tmp_path / "a"), write_plots(levels, tmp_path / "b")
    assert set(first) == {"recall low", "recall medium", "recall high", "views"}
    for name, file in first.items():
        text = file.read_text()
        assert text == second[name].read_text()
        assert "</svg>" in text and "<dc:date>" not in text and "(d) no parts" in text
    assert "12 views" in first["recall low"].read_text()


def test_the_command_shows_what_is_judged_and_starts_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(occlusion, "run", lambda job: pytest.fail("everything is there"))
    monkeypatch.setattr(occlusion, "code_mark", lambda: "as shown")
    for level, several in made_up(RIGHTS).items():
        for name, stored in several.items():
            method = next(method for method in ALWAYS if method.name == name)
            for seed, one in enumerate(stored):
                write(Job(Scene(Preset.SURVEY, level, seed, 37), (name,), tmp_path, "as shown"), method, one)
    arguments = ["--folder", str(tmp_path), "--scenes", "3", "--first-seed", "0", "--variants", *RIGHTS]
    assert occlusion.main(arguments) == 0
    shown = capsys.readouterr().out
    assert shown.count("## Occlusion: ") == 5
    assert "seeds 0 to 2" in shown and "no-depth 2.0" in shown
    assert "![views](plots/occlusion-views.svg)" in shown and (tmp_path / "plots/occlusion-views.svg").is_file()


@pytest.mark.parametrize(
    "wrong",
    [
        ["--write", "--scenes", "29"],
        ["--write", "--quick"],
        ["--write", "--first-seed", "1"],
        ["--write", "--frames", "20"],
        ["--write", "--variants", "full", "detector"],
        ["--scenes", "0"],
        ["--frames", "12"],
        ["--first-seed", "-1"],
        ["--variants", "something"],
    ],
)
def test_options_that_make_no_sense_are_refused(wrong: list[str]) -> None:
    with pytest.raises(SystemExit):
        occlusion.main(wrong)


def test_a_folder_that_cannot_be_used_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    arguments = ["--quick", "--folder", str(tmp_path / "file"), "--variants", "full", "--jobs", "1"]
    assert occlusion.main(arguments) == 2
    assert "file" in capsys.readouterr().err


def cells(table: str) -> list[list[str]]:
    """Of every line of a Markdown table; the first and the last are empty."""
    return [[cell.strip() for cell in line.split("|")] for line in table.split("\n")]

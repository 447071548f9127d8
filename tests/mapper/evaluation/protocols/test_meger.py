"""Protocol 3: maps on the way, seen in the next view."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from thingmap.mapper.evaluation.boxes.outcomes import ALL, read_outcomes
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.protocols.meger import evaluate, match_next_view, next_motion, pool
from thingmap.mapper.evaluation.result import NotEvaluated

PATHS, EXPLICIT = (3, 7, 10, 12), (2, 3, 4, 5, 6)


@pytest.fixture
def judge(perfect_run, scene_truth, change_things, make_case):
    def judged(change=lambda things: things):
        run = perfect_run(scene_truth)
        return evaluate(make_case(change_things(run, change(run.object_map.things)), scene_truth))

    return judged


def recalls(result) -> list:
    return [result.value(f"recall at 1 FPPI after {n} views") for n in PATHS]


def precisions(result) -> list:
    return [result.value(f"AP after {n} views") for n in EXPLICIT]


def test_a_perfect_map_scores_perfectly(judge):
    result = judge()
    assert recalls(result) == [1.0] * 4
    assert precisions(result) == [1.0] * 5
    for table in result.tables[:2]:
        assert [row[0] for row in table.rows] == ["bowl", "cereal box", "cup", "soda can", ALL]
        assert all(set(row[1:]) == {1.0} for row in table.rows)


def test_a_missing_thing_costs_its_share(judge):
    result = judge(lambda things: things[1:])
    assert recalls(result) == [pytest.approx(7 / 8)] * 4
    assert precisions(result) == [pytest.approx(7 / 8)] * 5
    assert result.tables[0].rows[0] == ("bowl", 0.5, 0.5, 0.5, 0.5)


def test_doubtful_things_are_ranked_too(judge):
    """The last one is doubtful, but it is there: nothing is lost. A duplicate ranked above it takes its share of AP."""
    doubtful = judge(lambda things: (*things[:7], replace(things[7], existence=0.1)))
    assert precisions(doubtful) == [1.0] * 5
    double = judge(
        lambda things: (*things[:7], replace(things[7], existence=0.1), replace(things[0], id="again", existence=0.5))
    )
    assert precisions(double) == [pytest.approx((7 + 8 / 9) / 8)] * 5
    assert recalls(double) == [1.0] * 4


def test_two_duplicates_in_front_are_more_than_one_false_positive_per_image(judge):
    """All objects but the two that are doubled rank below the duplicates: one false positive too many for them."""

    def change(things):
        doubled = [replace(thing, id=f"again-{k}", existence=0.9) for k, thing in enumerate(things[:2])]
        return *things[:2], *doubled, *(replace(thing, existence=0.8) for thing in things[2:])

    assert recalls(judge(change)) == [pytest.approx(2 / 8)] * 4
    assert judge(change).tables[0].rows[1] == ("cereal box", 1.0, 1.0, 1.0, 1.0)


def test_shifted_and_mislabelled_maps_lose(judge):
    shifted = judge(lambda things: tuple(replace(t, position=t.position + np.array([0.25, 0.0, 0.0])) for t in things))
    assert max(recalls(shifted)) <= 1 / 8

    def relabel(thing, label):
        return replace(thing, label=label, class_posterior={label: thing.probability})

    wrong = judge(lambda things: tuple(relabel(t, o.label) for t, o in zip(things, things[::-1], strict=True)))
    assert recalls(wrong) == [0.0] * 4
    assert precisions(wrong) == [0.0] * 5


def test_the_next_view_is_reached_by_the_true_motion(perfect_run, scene_truth, make_case):
    """The map's last pose is off by a metre, and so is the map: only the motion between the frames is taken."""
    run = perfect_run(scene_truth)
    drift = np.eye(4)
    drift[:3, 3] = [1.0, 0.0, 0.0]
    snapshots = tuple(
        replace(
            one,
            T_world_camera=drift @ one.T_world_camera,
            object_map=replace(
                one.object_map,
                things=tuple(replace(t, position=t.position + drift[:3, 3]) for t in one.object_map.things),
            ),
        )
        for one in run.snapshots
    )
    wild = run.poses.copy()
    wild[4:, :3, 3] += 0.3  # poses that the run estimated later are not asked for
    case = make_case(replace(run, snapshots=snapshots), scene_truth)
    case = replace(case, run=replace(case.run, poses=wild))
    assert recalls(evaluate(case)) == [1.0] * 4
    expected = np.linalg.inv(scene_truth.poses[3]) @ scene_truth.poses[4]
    np.testing.assert_allclose(next_motion(case, 3), expected, atol=1e-12)

    blind = replace(case, truth=replace(scene_truth, poses=None))
    np.testing.assert_allclose(next_motion(blind, 5), np.linalg.inv(wild[5]) @ wild[6], atol=1e-12)
    assert "estimated" in " ".join(evaluate(blind).notes)


def test_views_are_mapped_frames(perfect_run, scene_truth, make_case):
    """A run over every second frame: the map of 3 views, frames 0, 2 and 4, is seen in frame 6."""
    run = perfect_run(scene_truth)
    rows = np.arange(0, 40, 2)
    snapshots = tuple(replace(run.snapshots[row], frames=k + 1) for k, row in enumerate(rows))
    run = replace(run, stamps=run.stamps[rows], poses=run.poses[rows], snapshots=snapshots)
    case = make_case(run, scene_truth)
    assert match_next_view(case, snapshots[2]).frame == 6
    assert recalls(evaluate(case)) == [1.0] * 4


def test_without_snapshots_it_is_said_how_to_get_them(perfect_run, scene_truth, make_case):
    run = replace(perfect_run(scene_truth), snapshots=())
    with pytest.raises(NotEvaluated, match="--snapshots 2,3,4,5,6,7,10,12"):
        evaluate(make_case(run, scene_truth))


def test_lengths_that_cannot_be_judged_are_named(perfect_run, scene_truth, make_case):
    run = perfect_run(scene_truth)
    whole = scene_truth.frame_truth
    truth = replace(scene_truth, frame_truth=lambda index: None if index == 3 else whole(index))
    short = replace(run, stamps=run.stamps[:12], poses=run.poses[:12], snapshots=run.snapshots[:12])
    result = evaluate(make_case(short, truth))
    assert recalls(result) == [None, 1.0, 1.0, None]  # after 10 views the last frame is judged, after 12 none is left
    notes = " ".join(result.notes)
    assert "3 views: the next frame is not annotated" in notes
    assert "12 views: no frame was mapped after them" in notes
    without_4 = replace(run, snapshots=tuple(one for one in run.snapshots if one.frames != 4))
    result = evaluate(make_case(without_4, scene_truth))
    assert precisions(result) == [1.0, 1.0, None, 1.0, 1.0]
    last = replace(run, snapshots=(replace(run.snapshots[-1], frames=40),))
    with pytest.raises(NotEvaluated, match="followed by a view"):
        config = EvaluationConfig(path_lengths=(40,), explicit_lengths=())
        evaluate(make_case(last, scene_truth, config=config))


def test_curves_are_drawn_from_nothing_to_all_and_hold_until_the_border(judge):
    """One object is missed; two false positives rank last."""
    result = judge(
        lambda things: (*things[1:], *(replace(t, id=f"again-{k}", existence=0.5) for k, t in enumerate(things[1:3])))
    )
    curves = {plot.title.split(": ")[-1]: plot for plot in result.plots[:-1]}
    assert curves[ALL].limits == (0.0, 2.0, 0.0, 1.0) and curves["soda can"].limits == (0.0, 1.0, 0.0, 1.0)
    for series in curves[ALL].series:
        assert series.x == (0.0, 0.0, 2.0, 2.0) and series.y == (0.0, *[pytest.approx(7 / 8)] * 3)
    empty = judge(lambda things: ())
    assert {series.y for plot in empty.plots[:-1] for series in plot.series} == {(0.0, 0.0)}


def test_scenes_are_pooled_from_results_and_from_reports(judge):
    perfect, poor = judge(), judge(lambda things: things[4:])
    pooled = pool([perfect, json.loads(json.dumps(poor.to_dict()))])
    assert recalls(pooled) == [pytest.approx(12 / 16)] * 4
    assert precisions(pooled) == [pytest.approx(12 / 16)] * 5
    outcomes = read_outcomes(pooled)[3, ALL]
    assert (outcomes.images, outcomes.objects, len(outcomes.scores)) == (2, 16, 12)
    again = pool([pooled, perfect])
    assert recalls(again) == [pytest.approx(20 / 24)] * 4
    assert pool([perfect]).value("AP after 2 views") == 1.0


def test_pooling_counts_false_positives_per_image(judge):
    """Two duplicates in one of two scenes are one false positive per image."""

    def change(things):
        return *things, *(replace(thing, id=f"again-{k}") for k, thing in enumerate(things[:2]))

    alone, pooled = judge(change), pool([judge(change), judge()])
    assert recalls(alone) == [0.0] * 4  # all scores are equal: no threshold has one false positive only
    assert recalls(pooled) == [1.0] * 4


def test_only_results_of_this_protocol_are_pooled(judge):
    result = judge()
    with pytest.raises(ValueError, match="Scored outcomes"):
        pool([replace(result, tables=result.tables[:2])])

"""Protocol 2: F-scores of labelled points, by hand and on the scene of eight objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import TABLE_HEIGHT

from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.points.label_scores import mean_f, mean_precision, mean_recall, score_labels
from thingmap.mapper.evaluation.protocols.lai import evaluate, random_labels

labels = st.lists(st.tuples(st.integers(-1, 2), st.integers(-1, 2)), min_size=1, max_size=60)


def test_scores_by_hand():
    true = np.array([0, 0, 0, 1, -1, -1, -1, -1])
    found = np.array([0, 0, 1, -1, -1, -1, -1, 0])
    scores = score_labels(found, true, ("cup", "bowl", "cap"))
    cup, bowl = scores.objects  # no point is, or is called, a cap
    assert (cup.points, cup.labelled) == (3, 3)
    assert (cup.precision, cup.recall, cup.f_score) == pytest.approx((2 / 3, 2 / 3, 2 / 3))
    assert (bowl.precision, bowl.recall, bowl.f_score) == (0.0, 0.0, 0.0)
    assert (scores.background.precision, scores.background.recall) == (0.75, 0.75)
    assert scores.accuracy == 5 / 8
    assert mean_f(scores.objects) == pytest.approx(1 / 3)
    assert mean_f(scores.all) == pytest.approx((2 / 3 + 0.0 + 0.75) / 3)


def test_a_class_that_is_never_named_has_no_precision_but_lowers_the_mean():
    scores = score_labels(np.array([0, -1, -1]), np.array([0, 1, -1]), ("cup", "bowl"))
    assert scores.objects[1].precision is None
    assert mean_precision(scores.objects) == 0.5
    assert mean_recall(scores.objects) == 0.5


def test_a_class_without_points_is_in_no_mean():
    scores = score_labels(np.array([0, 1, -1]), np.array([0, -1, -1]), ("cup", "bowl"))
    assert [one.name for one in scores.objects] == ["cup", "bowl"]
    assert (scores.objects[1].precision, scores.objects[1].recall, scores.objects[1].f_score) == (0.0, None, None)
    assert mean_f(scores.objects) == mean_precision(scores.objects) == mean_recall(scores.objects) == 1.0
    assert mean_f(()) is None


@given(labels)
def test_scores_are_shares_and_right_labels_are_perfect(pairs):
    true, found = np.array(pairs).T
    scores = score_labels(found, true, ("a", "b", "c"))
    for one in scores.all:
        for share in (one.precision, one.recall, one.f_score):
            assert share is None or 0.0 <= share <= 1.0
    assert scores.accuracy == pytest.approx(np.mean(true == found))
    assert sum(one.points for one in scores.all) == sum(one.labelled for one in scores.all) == len(pairs)
    assert mean_f(score_labels(true, true, ("a", "b", "c")).all) == 1.0


@pytest.mark.parametrize("labelled", [True, False])
def test_a_perfect_map_scores_perfectly(labelled, perfect_run, scene_truth, make_case):
    result = evaluate(make_case(perfect_run(scene_truth, labelled), scene_truth))
    for name in ("micro F", "macro F", "macro F with background", "overall precision", "overall recall"):
        assert result.value(name) == 1.0
    table = result.tables[1]
    assert [row[0] for row in table.rows] == [*scene_truth.classes, "background", "overall"]
    assert all(row[3:] == (1.0, 1.0, 1.0) for row in table.rows)


def test_naive_labellings_on_the_same_points(perfect_run, scene_truth, make_case):
    """AllBG has the share of the background, macro 0; Random is right once in five, whatever the classes' shares."""
    result = evaluate(make_case(perfect_run(scene_truth), scene_truth))
    true = scene_truth.point_truth().class_id
    share = np.mean(true == NO_OBJECT)
    assert result.value("AllBG micro F") == pytest.approx(share)
    assert result.value("AllBG macro F") == 0.0
    # as in the paper's figure 4: the macro score of AllBG is that of the background over the number of labels
    assert result.tables[0].rows[2][3] == pytest.approx(2 * share / (1 + share) / 5)
    assert result.value("Random micro F") == pytest.approx(0.2, abs=0.02)
    drawn = random_labels(len(true), 4)
    right = [2 * np.sum((drawn == k) & (true == k)) / (np.sum(drawn == k) + np.sum(true == k)) for k in range(4)]
    assert result.value("Random macro F") == pytest.approx(np.mean(right))
    assert set(drawn.tolist()) == {NO_OBJECT, 0, 1, 2, 3}
    assert evaluate(make_case(perfect_run(scene_truth), scene_truth)).to_dict() == result.to_dict()


def test_a_wrong_label_costs_exactly_its_points(perfect_run, scene_truth, change_things, make_case):
    """The second soda can is called a cup: its points leave the one and dilute the other."""
    run = perfect_run(scene_truth)
    can = run.object_map.things[7]
    wrong = replace(can, label="cup", class_posterior={"cup": can.probability})
    result = evaluate(make_case(change_things(run, (*run.object_map.things[:7], wrong)), scene_truth))
    true = scene_truth.point_truth()
    lost, cans = np.sum(true.object_id == 7), np.sum(true.class_id == 3)
    cups = np.sum(true.class_id == 2)
    rows = {row[0]: row for row in result.tables[1].rows}
    assert rows["soda can"][3:5] == (1.0, pytest.approx(1.0 - lost / cans))
    assert rows["cup"][3:5] == (pytest.approx(cups / (cups + lost)), 1.0)
    assert result.value("micro F") == pytest.approx(1.0 - lost / len(true.points))
    f_scores = (1.0, 1.0, 2 * cups / (2 * cups + lost), 2 * (cans - lost) / (2 * cans - lost))
    assert result.value("macro F") == pytest.approx(np.mean(f_scores))
    assert result.value("macro F with background") == pytest.approx(np.mean([*f_scores, 1.0]))
    assert result.value("overall precision") == pytest.approx((4 + cups / (cups + lost)) / 5)
    assert result.value("overall recall") == pytest.approx((4 + 1 - lost / cans) / 5)


def test_a_cloud_that_leaves_objects_out_gains_nothing_unseen(perfect_run, scene_truth, make_case):
    """Without the points of one box all labels are right, but the share of points that the map has tells it."""
    run, true = perfect_run(scene_truth, labelled=True), scene_truth.point_truth()
    points, labels = run.cloud()
    kept = true.object_id != 2
    result = evaluate(make_case(replace(run, cloud=lambda: (points[kept], labels[kept])), scene_truth))
    assert result.value("macro F") == 1.0
    # Only the lowest points of the box are near others, those of the table.
    wanted = true.object_id >= 0
    low = (true.object_id == 2) & (true.points[:, 2] < TABLE_HEIGHT + EvaluationConfig().point_distance)
    covered = result.value("object points covered")
    assert np.mean(kept[wanted]) <= covered <= np.mean((kept | low)[wanted])
    assert evaluate(make_case(run, scene_truth)).value("object points covered") == 1.0


def test_a_shifted_map_loses_points_and_an_empty_one_is_all_background(
    perfect_run, scene_truth, change_things, make_case
):
    run = perfect_run(scene_truth)
    side = run.object_map.R_world_upright[:, 0]
    shifted = [replace(thing, position=thing.position + 0.05 * side) for thing in run.object_map.things]
    result = evaluate(make_case(change_things(run, shifted), scene_truth))
    assert 0.2 < result.value("macro F") < 0.9
    empty = evaluate(make_case(change_things(run, ()), scene_truth))
    assert empty.value("micro F") == empty.value("AllBG micro F")
    assert empty.value("macro F") == 0.0

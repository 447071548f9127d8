from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.truth import FrameTruth
from thingmap.mapper.evaluation.things.seen import see_objects


@pytest.fixture
def look(scene_truth, perfect_run, make_case):
    """`look({frame: FrameTruth})`: what a run over the first frames sees; other frames are not annotated."""

    def run(frames):
        truth = replace(scene_truth, frame_truth=frames.get)
        return see_objects(make_case(perfect_run(truth), truth))

    return run


def frame(*rows):
    """Rows (id, box, visible box, visibility)."""
    ids, whole, visible, visibility = zip(*rows, strict=True)
    return FrameTruth(np.array(ids), np.array(whole, float), np.array(visible, float), np.array(visibility, float))


NOTHING = (np.nan,) * 4


def test_visible_share_and_size_must_come_together(look):
    large, small = (0.0, 0.0, 100.0, 100.0), (0.0, 0.0, 15.9, 15.9)
    seen = look(
        {
            0: frame(
                (0, large, large, 0.24), (1, small, small, 1.0), (2, large, large, 0.25), (3, large, NOTHING, 0.0)
            ),
            1: frame((0, small, small, 1.0)),
        }
    )
    assert seen.well_seen == {2} and seen.frames == 2
    assert [seen.counts(k) for k in range(4)] == [False, False, True, False]
    assert 3 not in seen.best


def test_the_best_view_is_large_and_clear(look):
    large, small = (10.0, 10.0, 110.0, 110.0), (0.0, 0.0, 40.0, 40.0)
    seen = look({4: frame((0, large, large, 0.3)), 7: frame((0, small, small, 1.0)), 9: frame((0, large, large, 0.5))})
    assert (seen.best[0].frame, seen.best[0].xyxy) == (9, large)  # 0.5 * 100 > 1 * 40


def test_occlusion_is_the_mean_over_frames_that_show_it_and_hold_half_of_it(look):
    inside, cut, mostly_out = (10.0, 10.0, 50.0, 50.0), (-20.5, 0.0, 19.5, 40.0), (-30.5, 0.0, 9.5, 40.0)
    seen = look(
        {
            0: frame((0, inside, inside, 0.8)),
            1: frame((0, cut, cut, 0.4)),  # exactly half
            2: frame((0, mostly_out, mostly_out, 0.1)),
            3: frame((0, inside, NOTHING, 0.0)),
        }
    )
    assert seen.occlusion == {0: pytest.approx(0.4)}


def test_nothing_annotated_means_everything_counts(look):
    seen = look({})
    assert seen.frames == 0 and seen.counts(5) and not seen.occlusion


def test_only_mapped_frames_are_looked_at(scene_truth, perfect_run, make_case):
    asked = []

    def frame_truth(index):
        asked.append(index)
        return scene_truth.frame_truth(index)

    run = perfect_run(scene_truth)
    run = replace(run, stamps=run.stamps[10:20], poses=run.poses[10:20])
    case = make_case(run, replace(scene_truth, frame_truth=frame_truth))
    asked.clear()
    assert see_objects(case) is see_objects(case)  # looked at once
    assert asked == list(range(10, 20))

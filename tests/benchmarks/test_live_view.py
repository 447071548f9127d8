import numpy as np
import pytest
from live_view import LiveCost, describe, main, measure

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence

pytest.importorskip("rerun", reason="the live view needs the extra `view`")


def test_the_ratio_counts_the_view_and_both_loops():
    keyframe = np.array([True, False])
    cost = LiveCost(np.array([10.0, 10.0]), np.array([11.0, 9.0]), np.array([3.0, 1.0]), keyframe, 1.0, 4)
    assert cost.ratio == pytest.approx(24.0 / 20.0)
    text = describe(cost, "table")
    assert "1.200 times" in text and "2.00 ms a frame" in text and "250 kB" in text
    assert "| keyframes  | 1 " in text


def test_a_short_run_is_measured(tmp_path):
    sequence = open_sequence("sample:tabletop?frames=8&width=160")
    cost = measure(sequence, "simulated", tmp_path / "run.rrd", warm_up=3)
    assert len(cost.view) == 5 and cost.frames == 8 and (cost.view > 0.0).all() and cost.megabytes > 0.01


def test_a_sequence_that_is_all_warm_up_is_refused(tmp_path, capsys):
    with pytest.raises(UserError, match="longer"):
        measure(open_sequence("sample:tabletop?frames=2&width=160"), "simulated", tmp_path / "run.rrd")
    assert main(["--sequence", str(tmp_path / "none")]) == 2
    assert capsys.readouterr().err.startswith("error: ")

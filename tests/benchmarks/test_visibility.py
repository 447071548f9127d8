"""The benchmark of visibility: its volumes are where it says, and its verdict can be either."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from visibility import Measured, Volumes, describe, main, measure_steps, place_volumes

from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.datasets.synthetic.synth import open_synth

LINE = "survey?seed=3&clutter=low&width=320&objects=4"


@pytest.fixture(scope="module")
def sequence() -> SyntheticSequence:
    return open_synth(LINE)


def volumes_in(sequence: SyntheticSequence, count: int) -> Volumes:
    return place_volumes(sequence, sequence[18], count, np.random.default_rng(0))


def test_half_of_the_volumes_are_things_and_the_others_in_view(sequence):
    volumes, frame = volumes_in(sequence, 12), sequence[18]
    assert volumes.true == 6
    np.testing.assert_array_equal(volumes.centers[0], sequence.objects[0].position)
    T = frame.T_world_camera
    assert T is not None
    in_camera = (volumes.centers[6:] - T[:3, 3]) @ T[:3, :3]
    uv = frame.intrinsics.project(in_camera)
    assert ((uv >= 0.0) & (uv <= [320.0, 240.0])).all()
    assert ((in_camera[:, 2] >= 0.6) & (in_camera[:, 2] <= 3.0)).all()


def test_steps_are_measured_against_the_first(sequence):
    steps, pixels = measure_steps(sequence[18], volumes_in(sequence, 12), repeats=2)
    assert list(steps) == [1, 2, 4]
    assert steps[1].error == steps[1].worst == steps[1].log_ratio_error == 0.0
    assert all(m.ms > 0.0 and m.ms_without > 0.0 and 0.0 <= m.error <= m.worst <= 1.0 for m in steps.values())
    assert pixels.shape == (12,) and pixels.sum() > 0


def test_the_verdict_follows_time_and_error(sequence):
    volumes, good = volumes_in(sequence, 12), Measured(0.1, 0.1, 0.01, 0.1, 0.02)
    for second, kept in [(good, True), (replace(good, ms=5.0), False), (replace(good, error=0.03), False)]:
        text = describe(LINE, sequence[18], volumes, {1: good, 2: second, 4: good}, np.full(12, 100))
        assert ("Step 2 keeps" in text) is kept
        assert ("does NOT keep" in text) is not kept


def test_the_command_prints_and_refuses(capsys):
    assert main(["--scene", LINE, "--volumes", "8", "--repeats", "1"]) == 0
    assert "## Visibility" in capsys.readouterr().out
    assert main(["--scene", "nowhere"]) == 2
    assert "nowhere" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["--volumes", "1"])

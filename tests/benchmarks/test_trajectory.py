"""The trajectory benchmark: its measures are right where the answer is known, and it runs on a few small frames."""

from __future__ import annotations

from pathlib import Path

import gtsam
import numpy as np
import pytest
import trajectory
from results import RESULTS
from suite import FIRST_SEED
from surface_thickness import Thickness
from trajectory import RENDERED, MapperColumn
from trajectory_job import changed, open_one, render, run_all, scene_folder, track_sequence
from trajectory_measures import Mapped, Measured, measure, open_surfaces
from trajectory_report import OWN_POSES, Row, describe, mean_and_worst

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import Preset, SyntheticConfig
from thingmap.mapper.config import MapperConfig, OdometrySource
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.records import DropLoop, Loop, Motion
from thingmap.mapper.evaluation.uncertainty.consistency import Consistency
from thingmap.mapper.trajectory.rigid import inverse

FRAMES = 60
SIGMA = 0.01  # rad, m


class Known:
    """The poses of a camera that goes on a wide arc; `measure` asks for no image."""

    name = "arc"
    stamps = np.arange(FRAMES) / 15.0

    def __init__(self) -> None:
        turns = np.linspace(0.0, 2.0, FRAMES)
        at = [np.array([np.cos(turn), np.sin(turn), 0.2 * turn]) for turn in turns]
        self.poses = np.array([gtsam.Pose3(gtsam.Rot3.Rz(turn), p).matrix() for turn, p in zip(turns, at, strict=True)])


def exact(sequence: Known) -> Mapped:
    """Mapped without an error, in other axes; every 5th frame a keyframe, with honestly noisy motions between them."""
    elsewhere = gtsam.Pose3(gtsam.Rot3.RzRyRx(0.3, -0.2, 1.0), np.array([1.0, 2.0, 3.0])).matrix()
    rng, ledger, keyframes = np.random.default_rng(0), Ledger(), sequence.poses[::5]
    for b in range(1, len(keyframes)):
        ledger.append(Motion(b - 1, b, noisy(inverse(keyframes[b - 1]) @ keyframes[b], rng), SIGMA**2 * np.eye(6)))
    return Mapped(sequence.stamps, elsewhere @ sequence.poses, sequence.stamps[::5], ledger, {})


def noisy(T: np.ndarray, rng: np.random.Generator, scale: float = 1.0) -> np.ndarray:
    return T @ gtsam.Pose3.Expmap(scale * SIGMA * rng.standard_normal(6)).matrix()


def test_an_exact_trajectory_has_no_error_and_honest_motions_are_found_honest() -> None:
    found = measure(exact(Known()), Known())
    assert found.ate == pytest.approx(0.0, abs=1e-9) and found.rpe == pytest.approx((0.0, 0.0), abs=1e-9)
    assert (found.frames, found.posed, found.loops, found.dropped) == (FRAMES, FRAMES, 0, 0)
    motions = found.steps["Motion"]
    assert len(motions.nees) == 11 and motions.dof == 6
    assert motions.band is not None and motions.mean_per_dof is not None
    assert motions.band[0] < motions.mean_per_dof < motions.band[1]
    assert set(found.steps) == {"Motion"} and found.thickness is None


def test_errors_have_their_size_and_missing_frames_are_counted() -> None:
    mapped, sequence = exact(Known()), Known()
    shaken = mapped.poses.copy()
    shaken[:, 2, 3] += np.where(np.arange(FRAMES) % 2, 0.01, -0.01)
    found = measure(Mapped(mapped.stamps[:-4], shaken[:-4], mapped.keyframe_stamps, mapped.ledger, {}), sequence)
    assert found.ate == pytest.approx(0.01, rel=0.02)
    assert (found.frames, found.posed) == (FRAMES, FRAMES - 4)
    assert found.rpe is not None and found.rpe[0] == pytest.approx(0.02, rel=0.05)  # 15 frames, an odd number
    assert found.rpe[1] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(UserError, match="1 of its frames"):
        measure(Mapped(mapped.stamps[:1], shaken[:1], np.empty(0), Ledger(), {}), sequence)


def test_a_wrong_loop_is_too_sure_and_counts_no_more_once_it_is_dropped() -> None:
    mapped, sequence, rng = exact(Known()), Known(), np.random.default_rng(3)
    keyframes = sequence.poses[::5]
    for a in (0, 1, 2):
        wrong = noisy(inverse(keyframes[a]) @ keyframes[-1], rng, 20.0)
        number = mapped.ledger.append(Loop(a, len(keyframes) - 1, wrong, SIGMA**2 * np.eye(6)))
    found = measure(mapped, sequence)
    assert found.loops == 3 and found.steps["Loop"].verdict == "too sure" and len(found.steps["Loop"].nees) == 3
    mapped.ledger.append(DropLoop(number))
    found = measure(mapped, sequence)
    assert (found.loops, found.dropped, len(found.steps["Loop"].nees)) == (2, 1, 2)


def test_configurations_change_at_dotted_names_and_no_other_names_are_taken() -> None:
    config = changed(MapperConfig(), {"smoother.joint": False, "seed": 3})
    assert (config.smoother.joint, config.seed) == (False, 3)
    assert config.smoother.guard_size == MapperConfig().smoother.guard_size
    for name in ("smoother.jiont", "jointly", "seed.deeper"):
        with pytest.raises(UserError, match=name):
            changed(MapperConfig(), {name: False})


def test_scenes_are_held_out_and_as_long_as_they_are_said_to_be() -> None:
    configs = {row.name: row.configs(None, None, 640) for row in RENDERED}
    assert {name: (len(several), several[0].frames) for name, several in configs.items()} == {
        "hand-held": (3, 300),
        "fast": (3, 200),
        "laps": (1, 1800),
        "bare wall": (3, 200),
    }
    assert all(config.seed >= FIRST_SEED for several in configs.values() for config in several)
    assert (configs["fast"][0].pace, configs["fast"][0].blur) == (3.0, 4)
    every = [config for several in configs.values() for config in several]
    assert len({scene_folder(config, Path()) for config in every}) == len(every) == 10
    assert [c.frames for row in RENDERED for c in row.configs(1, 50, 160)] == [50] * 4


def measured(ate: float, **changes) -> Measured:
    values: dict = {"frames": 9, "posed": 9, "ate": ate, "rpe": (0.002, 0.01), "outcomes": {}, "loops": None}
    values |= {"dropped": 0, "steps": {}, "thickness": None}
    return Measured(**{**values, **changes})


def test_tables_say_what_was_measured_and_what_was_not() -> None:
    rows = [Row("orbit", 5.0, exact=True), Row("kitchen", None, exact=False)]
    steps = {"Motion": Consistency(6, np.array([5.0, 7.0]), 0)}
    whole = {"loops": 2, "outcomes": {"lost": 1}, "steps": steps, "thickness": Thickness(0.0012, 7)}
    results = {
        ("orbit", "whole"): [measured(0.004, **whole), measured(0.006, **whole)],
        ("kitchen", "whole"): [measured(0.03, posed=7)],
        ("orbit", "kiss"): [measured(0.02), measured(0.01)],
        ("kitchen", "kiss"): [measured(0.05, rpe=None)],
        ("orbit", OWN_POSES): [measured(0.0, thickness=Thickness(0.0009, 7))] * 2,
        ("kitchen", OWN_POSES): [measured(0.0, posed=2)],
    }
    titles = {"whole": "whole", "kiss": "KISS-ICP alone", OWN_POSES: "its own poses"}
    texts = describe(rows, titles, results, ["loops: there are none"])
    errors = texts["errors"]
    lines = [" ".join(line.replace("|", " ").split()) for line in "\n".join(texts.values()).splitlines()]
    assert "orbit 2 5 5.0 (6.0) 15.0 (20.0)" in lines and "kitchen 1 - 30.0 50.0" in lines
    assert "orbit 2.0 / 0.57 2.0 / 0.57" in lines and "orbit 2 1.20 (1.20) - 0.90 (0.90)" in lines
    assert "orbit 2 0 / 2; 4 + 0" in lines and "kitchen 1 - / -" in lines
    assert any(line.startswith("orbit Motion 4 1.00") for line in lines)
    assert "whole on kitchen: 2." in errors and "own poses" not in errors and "loops: there are none" in errors
    assert mean_and_worst([], 1) == mean_and_worst([0.1, None], 1) == "-"


def test_an_odometry_alone_is_measured_on_a_rendered_scene(tmp_path) -> None:
    config = SyntheticConfig(Preset.TABLETOP, seed=3, frames=12, width=160)
    render(config, tmp_path)
    stamp = (scene_folder(config, tmp_path) / "poses.txt").stat().st_mtime_ns
    render(config, tmp_path)
    assert (scene_folder(config, tmp_path) / "poses.txt").stat().st_mtime_ns == stamp  # it was there
    sequence = open_one(scene_folder(config, tmp_path), 10)
    given = changed(MapperConfig(), {"odometry.source": OdometrySource.POSES})
    found = measure(track_sequence(sequence, given), sequence, open_surfaces(sequence))
    assert found.ate == pytest.approx(0.0, abs=1e-9) and found.posed == 10 and found.loops is None
    assert sum(found.outcomes.values()) == 10 and found.thickness == Thickness(None, 0)  # a third of a second


def test_the_command_maps_each_row_by_each_mapper(tmp_path, monkeypatch, capsys) -> None:
    columns = (trajectory.COLUMNS[0], MapperColumn("later", "with something new", {"no.such": True}))
    monkeypatch.setattr(trajectory, "COLUMNS", columns)
    before = RESULTS.read_bytes()
    small = ["--seeds", "1", "--frames", "6", "--width", "160", "--jobs", "0", "--folder", str(tmp_path)]
    assert trajectory.main(["--rows", "hand-held", "--mappers", "whole", "later", *small]) == 0
    said = capsys.readouterr().out
    assert "| hand-held | 1 " in said and "with something new: the mapper's configuration has no no.such" in said
    scene = scene_folder(RENDERED[0].configs(1, 6, 160)[0], tmp_path)
    assert trajectory.main(["--rows", "--sequence", str(scene), "--mappers", "whole", *small]) == 0
    assert f"| {scene.name} | 1 " in capsys.readouterr().out
    assert trajectory.main(["--sequence", str(scene), "nothing:new", *small]) == 2
    assert "nothing" in capsys.readouterr().err
    assert trajectory.main(["--rows", "--sequence", str(tmp_path / "absent"), *small]) == 2
    assert "no such folder" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        trajectory.main(["--write", *small])
    assert RESULTS.read_bytes() == before


def test_work_is_done_in_other_processes_and_keeps_its_keys() -> None:
    calls = {"three": ("abc",), "one": ("a",)}
    assert run_all(len, calls, 2) == run_all(len, calls, 0) == {"three": 3, "one": 1}
    with pytest.raises(TypeError):
        run_all(len, {"none": (3,), **calls}, 1)

"""A line of text and the configuration it stands for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import FASTEST, LIMITS, ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.rendering.sensor import IDEAL, SWITCHES, DepthSensor
from thingmap.datasets.synthetic.synth import open_synth, parse_synth, synth_line

FOLDER_LETTERS = st.text("ab/. +&=%?#~ä-_", min_size=1, max_size=12)


def test_every_parameter_is_read():
    config = parse_synth(
        "synth:kitchen?seed=3&objects=20&clutter=high&frames=150&width=320&meshes=/some/scans&blur=4&pace=2.5&without=axial+shadow"
    )
    assert config == SyntheticConfig(
        Preset.KITCHEN, 20, ClutterLevel.HIGH, 3, 150, 320, Path("/some/scans"), 4, 2.5,
        sensor=replace(DepthSensor(), axial=False, shadow=False),
    )  # fmt: skip


def test_only_what_differs_from_the_defaults_is_written():
    for preset in Preset:
        assert synth_line(SyntheticConfig(preset)) == f"synth:{preset}"
        assert parse_synth(f"{preset}") == SyntheticConfig(preset)
    assert synth_line(parse_synth("tabletop?seed=0&objects=12&clutter=medium&frames=300&width=640&blur=1")) == (
        "synth:tabletop"
    )
    assert synth_line(parse_synth("laps?frames=300&without=shadow,axial")) == (
        "synth:laps?frames=300&without=axial+shadow"
    )
    assert synth_line(parse_synth("wall?pace=3.0&objects=0")) == "synth:wall?pace=3"
    assert synth_line(SyntheticConfig(pace=0.1 + 0.2)) == "synth:tabletop?pace=0.30000000000000004"
    assert synth_line(SyntheticConfig(sensor=IDEAL)) == "synth:tabletop?without=all"


@settings(max_examples=200, deadline=None)
@given(
    preset=st.sampled_from(Preset),
    clutter=st.sampled_from(ClutterLevel),
    pace=st.floats(0.0, FASTEST, exclude_min=True) | st.integers(1, 8),
    numbers=st.fixed_dictionaries({}, optional={key: st.integers(*LIMITS[key]) for key in LIMITS if key != "width"}),
    meshes=st.none() | FOLDER_LETTERS,
    off=st.sets(st.sampled_from(SWITCHES)),
)
def test_a_line_asks_for_what_it_was_made_of(preset, clutter, pace, numbers, meshes, off):
    if preset is Preset.SURVEY:
        numbers.pop("blur", None)  # its camera stands still
        pace = 1.0
    if preset is Preset.WALL:
        numbers.pop("objects", None)  # nothing stands before it
        meshes = None
    sensor = replace(DepthSensor(), **dict.fromkeys(off, False))
    folder = None if meshes is None else Path("/no such place") / meshes
    config = SyntheticConfig(preset, clutter=clutter, sensor=sensor, meshes=folder, pace=pace, **numbers)
    line = synth_line(config)
    again = parse_synth(line)
    assert synth_line(again) == line
    for name in ("preset", "clutter", "seed", "object_count", "frame_count", "width", "meshes", "pace", "sensor"):
        assert getattr(again, name) == getattr(config, name)
    assert max(again.blur, 1) == max(config.blur, 1)


def test_folders_are_read_plain_and_encoded(tmp_path: Path):
    for name in ("plain", "with blank", "50% & more", "a+b", "a%20b", "x=1"):
        folder = tmp_path / name
        folder.mkdir()
        assert parse_synth(f"tabletop?meshes={folder}&seed=2").meshes == folder
        assert parse_synth(synth_line(SyntheticConfig(meshes=folder))).meshes == folder


def test_all_means_a_sensor_that_reads_the_truth():
    assert parse_synth("survey?without=all").sensor == IDEAL
    assert parse_synth("survey?without=all+edges").sensor == IDEAL
    assert parse_synth("survey?without=" + "+".join(SWITCHES)).sensor == IDEAL


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("garden", "synth:garden: expected one of tabletop, survey, kitchen, laps, wall, found 'garden'; name one"),
        ("synth:", "expected one of tabletop, survey, kitchen, laps, wall, found ''"),
        ("tabletop?speed=2", "expected parameters seed, objects, clutter, .*, without, found 'speed'; leave it out"),
        ("tabletop?seed=1&seed=2", "expected seed once"),
        ("tabletop?objects=many", "expected a whole number for objects, found 'many'; change it"),
        ("tabletop?objects", "expected a whole number for objects, found ''"),
        ("tabletop?objects=0", "expected objects from 1 to 100, found 0"),
        ("tabletop?frames=30000", "expected frames from 1 to 20000, found 30000"),
        ("tabletop?width=70", "expected a width divisible by 4, found 70"),
        ("tabletop?pace=fast", "expected a number for pace, found 'fast'; change it"),
        ("tabletop?pace=0", "expected pace above 0 and up to 8, found 0.0; change it"),
        ("tabletop?pace=9", "expected pace above 0 and up to 8, found 9.0; change it"),
        ("tabletop?pace=nan", "expected pace above 0 and up to 8, found nan; change it"),
        ("survey?pace=2", "synth:survey: its camera stands still, found pace 2.0; leave it out"),
        ("wall?objects=2", "synth:wall: nothing stands before its wall, found objects 2; leave it out"),
        ("tabletop?clutter=much", "expected clutter to be one of low, medium, high, found 'much'"),
        ("tabletop?meshes=", "expected the folder of the meshes, found ''"),
        ("tabletop?without=", "expected without to name some of range_limits, .* or all, found ''"),
        ("tabletop?without=axial+noise", "expected without to name some of .*, found 'noise'"),
    ],
)
def test_mistakes_are_named(name: str, said: str):
    with pytest.raises(UserError, match=said):
        open_synth(name)


def test_the_one_way_in_opens_them():
    sequence = open_sequence("synth:tabletop?width=64&frames=10&objects=3", stride=4)
    assert len(sequence) == 3 and sequence.name == "synth:tabletop?objects=3&frames=10&width=64"
    assert sequence[2].color.shape == (48, 64, 3)

"""The ledger keeps records in order, saves them and reads them back."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError
from thingmap.mapper.estimation import ledger as ledger_module
from thingmap.mapper.estimation.ledger import SCHEMA, Ledger
from thingmap.mapper.estimation.records import (
    KINDS,
    Box,
    DepthCentre,
    DropLoop,
    DropMeasurement,
    Gauge,
    Look,
    Loop,
    Merge,
    Motion,
    NewLandmark,
    Retire,
    Revive,
    ScanMatch,
    Scores,
    Site,
    Up,
    UpPrior,
    Visual,
)


def one_of_each(rng: np.random.Generator) -> list:
    """One record of every kind."""
    T = np.eye(4)
    T[:3, 3] = rng.normal(size=3)
    return [
        Gauge(T, rng.random(6)),
        UpPrior(rng.normal(size=3), 0.6),
        Up(0, rng.normal(size=3), 0.06),
        Motion(0, 1, T, rng.random((6, 6))),
        Visual(0, 1, T, rng.random((6, 6))),
        Loop(0, 1, T, rng.random((6, 6))),
        DropLoop(5),
        NewLandmark(3, rng.normal(size=3), rng.normal(size=3)),
        Site(3, rng.normal(size=3), rng.random((3, 3))),
        DepthCentre(1, 3, rng.normal(size=3), 0.02, 0.05, 0.75),
        Box(1, 3, 100.0 * rng.random(4), np.array([True, False, True, True]), 3.5, 4),
        Look(1, 3, 0.8, 0.0, -0.25, rng.random(5, dtype=np.float32), -1.5),
        Scores(1, 3, np.array([0.5, np.nan, 0.1], dtype=np.float32), 0.3, 0.9, 2),
        Merge(3, 4),
        Retire(3),
        ScanMatch(0, 1, T, rng.random((6, 6))),
        DropMeasurement(9),
        Revive(3, rng.normal(size=3), rng.normal(size=3)),
    ]


def assert_same(a, b) -> None:
    assert type(a) is type(b)
    for f in fields(a):
        x, y = getattr(a, f.name), getattr(b, f.name)
        np.testing.assert_array_equal(x, y)
        assert np.asarray(x).dtype == np.asarray(y).dtype and np.shape(x) == np.shape(y)


def test_every_kind_of_record_is_known():
    assert {type(record) for record in one_of_each(np.random.default_rng(0))} == set(KINDS)
    assert set(ledger_module.Record.__args__) == set(KINDS)


def test_records_are_numbered_in_the_order_in_which_they_were_made():
    ledger, records = Ledger(), one_of_each(np.random.default_rng(0))
    assert [ledger.append(record) for record in records] == list(range(len(records)))
    assert len(ledger) == len(records)
    assert ledger[3] is records[3] and list(ledger) == records


@given(order=st.lists(st.integers(0, len(KINDS) - 1), max_size=40), seed=st.integers(0, 100))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_was_saved_is_loaded_in_the_same_order(tmp_path, order, seed):
    rng = np.random.default_rng(seed)
    ledger = Ledger()
    for kind in order:
        ledger.append(one_of_each(rng)[kind])
    ledger.save(tmp_path / "ledger.npz", {"classes": ["cup", "bowl"], "intrinsics": {"fx": 525.0}})
    loaded, meta = Ledger.load(tmp_path / "ledger.npz")
    assert meta == {"schema": SCHEMA, "classes": ["cup", "bowl"], "intrinsics": {"fx": 525.0}}
    assert len(loaded) == len(ledger)
    for a, b in zip(ledger, loaded, strict=True):
        assert_same(a, b)


def before_parts(path: Path) -> None:
    """Makes a file what it was before detections had parts."""
    with np.load(path) as file:
        later = ("Box/part", "Look/visible", "Look/depth", "Scores/part")
        arrays = {name: file[name] for name in file.files if name not in later}
    arrays["meta"] = meta(schema="thingmap-ledger/1")
    np.savez(path, **arrays)


def test_a_ledger_from_before_parts_tells_of_whole_objects(tmp_path):
    ledger, path = Ledger(), tmp_path / "ledger.npz"
    for record in one_of_each(np.random.default_rng(0)):
        ledger.append(record)
    ledger.save(path)
    before_parts(path)
    loaded, _ = Ledger.load(path)
    plain = {Box: {"part": 0}, Look: {"visible": np.ones(5, np.float32), "depth": 0.0}, Scores: {"part": 0}}
    assert len(loaded) == len(ledger)
    for old, new in zip(loaded, ledger, strict=True):
        assert_same(old, replace(new, **plain.get(type(new), {})))


@pytest.mark.parametrize("schema", ["thingmap-ledger/1", "thingmap-ledger/2", "thingmap-ledger/3"])
def test_ledgers_of_all_schemas_are_read(tmp_path, schema):
    ledger, path = Ledger(), tmp_path / "ledger.npz"
    for record in one_of_each(np.random.default_rng(0)):
        if not isinstance(record, Loop | DropLoop):  # of 3
            ledger.append(record)
    ledger.save(path)
    with np.load(path) as file:
        np.savez(path, **{**file, "meta": meta(schema=schema)})
    for old, new in zip(Ledger.load(path)[0], ledger, strict=True):
        assert_same(old, new)


def test_what_is_not_said_of_a_look_is_full_visibility_and_no_word_from_depth():
    look = Look(1, 3, 0.8, 0.0, -0.25)
    assert look.visible.tolist() == [1.0] * 5 and look.visible.dtype == np.float32 and look.depth == 0.0


def test_a_ledger_is_saved_under_the_very_name_that_was_given(tmp_path):
    Ledger().save(tmp_path / "session")
    assert [path.name for path in tmp_path.iterdir()] == ["session"]


def test_what_can_be_read_needs_no_pickle(tmp_path):
    ledger = Ledger()
    for record in one_of_each(np.random.default_rng(0)):
        ledger.append(record)
    ledger.save(tmp_path / "ledger.npz")
    with np.load(tmp_path / "ledger.npz", allow_pickle=False) as file:
        assert all(file[name].dtype != object for name in file.files)


def write(path: Path, **arrays) -> Path:
    np.savez(path, **arrays)
    return path


def meta(**content) -> np.ndarray:
    return np.array(json.dumps(content))


def test_files_that_are_no_ledger_are_refused_by_name(tmp_path):
    path = tmp_path / "ledger.npz"
    for make in (
        lambda: None,
        lambda: path.write_text("hello"),
        lambda: write(path, x=np.zeros(3)),
        lambda: write(path, meta=np.array("no json")),
        lambda: write(path, meta=meta(schema="thingmap-ledger/99")),
        lambda: write(path, meta=np.array([{"schema": SCHEMA}], dtype=object)),
    ):
        make()
        with pytest.raises(InputError, match=r"ledger\.npz"):
            Ledger.load(path)


def break_in_two(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip_bytes(path: Path) -> None:
    content = bytearray(path.read_bytes())
    for i in range(200, len(content) // 2, 50):
        content[i] ^= 0xFF
    path.write_bytes(bytes(content))


@pytest.mark.parametrize(
    "damage",
    [
        break_in_two,
        flip_bytes,
        lambda path: path.write_bytes(b""),
        lambda path: np.save(path.open("wb"), np.zeros(3)),
        lambda path: write(path, meta=np.array("[1]")),
        lambda path: write(path, meta=meta(schema=SCHEMA), **{"Retire/number": np.array([0])}),
        lambda path: write(
            path, meta=meta(schema=SCHEMA), **{"Retire/number": np.arange(2), "Retire/landmark": np.array([0])}
        ),
    ],
    ids=["truncated", "corrupted", "empty", "npy", "meta_list", "missing_column", "short_column"],
)
def test_damaged_ledgers_are_refused_by_name(tmp_path, damage):
    ledger, path = Ledger(), tmp_path / "ledger.npz"
    for record in one_of_each(np.random.default_rng(0)):
        ledger.append(record)
    ledger.save(path)
    damage(path)
    with pytest.raises(InputError, match=r"ledger\.npz"):
        Ledger.load(path)

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError
from thingmap.mapper.config import MapperConfig, OdometrySource
from thingmap.mapper.config_file import dump_config, load_config


class Mode(Enum):
    FAST = "fast"
    EXACT = "exact"


@dataclass(frozen=True)
class Range:
    low: float = 0.3
    high: float = 3.5

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError(f"low {self.low} is above high {self.high}")


@dataclass(frozen=True)
class Config:
    seed: int = 0
    robust: bool = True
    name: str = "a"
    mode: Mode = Mode.FAST
    level: Literal["low", "high"] = "low"
    prior: Path | None = None
    limit: float | None = None
    either: float | str = "auto"
    sigma: tuple[float, float] = (0.1, 0.2)
    names: tuple[str, ...] = ()
    weights: dict[str, float] = field(default_factory=dict)
    extra: Range | None = None
    odometry: Range = field(default_factory=lambda: Range(0.5, 4.0))
    ranges: tuple[Range, ...] = ()


@pytest.fixture
def load(tmp_path):
    def load_text(text: str, cls: type = Config):
        file = tmp_path / "config.yaml"
        file.write_text(text, encoding="utf-8")
        return load_config(file, cls)

    return load_text


def test_no_file_and_an_empty_file_are_the_defaults(load):
    assert load_config(None, Config) == Config()
    assert load("") == Config() == load("# nothing\n")


def test_given_keys_override_and_the_others_stay(load):
    config = load("seed: 4\nodometry: {high: 2}\nmode: exact\nprior: a/b.yaml\nsigma: [1, 2.5]\nlevel: high\n")
    assert config.seed == 4 and config.odometry == Range(0.5, 2.0)  # `low` is the field's default, not the class's
    assert config.mode is Mode.EXACT and config.prior == Path("a/b.yaml") and config.sigma == (1.0, 2.5)
    assert config.name == "a" and config.level == "high"
    assert load("extra: {high: 1.0}").extra == Range(0.3, 1.0)
    assert load("ranges: [{low: 0}, {}]").ranges == (Range(0.0, 3.5), Range())


def test_numbers_as_people_write_them(load):
    assert load("limit: 1e-3").limit == 0.001  # text to YAML 1.1
    assert load("limit: 5").limit == 5.0 and isinstance(load("limit: 5").limit, float)
    assert load("limit: null").limit is None
    assert load("either: 3").either == 3.0 and load("either: '3'").either == "3"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sede: 1", "a known key at the top, found sede; did you mean seed?"),
        ("odometry: {hihg: 1}", "a known key at odometry, found odometry.hihg; did you mean odometry.high?"),
        ("zzz: 1", "found zzz; the keys there are seed, robust"),
        ("seed: many", r"a whole number at seed, found 'many' \(str\); give seed a whole number"),
        ("seed: 1.5", r"a whole number at seed, found 1.5 \(float\)"),
        ("seed: true", r"a whole number at seed, found True \(bool\)"),
        ("seed:", "a whole number at seed, found nothing"),
        ("robust: 1", "true or false at robust"),
        ("robust: 'yes'", "true or false at robust"),
        ("limit: far", r"a number or nothing \(null\) at limit, found 'far'"),
        ("limit: '0.5'", "a number or nothing"),
        ("name: 3", r"text at name, found 3 \(int\)"),
        ("prior: [1]", "a path or nothing"),
        ("mode: slow", "one of fast, exact at mode, found 'slow'"),
        ("level: 3", "one of low, high at level"),
        ("sigma: [1]", r"a list of 2 values at sigma, found \[1\]"),
        ("sigma: [1, x]", r"a number at sigma.1, found 'x'"),
        ("sigma: 3", "a list at sigma"),
        ("names: [a, 3]", "text at names.1"),
        ("weights: {cup: heavy}", "a number at weights.cup"),
        ("weights: [1]", "a mapping of keys to values at weights"),
        ("odometry: 3", "a mapping of keys to values at odometry, found 3"),
        ("odometry: {low: 9}", "valid values at odometry, found low 9.0 is above high 4.0"),
        ("ranges: [{low: 1}, {lo: 1}]", "found ranges.1.lo; did you mean ranges.1.low?"),
        ("extra: {low: [1]}", "a number at extra.low"),
        ("[1, 2]", "a mapping of keys to values at the top"),
        ("seed: 1\nseed: 2", "expected YAML, found seed is given twice at line 2"),
        ("odometry: {low: 1, low: 2}", "low is given twice at line 1"),
        ("a: [", "expected YAML"),
        ("? [a]\n: 1\n? [a]\n: 2", "expected YAML"),
        ("limit: 1" + 400 * "0", "a number or nothing"),
        ("a: !!python/object:os.system x", "expected YAML"),
    ],
)
def test_every_mistake_names_the_file_and_the_key(load, tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        load(text)
    assert str(caught.value).startswith(str(tmp_path / "config.yaml"))
    assert "\n" not in str(caught.value)


def test_an_absent_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"absent\.yaml: expected a configuration file, found no such file"):
        load_config(tmp_path / "absent.yaml", Config)
    with pytest.raises(InputError, match="is a directory"):
        load_config(tmp_path, Config)


def test_a_key_without_a_default_must_be_given(load):
    @dataclass(frozen=True)
    class Strict:
        rate: float
        name: str = "a"

    assert load("rate: 2", Strict) == Strict(2.0)
    with pytest.raises(InputError, match="a value at rate, found no such key; add rate"):
        load("name: b", Strict)


def test_a_type_that_yaml_cannot_hold_is_our_own_mistake(load):
    @dataclass(frozen=True)
    class Odd:
        matrix: np.ndarray = field(default_factory=lambda: np.eye(2))

    with pytest.raises(TypeError, match="ndarray"):
        load("matrix: [1]", Odd)


texts = st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=15)
numbers = st.floats(allow_nan=False)
ranges = st.tuples(numbers, numbers).map(lambda pair: Range(min(pair), max(pair)))
configs = st.builds(
    Config,
    seed=st.integers(-(2**70), 2**70),
    robust=st.booleans(),
    name=texts,
    mode=st.sampled_from(Mode),
    level=st.sampled_from(("low", "high")),
    prior=st.none() | st.sampled_from(["a", "../x y.yaml", "/a/1"]).map(Path),
    limit=st.none() | numbers,
    either=numbers | texts,
    sigma=st.tuples(numbers, numbers),
    names=st.lists(texts, max_size=4).map(tuple),
    weights=st.dictionaries(texts, numbers, max_size=3),
    extra=st.none() | ranges,
    odometry=ranges,
    ranges=st.lists(ranges, max_size=3).map(tuple),
)


@given(configs)
def test_what_is_dumped_loads_back_equal(tmp_path_factory, config):
    file = tmp_path_factory.mktemp("config") / "config.yaml"
    file.write_text(dump_config(config), encoding="utf-8")
    assert load_config(file, Config) == config


def test_numpy_values_are_dumped_as_plain_numbers():
    assert "limit: 0.5\n" in dump_config(Config(limit=np.float64(0.5)))


def test_the_mappers_own_configuration(load):
    assert load(dump_config(MapperConfig()), MapperConfig) == MapperConfig()
    changed = load("odometry: {source: poses, max_range: 2.0}", MapperConfig)
    assert changed.odometry.source is OdometrySource.POSES
    assert changed.odometry.voxel_size == MapperConfig().odometry.voxel_size
    with pytest.raises(InputError, match=r"did you mean odometry\.max_range\?"):
        load("odometry: {maxrange: 2.0}", MapperConfig)

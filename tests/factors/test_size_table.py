"""What people write in size files, and what they are told when it is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from thingmap.datasets.errors import InputError
from thingmap.factors.size_prior import BUILT_IN
from thingmap.factors.size_table import plain_name, read_size_table


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "sizes.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_all_fields_are_read(tmp_path):
    table = read_size_table(
        written(
            tmp_path,
            "Fire_Extinguisher:\n  size: [0.16, 0.14, 0.5]\n  spread: [0.1, 0.2, 0.3]\n  footprint: round\n"
            "  resting: {height: 3, length: 1}\n  aliases: [Extinguisher]\n  source: the one in our lab\n",
        )
    )
    entry = table["fire extinguisher"]
    assert entry.size == (0.16, 0.14, 0.5) and entry.spread == (0.1, 0.2, 0.3) and entry.round
    assert entry.resting == (0.25, 0.0, 0.75) and entry.aliases == ("extinguisher",)
    assert entry.source == "the one in our lab"


def test_size_alone_is_enough(tmp_path):
    entry = read_size_table(written(tmp_path, "box: {size: [1, 1, 2]}"))["box"]
    assert entry.spread == (0.25, 0.25, 0.25) and not entry.round and entry.resting == (0.0, 0.0, 1.0)


def test_any_rests_on_every_side_alike(tmp_path):
    entry = read_size_table(written(tmp_path, "box: {size: [1, 1, 2], resting: any}"))["box"]
    assert entry.resting == pytest.approx((1 / 3, 1 / 3, 1 / 3))


def test_names_compare_without_case_and_punctuation():
    assert plain_name("  Coffee_Mug") == plain_name("coffee-mug") == "coffee mug"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("box: {size: [1, 1", "sizes.yaml"),
        ("", "found nothing"),
        ("- box", "mapping"),
        ("box: 3", "'box'"),
        ("box: {}", "no size"),
        ("box: {size: 1}", "[length, width, height]"),
        ("box: {size: [1, 1]}", "[length, width, height]"),
        ("box: {size: [1, 1, -2]}", "-2"),
        ("box: {size: [1, 1, 1500]}", "1500"),
        ("box: {size: [1, 1, .nan]}", "nan"),
        ("box: {size: [1, 1, true]}", "True"),
        ("box: {size: [1, 1, 10 cm]}", "10 cm"),
        ("box: {size: [1, 1, 1], spread: 0}", "spread"),
        ("box: {size: [1, 1, 1], spread: wide}", "wide"),
        ("box: {size: [1, 1, 1], footprint: oval}", "oval"),
        ("box: {size: [1, 1, 1], resting: upside down}", "upside down"),
        ("box: {size: [1, 1, 1], resting: {height: -1}}", "-1"),
        ("box: {size: [1, 1, 1], resting: {height: 0}}", "zero"),
        ("box: {size: [1, 1, 1], resting: {depth: 1}}", "depth"),
        ("box: {size: [1, 1, 1], aliases: crate}", "crate"),
        ("box: {size: [1, 1, 1], colour: red}", "colour"),
        ("box: {size: [1, 1, 1]}\nbox: {size: [2, 2, 2]}", "twice"),
        ("box: {size: [1, 1, 1]}\nBox: {size: [2, 2, 2]}", "another class"),
        ("box: {size: [1, 1, 1], aliases: [crate]}\ncrate: {size: [2, 2, 2]}", "another class"),
    ],
)
def test_mistakes_are_named(tmp_path, text, says):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as error:
        read_size_table(path)
    message = str(error.value)
    assert says in message and str(path) in message and "\n" not in message


def test_a_missing_file_and_a_binary_one_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_size_table(tmp_path / "absent.yaml")
    (tmp_path / "picture.yaml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(InputError, match="picture"):
        read_size_table(tmp_path / "picture.yaml")


def test_every_built_in_class_says_where_its_size_is_from():
    table = read_size_table(BUILT_IN)
    for name, entry in table.items():
        assert len(entry.source) >= 8, name
        assert entry.size[0] >= entry.size[1], f"{name}: length is the longer side of the footprint"
        assert not entry.round or entry.size[0] == entry.size[1], name

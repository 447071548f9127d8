"""COCO's classes, and names from files."""

from __future__ import annotations

from pathlib import Path

import pytest

from thingmap.datasets.errors import InputError
from thingmap.detectors.class_names import read_class_names
from thingmap.detectors.coco import COCO_80, COCO_CATEGORIES, COCO_CATEGORY_IDS


def test_coco_numbers_that_are_known_by_heart():
    assert len(COCO_80) == len(set(COCO_80)) == len(COCO_CATEGORY_IDS) == 80
    known = {"person": (0, 1), "cup": (41, 47), "chair": (56, 62), "book": (73, 84), "toothbrush": (79, 90)}
    for name, (position, category) in known.items():
        assert COCO_80[position] == name and COCO_CATEGORY_IDS[position] == category
    assert COCO_CATEGORIES[62] == {"id": 72, "name": "tv"}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("names.txt", "cup\n chair \nwine glass\n\n"),
        ("coco.names", "cup\r\nchair\r\nwine glass"),
        ("data.yaml", "path: .\nnc: 3\nnames: [cup, chair, wine glass]\n"),
        ("data.yml", "names:\n  0: cup\n  2: wine glass\n  1: chair\n"),
    ],
)
def test_names_from_a_file(tmp_path: Path, name: str, text: str):
    path = tmp_path / name
    path.write_bytes(text.encode())
    assert read_class_names(path) == ("cup", "chair", "wine glass")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", b"", "no names"),
        ("a.txt", b"cup\n\nchair", "an empty name"),
        ("a.txt", b"cup\ncup", "'cup' twice"),
        ("a.txt", b"\xff\xfe\x00", "can't decode"),
        ("a.yaml", b"nc: 3", "no `names:`"),
        ("a.yaml", b"names: {1: cup, 2: chair}", r"class numbers \[1, 2\] instead of 0..1"),
        ("a.yaml", b"names: [", "invalid YAML"),
    ],
)
def test_files_without_proper_names(tmp_path: Path, name: str, content: bytes, message: str):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as error:
        read_class_names(path)
    assert error.value.path == path


def test_missing_file(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        read_class_names(tmp_path / "names.txt")
    with pytest.raises(InputError):
        read_class_names(tmp_path)

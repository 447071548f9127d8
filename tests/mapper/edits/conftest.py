"""A folder with a small map that may be edited."""

from __future__ import annotations

from pathlib import Path

import pytest

from thingmap.mapper.map.store import OutputFolder


@pytest.fixture
def things(make_thing):
    """Two cups 4 cm apart, a bowl and a book, well apart."""
    return (
        make_thing(1, "cup", 0.9, position=[0.0, 0.0, 1.0]),
        make_thing(2, "cup", 0.8, position=[0.04, 0.0, 1.0]),
        make_thing(3, "bowl", 0.7, position=[1.0, 0.0, 1.0], existence=0.9),
        make_thing(4, "book", 0.95, position=[0.0, 1.0, 1.0]),
    )


@pytest.fixture
def out(tmp_path, things, make_map) -> Path:
    folder = OutputFolder.create(tmp_path / "out")
    folder.write_map(make_map(*things))
    return folder.path

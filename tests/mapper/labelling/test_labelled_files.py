"""What labelling writes into the map's file: points, and sizes that points have changed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from instance_blocks import CLASSES, NO_BOXES, block, make_map, make_thing, make_voxels

from thingmap.mapper.labelling.instances import find_instances
from thingmap.mapper.labelling.labelled_files import read_volumes, write_labelling
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder

SHORT, FITTING = (0.07, 0.08, 0.08), (0.08, 0.08, 0.08)


@pytest.fixture
def folder(tmp_path: Path) -> OutputFolder:
    """A cup whose volume is too short along x, and a bowl that is as large as its points."""
    folder = OutputFolder.create(tmp_path / "out")
    cup = make_thing(1, "cup", (0.06, 0.04, 0.04), SHORT, size_std=0.005)
    bowl = make_thing(2, "bowl", (0.54, 0.04, 0.04), FITTING, size_std=0.005)
    make_map([cup, bowl]).save(folder.map_file)
    return folder


def label(folder: OutputFolder, cup_cells=(13, 8, 8), config=NO_BOXES) -> ObjectMap:
    """What the map is once the blocks are labelled; as the job does it."""
    object_map = read_volumes(folder)
    voxels, labels, _ = make_voxels([(block((0, 0, 0), cup_cells), 0), (block((50, 0, 0), (8, 8, 8)), 1)])
    instances = find_instances(voxels, labels, object_map, config)
    write_labelling(folder, object_map, voxels, labels, instances)
    return ObjectMap.load(folder.path)


def sizes(folder: OutputFolder) -> list[dict]:
    things = json.loads(folder.map_file.read_text())["things"]
    return [{name: thing[name] for name in ("size", "size_std", "volume") if name in thing} for thing in things]


def test_a_thing_takes_the_size_that_its_points_suggest(folder):
    labelled = label(folder)
    cup, bowl = labelled.things
    assert 0.075 < cup.size[0] < 0.13 and cup.size[1:].tolist() == [0.08, 0.08]
    assert cup.size_std[0] > 2 * 0.005
    assert cup.volume is not None and cup.volume.size.tolist() == list(SHORT)
    assert cup.volume.size_std.tolist() == [0.005] * 3
    assert bowl.size.tolist() == list(FITTING) and bowl.volume is None
    assert set(sizes(folder)[1]) == {"size", "size_std"}


def test_a_box_takes_its_place_from_its_points(folder):
    cup, _ = label(folder, config=None).things
    assert cup.volume is not None and cup.volume.position.tolist() == [0.06, 0.04, 0.04]
    assert cup.position == pytest.approx([0.065, 0.04, 0.04], abs=0.004)
    assert np.sort(cup.size) == pytest.approx([0.07, 0.07, 0.12], abs=0.006)
    again = read_volumes(folder).things[0]
    assert again.position.tolist() == [0.06, 0.04, 0.04] and again.yaw == 0.0 and again.volume is None


def test_labelled_again_it_is_the_same(folder):
    label(folder)
    before = folder.map_file.read_bytes()
    assert read_volumes(folder).things[0].size.tolist() == list(SHORT)
    label(folder)
    assert folder.map_file.read_bytes() == before


def test_points_that_fit_give_the_volume_its_own_size_back(folder):
    before = sizes(folder)
    label(folder)
    assert sizes(folder) != before
    label(folder, cup_cells=(8, 8, 8))
    assert sizes(folder) == before


def test_the_map_is_read_as_it_was_estimated(folder):
    assert read_volumes(folder).classes == CLASSES
    assert np.array_equal(read_volumes(folder).things[0].size, SHORT)

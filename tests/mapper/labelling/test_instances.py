"""Labelled voxels as points of things, on blocks of voxels that a person can count."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from instance_blocks import NO_BOXES, block, make_map, make_thing, make_voxels
from label_runs import SYNTH, labelled

from thingmap.datasets.errors import UserError
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.evaluation.inputs.build_case import build_case
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.labelling.instance_config import InstanceConfig
from thingmap.mapper.labelling.instances import find_instances, segments_of
from thingmap.mapper.map.boxes import inside_box

CUP, BOWL = 0, 1


def found(parts, things, config=NO_BOXES):
    """Instances of blocks (cells, label), and the rows of each block in them."""
    voxels, labels, rows = make_voxels(parts)
    return find_instances(voxels, labels, make_map(things), config), rows


def test_each_thing_owns_the_segment_in_its_volume():
    cup, bowl, table = block((0, 0, 0), (8, 8, 8)), block((20, 0, 0), (12, 12, 6)), block((0, 0, -2), (40, 20, 1))
    things = [make_thing(1, "bowl", (0.26, 0.06, 0.03), (0.12, 0.12, 0.06)), make_thing(2, "cup", (0.04,) * 3)]
    result, rows = found([(cup, CUP), (bowl, BOWL), (table, NO_OBJECT)], things)
    assert [thing.points for thing in result.things] == [12 * 12 * 6, 8**3]
    assert [set(result.number[r].tolist()) for r in rows] == [{2}, {1}, {0}]
    assert result.loose == ()
    for thing in result.things:
        assert thing.size is not None and not thing.size.disagrees.any() and thing.size.estimate is None


def test_one_segment_of_two_things_is_split_between_their_volumes():
    both = block((0, 0, 0), (16, 8, 8))  # two cups that touch
    things = [make_thing(1, "cup", (0.04, 0.04, 0.04)), make_thing(2, "cup", (0.12, 0.04, 0.04))]
    result, (rows,) = found([(both, CUP)], things)
    assert np.array_equal(result.number[rows], np.where(both[:, 0] < 8, 1, 2))


def test_what_nobody_explains_is_loose():
    near, far = block((0, 0, 0), (8, 8, 8)), block((40, 0, 0), (5, 4, 3))
    speck = block((60, 0, 0), (2, 1, 1))
    result, rows = found([(near, CUP), (far, BOWL), (speck, CUP)], [make_thing(1, "cup", (0.04,) * 3)])
    (loose,) = result.loose  # a speck is not worth a word
    assert (loose.label, loose.points) == ("bowl", 60)
    assert loose.position == pytest.approx([0.425, 0.02, 0.015], abs=0.006)
    assert not result.number[rows[1]].any() and not result.number[rows[2]].any()


def test_things_without_points_are_there_with_none():
    result, _ = found([(block((0, 0, 0), (8, 8, 8)), CUP)], [make_thing(1, "cup", (0.04, 0.04, 1.0))])
    assert [(thing.points, thing.size) for thing in result.things] == [(0, None)]
    assert [segment.points for segment in result.loose] == [512]
    result, _ = found([], [make_thing(1, "cup", (0.0, 0.0, 0.0))])
    assert [thing.points for thing in result.things] == [0] and result.loose == ()


@pytest.mark.parametrize(("posterior", "own"), [({"bowl": 0.7, "cup": 0.3}, 512), ({"bowl": 0.95, "cup": 0.05}, 0)])
def test_a_thing_owns_classes_that_it_may_be(posterior, own):
    thing = make_thing(1, "bowl", (0.04,) * 3, posterior=posterior)
    result, _ = found([(block((0, 0, 0), (8, 8, 8)), CUP)], [thing])
    assert result.things[0].points == own


def test_a_thing_that_hardly_exists_takes_nothing_from_another():
    ghost = make_thing(1, "cup", (0.04,) * 3, existence=0.05)
    result, _ = found([(block((0, 0, 0), (8, 8, 8)), CUP)], [ghost, make_thing(2, "cup", (0.04,) * 3)])
    assert [thing.points for thing in result.things] == [0, 512]


def test_a_label_that_leaks_far_over_the_table_is_not_the_things():
    cup, leak = block((0, 0, 0), (8, 8, 8)), block((8, 0, 0), (30, 2, 1))
    result, rows = found([(cup, CUP), (leak, CUP)], [make_thing(1, "cup", (0.04,) * 3)])
    assert (result.number[rows[0]] == 1).all()
    reach = 4.0  # half of 8 cm, in voxels
    assert np.array_equal(result.number[rows[1]] == 1, leak[:, 0] + 0.5 <= 8 + reach)


def test_boxes_are_turned():
    """A block along the diagonal of x and y, and its box, turned by 45 degrees."""
    cells = block((-20, -20, 0), (40, 40, 4))
    along, across = cells[:, :2].sum(axis=1) / np.sqrt(2.0), (cells[:, 1] - cells[:, 0]) / np.sqrt(2.0)
    cells = cells[(np.abs(along) < 10) & (np.abs(across) < 3)]
    thing = make_thing(1, "cup", (0.0, 0.005, 0.02), (0.2, 0.06, 0.04), yaw=np.pi / 4)
    result, _ = found([(cells, CUP)], [thing])
    size = result.things[0].size
    assert result.things[0].points == len(cells) and size is not None and not size.disagrees.any()
    assert size.extent == pytest.approx([0.19, 0.055, 0.03], abs=0.012)


def test_a_volume_too_small_is_grown_by_its_points():
    thing = make_thing(1, "cup", (0.06, 0.04, 0.04), (0.07, 0.08, 0.08), size_std=0.005)
    result, _ = found([(block((0, 0, 0), (13, 8, 8)), CUP)], [thing])
    size = result.things[0].size
    assert size is not None and size.disagrees.tolist() == [True, False, False]
    assert size.extent[0] == pytest.approx(0.12, abs=0.011)
    assert size.estimate is not None and size.std is not None
    assert 0.07 < size.estimate[0] < size.extent[0] and size.std[0] > 2 * 0.005
    assert size.estimate[1:].tolist() == [0.08, 0.08] and size.std[1:].tolist() == [0.005, 0.005]


def test_points_that_fall_short_count_less_than_points_beyond():
    def estimate(width, std=0.02):
        thing = make_thing(1, "cup", (width / 200.0, 0.04, 0.04), (0.12, 0.08, 0.08), size_std=std)
        size = found([(block((0, 0, 0), (width, 8, 8)), CUP)], [thing])[0].things[0].size
        assert size is not None and size.disagrees.tolist() == [True, False, False]
        return abs(size.estimate[0] - 0.12) / abs(size.extent[0] - 0.12)

    assert estimate(5) < 0.6 < estimate(19)  # the share of the difference that is believed


def shell(size) -> np.ndarray:
    """Cells of the sides and the top of a block that stands on z = 0."""
    cells = block((0, 0, 0), size)
    outside = (cells[:, :2] == 0) | (cells[:, :2] == np.array(size[:2]) - 1)
    return cells[outside.any(axis=1) | (cells[:, 2] == size[2] - 1)]


@pytest.mark.parametrize("volume", [(0.2, 0.2, 0.25), (0.08, 0.21, 0.26)])
def test_the_box_that_points_lie_on_is_the_things(volume):
    thing = make_thing(1, "cup", (0.05, 0.1, 0.12), volume)
    result, _ = found([(shell((6, 20, 25)), CUP)], [thing], None)
    (one,) = result.things
    assert one.box is not None and one.size is not None and one.size.estimate is not None
    assert np.sort(one.size.estimate) == pytest.approx([0.05, 0.19, 0.24], abs=0.006)  # between centres of cells
    assert one.box.center == pytest.approx([0.03, 0.1, 0.125], abs=0.006)
    wide = np.argmin(one.size.extent)
    assert one.size.disagrees[wide] == (volume[0] == 0.2)


@pytest.mark.parametrize("volume", [(0.6, 0.6, 0.6), (0.04, 0.1, 0.1)])
def test_a_box_of_quite_another_size_is_another_things(volume):
    result, _ = found([(shell((6, 20, 25)), CUP)], [make_thing(1, "cup", (0.03, 0.1, 0.12), volume)], None)
    assert result.things[0].box is None


def test_few_points_say_nothing_of_a_size():
    result, _ = found([(block((0, 0, 0), (2, 2, 2)), CUP)], [make_thing(1, "cup", (0.01, 0.01, 0.01), (0.08,) * 3)])
    assert result.things[0].points == 8 and result.things[0].size is None


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_segments_are_what_walking_finds(seed):
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(0, 5, (40, 3)).astype(np.int32), axis=0)
    label = rng.integers(0, 2, len(cells))
    segment = segments_of(cells, label)
    close = (np.abs(cells[:, None] - cells[None]).max(axis=2) <= 1) & (label[:, None] == label[None])
    reached = np.linalg.matrix_power(close.astype(float), len(cells)) > 0
    assert np.array_equal(segment[:, None] == segment[None], reached)


@pytest.mark.parametrize("wrong", [{"least_belief": 0.0}, {"extent": 50.0}, {"least_points": 0}, {"share": -0.1}])
def test_numbers_out_of_range_are_refused(wrong):
    with pytest.raises(UserError):
        InstanceConfig(**wrong)


def test_things_of_a_run_own_the_points_of_their_objects(tmp_path_factory):
    out, report = labelled(tmp_path_factory.getbasetemp())
    case = build_case(load_run(out), open_truth(SYNTH))
    object_map = case.run.object_map
    assert [thing.points for thing in object_map.things] == [thing.points for thing in report.instances.things]
    owned = checked = 0
    for placed in case.things:
        points = case.alignment.apply(object_map.points(placed.thing))
        owned += len(points)
        true = min(case.truth.objects, key=lambda true: np.linalg.norm(true.position - placed.position))
        if true.label != placed.label or np.linalg.norm(true.position - placed.position) > 0.08:
            continue  # not an object, and labels that agree with the map's mistake
        around = true.size + 0.04  # a voxel and a centimetre at each side
        inside = inside_box(points, true.position, around, true.yaw, case.R_truth_upright)
        assert len(points) > 20 and inside.mean() > 0.9, (placed.thing.id, placed.label, len(points), inside.mean())
        checked += 1
    assert checked >= 8
    assert owned > 0.9 * (report.voxels - report.points["background"])  # the rest is a false box of a few views

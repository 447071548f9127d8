from itertools import pairwise

import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.object_views.object_view import ObjectViews, ViewEntry
from thingmap.detectors.training.selection import select_views, split_frames


def views(**instances: int) -> ObjectViews:
    """So many views of each instance `label_number`."""

    def read():
        raise AssertionError("selection must not read views")

    return ObjectViews(
        ViewEntry(name.split("_")[0], name, f"{name}-{k}", read)
        for name, count in instances.items()
        for k in range(count)
    )


def test_whole_instances_are_held_out_where_there_are_enough():
    source = views(mug_1=20, mug_2=20, mug_3=20, mug_4=20, can_1=30)
    chosen = select_views(source, share=0.25)
    learned, held_out = ({source.entries[k].instance for k in part} for part in (chosen.learned, chosen.held_out))
    assert chosen.instances == {"can": 0, "mug": 1}
    assert learned & held_out == {"can_1"}
    assert not set(chosen.learned) & set(chosen.held_out)
    assert len(chosen.learned) + len(chosen.held_out) == len(source)


def test_an_instance_with_most_of_the_views_is_not_given_away():
    source = views(mug_1=90, mug_2=10, mug_3=10)
    for seed in range(8):
        chosen = select_views(source, seed=seed)
        assert chosen.instances == {"mug": 1} and len(chosen.held_out) == 10


def test_few_views_are_learned_from_and_calibrated_with():
    chosen = select_views(views(mug_1=2))
    assert chosen.learned == chosen.held_out == (0, 1)


def test_not_more_views_than_asked_for_and_from_all_over():
    chosen = select_views(views(mug_1=1000), most=30, most_held_out=7)
    assert len(chosen.learned) == 30 and len(chosen.held_out) == 7
    assert chosen.learned[0] < 50 and chosen.learned[-1] > 900


def test_the_seed_decides():
    source = views(**{f"mug_{k}": 4 for k in range(12)})
    first, again, other = (select_views(source, seed=seed).held_out for seed in (1, 1, 2))
    assert first == again != other


def test_no_views_are_a_mistake():
    with pytest.raises(UserError, match="no views of objects"):
        select_views(views())


def test_frames_are_divided_in_blocks():
    learned, held_out = split_frames(100, 0.2)
    assert sorted(learned + held_out) == list(range(100)) and len(held_out) == 20
    assert sum(b - a > 1 for a, b in pairwise(held_out)) == 3
    assert split_frames(3, 0.2) == ((0, 1, 2), (0, 1, 2))

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.mapper.estimation.view_log import Verdict, ViewNote
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.views_file import ThingViews


def note(keyframe, verdict, score=0.8):
    found = verdict is Verdict.SUPPORTED
    return ViewNote(
        keyframe=keyframe,
        stamp=0.5 * keyframe,
        frame=f"frame-{10 * keyframe:06d}",
        visible=np.full(5, 0.75),
        score=score if found else np.nan,
        part=0 if found else -1,
        class_id=0 if found else -1,
        log_ratio=np.array([1.0, -1.0, 0.0]),
        weight=1.0,
        verdict=verdict,
    )


@pytest.fixture
def seen(make_thing):
    notes = (note(1, Verdict.SUPPORTED), note(3, Verdict.SUPPORTED, 0.6), note(4, Verdict.MISSED))
    views = ThingViews(("cup", "bowl", "book"), notes, dict.fromkeys(Verdict, 0))
    return make_thing(1, "cup", 0.9, views=views, last_seen=1.5, position=[0.0, 0.0, 2.0])


def test_the_last_view_that_showed_it(seen, make_thing, make_map, tmp_path):
    out = OutputFolder.create(tmp_path / "out")
    out.write_map(make_map(seen, make_thing(2, "cup", 0.8, last_seen=9.0)))
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 0, 3] = np.arange(5)
    out.write_trajectory(0.5 * np.arange(5), poses)
    later, view = ObjectMap.load(out.path).last_seen("cups")
    assert (later.thing.id, later.stamp, later.frame, later.T_world_camera) == ("thing-0002", 9.0, None, None)
    assert (view.frame, view.keyframe, view.stamp) == ("frame-000030", 3, 1.5)
    assert view.T_world_camera[0, 3] == 3.0 and view.distance == pytest.approx(np.hypot(3.0, 2.0))
    assert view.found_as == "cup" and view.score == pytest.approx(0.6) and view.visible == pytest.approx(0.75)
    assert view.probability == pytest.approx(0.9 * 0.95)


def test_without_a_run_only_the_view_is_known(seen, make_map):
    (view,) = make_map(seen).last_seen("thing-0001")
    assert view.frame == "frame-000030" and view.T_world_camera is None and view.distance is None


def test_a_thing_is_answered_by_id_however_doubtful(seen, make_thing, make_map):
    object_map = make_map(make_thing(1, "cup", 0.2, class_posterior={"cup": 0.2, "bowl": 0.8}, existence=0.3))
    assert len(object_map.last_seen("thing-0001")) == 1
    assert object_map.last_seen("cup") == []
    with pytest.raises(UserError, match="thing-0009"):
        object_map.last_seen("thing-0009")


def test_explain_asks_the_thing(seen, make_map):
    object_map = make_map(seen)
    assert object_map.explain("thing-0001", "bowl").label == "bowl"
    with pytest.raises(UserError, match="thing-0009"):
        object_map.explain("thing-0009")
